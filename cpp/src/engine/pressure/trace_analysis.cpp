#include "mgdd/engine/pressure/trace_analysis.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/gas.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"

namespace mgdd::engine {
namespace {

constexpr std::pair<Pegging, std::string_view> pegging_names[] = {{Pegging::none, "none"},
                                                                  {Pegging::inlet, "inlet"},
                                                                  {Pegging::two_point, "two_point"},
                                                                  {Pegging::least_squares, "least_squares"}};
constexpr std::pair<AnalysisGamma, std::string_view> gamma_names[] = {
    {AnalysisGamma::constant, "constant"}, {AnalysisGamma::split, "split"}, {AnalysisGamma::cylinder, "cylinder"}};

constexpr double coverage_cad = 15.0;  // a trace may end this far inside the closed part
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
using Column = std::vector<double>;

// Mean pressure of the samples within `half` CAD of an angle.
double mean_around(const Column& angle, const Column& pressure, double centre, double half) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (std::abs(angle[k] - centre) <= half + 1e-9) sum += pressure[k], ++count;
  }
  if (count == 0) {
    throw DataError("pegging needs samples at " + text(centre) + " +- " + text(half) +
                    " °CA aTDC, but the trace spans " + text(angle.front()) + " to " + text(angle.back()));
  }
  return sum / count;
}

double angle_where(const Column& angle, const Column& cumulative, std::size_t first, std::size_t peak, double level) {
  for (std::size_t k = first; k < peak; ++k) {
    if (cumulative[k + 1] >= level && cumulative[k + 1] > cumulative[k]) {
      return angle[k] +
             (angle[k + 1] - angle[k]) * std::max(0.0, level - cumulative[k]) / (cumulative[k + 1] - cumulative[k]);
    }
  }
  return nan;
}

// Net heat of one step: dQ = dU + W with U = p V/(gamma - 1) at the step's gamma (Krieger and Borman 1966), in the
// trapezoidal form that the default integrator inverts exactly.
double net_heat_j(double gamma, double p0, double v0, double p1, double v1) {
  return (p1 * v1 - p0 * v0) / (gamma - 1.0) + 0.5 * (p0 + p1) * (v1 - v0);
}

void check_options(const TraceOptions& o) {
  const auto refuse = [](const char* name, double value, const char* bound) {
    throw ParameterError(name, value, std::string("must be ") + bound);
  };
  if (!(o.pegging_exponent > 1.0 && o.pegging_exponent < 1.7)) {
    refuse("pegging_exponent", o.pegging_exponent, "in (1, 1.7)");
  }
  if (o.pegging == Pegging::inlet && !(o.inlet_pressure_kpa > 0.0)) {
    refuse("inlet_pressure_kpa", o.inlet_pressure_kpa, "> 0 kPa for pegging 'inlet'");
  }
  for (const auto& [name, value] : {std::pair{"gamma", o.gamma}, std::pair{"gamma_compression", o.gamma_compression},
                                    std::pair{"gamma_combustion", o.gamma_combustion}}) {
    if (!(value > 1.0 && value < 1.7)) refuse(name, value, "in (1, 1.7)");
  }
  if (!(o.heat_from_cad < o.heat_to_cad)) refuse("heat_from_cad", o.heat_from_cad, "before heat_to_cad");
}

void add_warnings(TraceAnalysis& a, const Cylinder& cylinder, const TraceOptions& options, std::size_t first,
                  std::size_t last) {
  if (a.angle_cad.front() > cylinder.geometry.ivc_cad + coverage_cad ||
      a.angle_cad.back() < cylinder.geometry.evo_cad - coverage_cad) {
    a.warnings.push_back(
        "the trace spans " + text(a.angle_cad.front()) + " to " + text(a.angle_cad.back()) +
        " °CA aTDC of the closed part from ivc_cad = " + text(cylinder.geometry.ivc_cad) +
        " to evo_cad = " + text(cylinder.geometry.evo_cad) +
        ": its work is not the closed-cycle work, and without a trapped mass its temperature is wrong");
  }
  if (a.n_compression < 1.25 || a.n_compression > 1.42) {
    a.warnings.push_back("polytropic exponent of compression " + text(a.n_compression) +
                         " is outside 1.25..1.42: suspect pegging, TDC offset or pressure unit");
  }
  for (std::size_t k = 1; k + 1 < a.pressure_bar.size(); ++k) {
    const double jump = a.pressure_bar[k] - 0.5 * (a.pressure_bar[k - 1] + a.pressure_bar[k + 1]);
    if (std::abs(jump) > 0.1 * a.p_max_bar) {
      a.warnings.push_back("the sample at " + text(a.angle_cad[k]) + " °CA aTDC stands " + text(jump) +
                           " bar off its neighbours: a spike, or a step too coarse");
      break;
    }
  }
  double highest = 0.0;
  for (std::size_t k = first; k < last; ++k)
    highest = std::max(highest, a.heat_net_j[k + 1]);
  if (!a.motored && first + 1 < last && a.heat_net_j[first + 1] > 0.1 * highest) {
    a.warnings.push_back("heat release has begun before heat_from_cad = " + text(options.heat_from_cad) +
                         ": start the window earlier");
  }
  if (!a.motored && a.imep_closed_bar < 0.0) {
    a.warnings.push_back("closed work is negative although heat is released: suspect a TDC offset");
  }
  if (a.motored && (a.p_max_cad < -2.5 || a.p_max_cad > 0.3)) {
    a.warnings.push_back("the trace looks motored but peaks at " + text(a.p_max_cad) +
                         " °CA aTDC, not 0.1 to 1.5 before TDC: suspect a TDC offset");
  }
}

// Without a burn the pressure falls as it rose, less the wall loss; a burn leaves expansion well above compression. Far
// from TDC an offset of the angle hardly moves the ratio: 3 CAD make it 1.07.
bool looks_motored(const TraceAnalysis& a) {
  const double distance_cad = std::min({100.0, -a.angle_cad.front(), a.angle_cad.back()});
  if (distance_cad < 60.0) return false;
  const auto at = [&](double angle) {
    const auto k = std::lower_bound(a.angle_cad.begin(), a.angle_cad.end(), angle) - a.angle_cad.begin();
    return a.pressure_bar[static_cast<std::size_t>(k)];
  };
  return at(distance_cad) < 1.1 * at(-distance_cad);
}

}  // namespace

std::string_view to_string(Pegging v) noexcept {
  return name_of<Pegging>(pegging_names, v);
}
std::string_view to_string(AnalysisGamma v) noexcept {
  return name_of<AnalysisGamma>(gamma_names, v);
}
Pegging parse_pegging(std::string_view t) {
  return parse_name<Pegging>(pegging_names, "pegging", t);
}
AnalysisGamma parse_analysis_gamma(std::string_view t) {
  return parse_name<AnalysisGamma>(gamma_names, "gamma", t);
}

double polytropic_exponent(const Column& angle, const Column& pressure, const Cylinder& cylinder, double from_cad,
                           double to_cad) {
  const Geometry<double> geometry(cylinder.geometry);
  double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (angle[k] < from_cad - 1e-9 || angle[k] > to_cad + 1e-9 || !(pressure[k] > 0.0)) continue;
    const double x = std::log(geometry.volume_m3(angle[k]));
    const double y = std::log(pressure[k]);
    n += 1.0, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  if (n < 3.0) return nan;
  return -(n * sxy - sx * sy) / (n * sxx - sx * sx);
}

double pegging_offset_bar(const Column& angle, const Column& pressure, const Cylinder& cylinder,
                          const TraceOptions& options) {
  check_options(options);
  const Geometry<double> geometry(cylinder.geometry);
  const double n = options.pegging_exponent;
  switch (options.pegging) {
    case Pegging::none:
      return 0.0;
    case Pegging::inlet:  // mean around intake bottom dead centre equals the intake pressure (Randolph 1990)
      return options.inlet_pressure_kpa * units::pa_per_kpa / units::pa_per_bar -
             mean_around(angle, pressure, -180.0, 5.0);
    case Pegging::two_point: {  // p V^n = const through -100 and -65 CAD (Randolph 1990)
      const double p1 = mean_around(angle, pressure, -100.0, 1.0);
      const double p2 = mean_around(angle, pressure, -65.0, 1.0);
      const double ratio = std::pow(geometry.volume_m3(-100.0) / geometry.volume_m3(-65.0), n);
      return (p2 - ratio * p1) / (ratio - 1.0);
    }
    case Pegging::least_squares:
      break;
  }
  // Linear regression p = -offset + C V^-n over -100..-50 CAD (Brunt and Pond 1997).
  double m = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (angle[k] < -100.0 - 1e-9 || angle[k] > -50.0 + 1e-9) continue;
    const double x = std::pow(geometry.volume_m3(angle[k]) / geometry.volume_m3(-100.0), -n);
    m += 1.0, sx += x, sy += pressure[k], sxx += x * x, sxy += x * pressure[k];
  }
  if (m < 5.0) {
    throw DataError("pegging 'least_squares' needs at least 5 samples in -100..-50 °CA aTDC, found " +
                    std::to_string(static_cast<int>(m)));
  }
  const double slope = (m * sxy - sx * sy) / (m * sxx - sx * sx);
  return -(sy - slope * sx) / m;
}

TraceAnalysis analyze_trace(const Column& angle_cad, const Column& pressure_bar, const Cylinder& cylinder,
                            const OperatingPoint& point, const TraceOptions& options) {
  validate(cylinder);
  validate(point);
  check_options(options);
  check_trace(angle_cad, pressure_bar);

  TraceAnalysis a;
  a.pegging_bar = pegging_offset_bar(angle_cad, pressure_bar, cylinder, options);
  for (std::size_t k = 0; k < angle_cad.size(); ++k) {
    if (angle_cad[k] < cylinder.geometry.ivc_cad - 1e-9 || angle_cad[k] > cylinder.geometry.evo_cad + 1e-9) continue;
    a.angle_cad.push_back(angle_cad[k]);
    a.pressure_bar.push_back(pressure_bar[k] + a.pegging_bar);
  }
  const std::size_t n = a.angle_cad.size();
  if (n < 20) {
    throw DataError("only " + std::to_string(n) + " samples lie between ivc_cad = " + text(cylinder.geometry.ivc_cad) +
                    " and evo_cad = " + text(cylinder.geometry.evo_cad) + ": an analysis needs at least 20");
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (!(a.pressure_bar[k] > 0.0)) {
      throw DataError("pressure at " + text(a.angle_cad[k]) + " °CA aTDC is " + text(a.pressure_bar[k]) +
                      " bar after pegging: absolute pressure must be > 0; choose a pegging method");
    }
  }

  const CycleModel<double> model(cylinder, a.angle_cad);
  OperatingPoint measured = point;
  measured.intake_pressure_kpa = a.pressure_bar.front() * units::pa_per_bar / units::pa_per_kpa;
  Charge<double> charge = model.charge(measured);
  charge.pressure_pa = a.pressure_bar.front() * units::pa_per_bar;
  Column pressure_pa(n);
  for (std::size_t k = 0; k < n; ++k)
    pressure_pa[k] = a.pressure_bar[k] * units::pa_per_bar;
  const auto volume = model.volume_m3();
  for (std::size_t k = 0; k < n; ++k) {
    a.volume_l.push_back(volume[k] / units::m3_per_l);
    a.temperature_k.push_back(pressure_pa[k] * volume[k] / charge.gas_j_per_k);
  }

  Column loss(n, 0.0);
  model.wall_heat(charge, pressure_pa, options.burn_from_cad, loss);
  a.heat_net_j.assign(n, 0.0);
  a.heat_loss_j.assign(n, 0.0);
  a.heat_net_cumulative_j.assign(n, 0.0);
  a.heat_gross_cumulative_j.assign(n, 0.0);
  std::size_t first = n, last = 0, net_peak = 0, gross_peak = 0;
  double net = 0.0, gross = 0.0, net_best = 0.0, gross_best = 0.0;
  a.work_closed_j = 0.0;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const double mean_k = 0.5 * (a.temperature_k[k] + a.temperature_k[k + 1]);
    double gamma = options.gamma;
    if (options.gamma_source == AnalysisGamma::cylinder) gamma = gamma_at(cylinder.gas, mean_k);
    if (options.gamma_source == AnalysisGamma::split) {
      gamma = a.angle_cad[k] < options.burn_from_cad ? options.gamma_compression : options.gamma_combustion;
    }
    a.heat_net_j[k + 1] = net_heat_j(gamma, pressure_pa[k], volume[k], pressure_pa[k + 1], volume[k + 1]);
    a.heat_loss_j[k + 1] = loss[k];
    a.work_closed_j += 0.5 * (pressure_pa[k] + pressure_pa[k + 1]) * (volume[k + 1] - volume[k]);
    if (a.angle_cad[k] >= options.heat_from_cad - 1e-9 && a.angle_cad[k + 1] <= options.heat_to_cad + 1e-9) {
      first = std::min(first, k);
      last = k + 1;
      net += a.heat_net_j[k + 1];
      gross += a.heat_net_j[k + 1] + a.heat_loss_j[k + 1];
      if (net > net_best) net_best = net, net_peak = k + 1;
      if (gross > gross_best) gross_best = gross, gross_peak = k + 1;
    }
    a.heat_net_cumulative_j[k + 1] = net;
    a.heat_gross_cumulative_j[k + 1] = gross;
  }
  if (first == n) {
    throw DataError("no sample lies in the heat release window " + text(options.heat_from_cad) + " to " +
                    text(options.heat_to_cad) + " °CA aTDC");
  }
  a.heat_net_j_total = options.total_at_end ? net : net_best;
  a.heat_gross_j_total = options.total_at_end ? gross : gross_best;
  const Column& cumulative = options.fractions_of_gross ? a.heat_gross_cumulative_j : a.heat_net_cumulative_j;
  const double total = options.fractions_of_gross ? gross_best : net_best;
  const std::size_t peak = options.fractions_of_gross ? gross_peak : net_peak;
  const auto fraction = [&](double x) { return angle_where(a.angle_cad, cumulative, first, peak, x * total); };
  a.ca10_cad = fraction(0.1);
  a.ca50_cad = fraction(0.5);
  a.ca90_cad = fraction(0.9);

  a.imep_closed_bar = a.work_closed_j / model.geometry().swept_m3 / units::pa_per_bar;
  const auto at =
      static_cast<std::size_t>(std::max_element(pressure_pa.begin(), pressure_pa.end()) - pressure_pa.begin());
  const Peak<double> top = parabola_peak<double>(a.angle_cad, at, a.pressure_bar[at > 0 ? at - 1 : at],
                                                 a.pressure_bar[at], a.pressure_bar[at + 1 < n ? at + 1 : at]);
  a.p_max_bar = top.value;
  a.p_max_cad = top.angle_cad;
  a.t_max_k = *std::max_element(a.temperature_k.begin(), a.temperature_k.end());
  a.dp_max_bar_per_cad = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k + 1 < n; ++k) {  // two-sided difference: measured traces carry noise
    a.dp_max_bar_per_cad = std::max(a.dp_max_bar_per_cad, (a.pressure_bar[k + 1] - a.pressure_bar[k - 1]) /
                                                              (a.angle_cad[k + 1] - a.angle_cad[k - 1]));
  }
  a.n_compression = polytropic_exponent(a.angle_cad, a.pressure_bar, cylinder, -100.0, -40.0);
  a.n_expansion = polytropic_exponent(a.angle_cad, a.pressure_bar, cylinder, 60.0, 120.0);
  a.motored = looks_motored(a);
  add_warnings(a, cylinder, options, first, last);
  return a;
}

}  // namespace mgdd::engine
