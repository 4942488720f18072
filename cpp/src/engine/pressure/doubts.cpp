#include "mgdd/engine/pressure/doubts.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include <Eigen/Dense>

#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/charge.hpp"
#include "mgdd/engine/pressure/heat.hpp"
#include "mgdd/engine/pressure/pegging.hpp"
#include "mgdd/engine/pressure/sample_doubts.hpp"
#include "mgdd/engine/pressure/warning_text.hpp"

namespace mgdd::engine {
namespace {

constexpr double coverage_cad = 15.0;  // a trace may end this far inside the closed part
constexpr double exponent_low = 1.25, exponent_high = 1.42;
// Offset over p(IVC) that p + offset = C V^-n asks for without any error of level, by four wall-heat laws and gamma(T):
// the cycle model gives -0.02 to 0.09, engines of tests with crevice and blow-by 0.05 to 0.16, measured ones 0.02 to
// 0.07.
constexpr double free_offset_low = -0.03, free_offset_high = 0.17;
// Gross heat by constant gamma over fuel heat: the cycle model gives 0.95 to 1.17; gas whose heat capacity rises as
// that of its molecules, with crevice and blow-by, 0.73 to 0.83 of a stoichiometric charge and 0.85 to 1.01 of a lean
// one.
constexpr double fuel_share_low = 0.83, fuel_share_low_spark = 0.70, fuel_share_high = 1.18, spark_ratio = 14.0;
// Gross IMEP less BMEP: from a friction that no engine falls below to that of a small one at speed, throttled.
constexpr double friction_low_bar = 0.3, friction_high_bar = 4.5;
constexpr double motored_peak_low_cad = -1.5, motored_peak_high_cad = 0.1;
constexpr double window_shift_cad = 5.0, window_tolerance_cad = 1.0;
constexpr double ivc_coldest_k = 250.0, ivc_hottest_k = 400.0, ivc_least_k = 100.0, ivc_most_k = 1500.0;
// A light load of a diesel stays near 950 K; colder than this is not a burn, whatever the mass.
constexpr double fired_coldest_k = 900.0, fired_hottest_k = 3200.0;
constexpr double ivc_lowest_bar = 0.2, ivc_highest_bar = 8.0;
constexpr const char* mass_causes =
    ": suspect trapped_mass_g (g per cycle, not kg or mg), the pressure unit, or the conditions of another trace";

double ivc_bar(const TraceAnalysis& a, const Cylinder& cylinder) {
  return ivc_pressure<double>(a.angle_cad, a.pressure_bar, Geometry<double>(cylinder.geometry),
                              cylinder.geometry.ivc_cad);
}

double ivc_gas_temperature_k(const TraceAnalysis& a, const Cylinder& cylinder) {
  const Geometry<double> geometry(cylinder.geometry);
  return ivc_bar(a, cylinder) * units::pa_per_bar * geometry.volume_m3(cylinder.geometry.ivc_cad) /
         gas_of_mass_j_per_k(a.trapped_mass_g);
}

// Vertex of the least-squares parabola of ln p over 10 CAD to both sides of the highest sample.
double flat_peak_cad(const TraceAnalysis& a) {
  const auto top = std::max_element(a.pressure_bar.begin(), a.pressure_bar.end()) - a.pressure_bar.begin();
  const double centre = a.angle_cad[static_cast<std::size_t>(top)];
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < a.angle_cad.size(); ++k) {
    const double x = a.angle_cad[k] - centre;
    if (std::abs(x) > 10.0 + 1e-9) continue;
    const Eigen::Vector3d row{1.0, x, x * x};
    normal += row * row.transpose();
    right += row * std::log(a.pressure_bar[k]);
  }
  const Eigen::Vector3d fit = normal.ldlt().solve(right);
  return fit[2] < 0.0 ? centre - 0.5 * fit[1] / fit[2] : centre;
}

void doubt_level(TraceAnalysis& a, const Cylinder& cylinder, const TraceOptions& o) {
  const double level = ivc_bar(a, cylinder);
  const auto unit = [](double ratio) {  // of the number read as bar over the likely pressure in bar
    for (const auto& [name, factor] : {std::pair{"MPa", 0.1}, std::pair{"psi", 14.504}, std::pair{"kPa", 100.0}}) {
      if (ratio > factor / 1.6 && ratio < factor * 1.6) return std::string(" looks like ") + name;
    }
    return std::string(" fits no common unit of pressure: suspect a voltage, a relative pressure or the calibration");
  };
  const double stated = o.intake_pressure_kpa ? *o.intake_pressure_kpa * units::pa_per_kpa / units::pa_per_bar : 0.0;
  if (o.intake_pressure_kpa && (level > stated * o.intake_factor || level * o.intake_factor < stated)) {
    a.warnings.push_back({"level", "p(IVC) = " + shown(level) + " bar, but the stated intake pressure is " +
                                       shown(stated) + " bar: the trace" + unit(level / stated) +
                                       "; peg it, or correct the unit"});
  } else if (level < ivc_lowest_bar || level > ivc_highest_bar) {
    a.warnings.push_back({"level", "p(IVC) = " + shown(level) + " bar is outside " + shown(ivc_lowest_bar) + ".." +
                                       shown(ivc_highest_bar) + " bar: the trace" + unit(level / 1.5) +
                                       "; peg it, or correct the unit"});
  }
}

void doubt_mass(TraceAnalysis& a, const Cylinder& cylinder) {
  const double ivc_k = ivc_gas_temperature_k(a, cylinder);
  if (ivc_k < ivc_coldest_k || ivc_k > ivc_hottest_k) {
    a.warnings.push_back({"mass", "mean gas temperature at IVC is " + shown(ivc_k) + " K, outside " +
                                      shown(ivc_coldest_k) + ".." + shown(ivc_hottest_k) + " K" + mass_causes});
  } else if (!a.motored && (a.t_max_k < fired_coldest_k || a.t_max_k > fired_hottest_k)) {
    a.warnings.push_back({"mass", "highest mean gas temperature is " + shown(a.t_max_k) + " K, outside " +
                                      shown(fired_coldest_k) + ".." + shown(fired_hottest_k) + " K of a fired cycle" +
                                      mass_causes});
  }
}

void doubt_compression(TraceAnalysis& a, const Cylinder& cylinder, const TraceOptions& o, const BurnWindow& burn) {
  if (a.n_compression < exponent_low || a.n_compression > exponent_high) {
    a.warnings.push_back({"compression", "polytropic exponent of compression " + shown(a.n_compression) +
                                             " is outside " + shown(exponent_low) + ".." + shown(exponent_high) +
                                             ": suspect pegging, TDC offset or pressure unit"});
  }
  double to = o.earliest_burn_cad ? std::min(-30.0, *o.earliest_burn_cad - 5.0) : -30.0;
  if (burn.found) to = std::min(to, burn.start_cad - 5.0);
  const FreePolytrope free =
      free_polytrope(a.angle_cad, a.pressure_bar, a.volume_l, std::max(-110.0, a.angle_cad.front() + 2.0), to);
  a.compression_offset_bar = free.offset_bar;
  if (std::isnan(free.offset_bar)) return;
  const double level = ivc_bar(a, cylinder), margin = 3.0 * free.offset_stderr_bar;
  if (free.offset_bar < free_offset_low * level - margin || free.offset_bar > free_offset_high * level + margin) {
    a.warnings.push_back({"pegging", "compression follows p + " + shown(free.offset_bar) +
                                         " bar = C V^-n best, where sound traces give " +
                                         shown(free_offset_low * level) + " to " + shown(free_offset_high * level) +
                                         " bar: suspect pegging, then TDC offset or compression ratio"});
  }
}

void doubt_window(TraceAnalysis& a, const TraceOptions& o, const BurnWindow& burn) {
  if (a.motored) return;
  if (!burn.found && !o.heat_from_cad) {
    a.warnings.push_back({"no_burn", "no burn stands out of the scatter: heat is summed over " +
                                         shown(a.heat_from_cad) + " to " + shown(a.heat_to_cad) +
                                         " °CA aTDC; give heat_window_cad"});
  }
  if (burn.found && o.earliest_burn_cad && burn.unbounded_start_cad < *o.earliest_burn_cad - burn_rate_half_cad) {
    a.warnings.push_back(
        {"early_burn", "heat release begins at " + shown(burn.unbounded_start_cad) +
                           " °CA aTDC, before the stated injection or spark at " + shown(*o.earliest_burn_cad) +
                           ": soi_cad is the first injection, a pilot too, in °CA aTDC, negative before TDC"});
  }
  if (burn.found && o.heat_from_cad && burn.start_cad < a.heat_from_cad - burn_rate_half_cad) {
    a.warnings.push_back({"window", "heat release has begun at " + shown(burn.start_cad) +
                                        " °CA aTDC, before heat_from_cad = " + shown(a.heat_from_cad) +
                                        ": start the window earlier"});
  }
  if (std::isnan(a.ca50_cad)) return;
  double largest = 0.0;
  for (const auto& [from, to] : {std::pair{-window_shift_cad, 0.0}, std::pair{window_shift_cad, 0.0},
                                 std::pair{0.0, -window_shift_cad}, std::pair{0.0, window_shift_cad}}) {
    const CumulativeHeat heat = accumulate_heat(a, a.heat_from_cad + from, a.heat_to_cad + to);
    const double moved = burn_angle_cad(a, heat, o.fractions, 0.5) - a.ca50_cad;
    if (!(std::abs(moved) <= std::abs(largest))) largest = moved;
  }
  if (!(std::abs(largest) <= window_tolerance_cad)) {
    a.warnings.push_back({"window_sensitivity", "CA50 moves by " + shown(largest) + " °CA when an end of the window " +
                                                    shown(a.heat_from_cad) + " to " + shown(a.heat_to_cad) +
                                                    " °CA aTDC moves by " + shown(window_shift_cad) +
                                                    ": smooth more, or give heat_window_cad"});
  }
}

void doubt_dead_centre(TraceAnalysis& a) {
  if (!a.motored && a.imep_closed_bar < 0.0) {
    a.warnings.push_back({"tdc", "closed work is negative although heat is released: suspect a TDC offset"});
  }
  if (!a.motored) return;
  const double peak = flat_peak_cad(a);
  if (peak < motored_peak_low_cad || peak > motored_peak_high_cad) {
    a.warnings.push_back({"tdc", "the trace is motored but peaks at " + shown(peak) + " °CA aTDC, not at " +
                                     shown(motored_peak_low_cad) + " to " + shown(motored_peak_high_cad) +
                                     ": suspect a TDC offset, which estimate_tdc places; if it was fired, suspect "
                                     "thermal shock of the sensor"});
  }
}

void doubt_coverage(TraceAnalysis& a, const Cylinder& cylinder) {
  if (a.angle_cad.front() > cylinder.geometry.ivc_cad + coverage_cad ||
      a.angle_cad.back() < cylinder.geometry.evo_cad - coverage_cad) {
    a.warnings.push_back(
        {"coverage", "the trace spans " + shown(a.angle_cad.front()) + " to " + shown(a.angle_cad.back()) +
                         " °CA aTDC of the closed part from ivc_cad = " + shown(cylinder.geometry.ivc_cad) +
                         " to evo_cad = " + shown(cylinder.geometry.evo_cad) +
                         ": its work is not the closed-cycle work, and without a trapped mass its "
                         "temperature is carried back to IVC"});
  }
}

// What the stated fuel and brake work say about the gain of the amplifier.
void doubt_gain(TraceAnalysis& a, const Cylinder& cylinder, const TraceOptions& o) {
  if (a.motored) return;
  const std::string causes = ": suspect the gain of the amplifier, then the stated figure";
  if (o.fuel_heat_j) {
    const double share = a.heat_gross_j / *o.fuel_heat_j;
    const double least = cylinder.geometry.compression_ratio < spark_ratio ? fuel_share_low_spark : fuel_share_low;
    if (share < least || share > fuel_share_high) {
      a.warnings.push_back({"gain", "the gross heat is " + shown(share) + " of the heat of the stated fuel, outside " +
                                        shown(least) + ".." + shown(fuel_share_high) + causes});
    }
  }
  if (!o.bmep_bar) return;
  const double most = a.imep_closed_bar + open_part_at_most_bar(a, cylinder) - *o.bmep_bar;
  const double least = a.imep_closed_bar + open_part_at_least_bar(a, cylinder) - *o.bmep_bar;
  if (most < friction_low_bar || least > friction_high_bar) {
    a.warnings.push_back({"gain", "gross IMEP is " + shown(least) + " to " + shown(most) +
                                      " bar above the stated BMEP, where friction and gas exchange take " +
                                      shown(friction_low_bar) + " to " + shown(friction_high_bar) + " bar" + causes});
  }
}

// Work from EVO to bottom dead centre at `exhaust_bar`, and from there to IVC at a share of p(IVC), over swept volume.
double open_part_bar(const TraceAnalysis& a, const Cylinder& cylinder, double exhaust_bar, double intake_share) {
  const Geometry<double> geometry(cylinder.geometry);
  const double bottom = geometry.volume_m3(180.0);
  const double exhaust = exhaust_bar * (bottom - geometry.volume_m3(a.angle_cad.back()));
  const double intake = intake_share * ivc_bar(a, cylinder) * (bottom - geometry.volume_m3(cylinder.geometry.ivc_cad));
  return (exhaust - intake) / geometry.swept_m3;
}

}  // namespace

double open_part_at_most_bar(const TraceAnalysis& a, const Cylinder& cylinder) {
  return open_part_bar(a, cylinder, a.pressure_bar.back(), 0.7);
}

double open_part_at_least_bar(const TraceAnalysis& a, const Cylinder& cylinder) {
  return open_part_bar(a, cylinder, std::min(a.pressure_bar.back(), 1.0), 1.0);
}

void refuse_impossible(const TraceAnalysis& a, const Cylinder& cylinder, const OperatingPoint& point,
                       const TraceOptions& o) {
  const double ivc_k = ivc_gas_temperature_k(a, cylinder);
  if (point.trapped_mass_g && (ivc_k < ivc_least_k || ivc_k > ivc_most_k)) {
    const double likely = *point.trapped_mass_g * ivc_k / 350.0;
    throw ParameterError("trapped_mass_g", *point.trapped_mass_g,
                         "makes the charge " + shown(ivc_k) + " K at IVC; at 350 K the cylinder holds " +
                             shown(likely) + " g: give grams per cycle, not " + (ivc_k > ivc_most_k ? "kg" : "mg") +
                             ", or correct the pressure unit",
                         "g");
  }
  if (!o.bmep_bar) return;
  const double most = a.imep_closed_bar + open_part_at_most_bar(a, cylinder);
  if (most < *o.bmep_bar) {
    throw about(
        "bmep_bar",
        DataError("closed IMEP is " + shown(a.imep_closed_bar) + " bar and gross IMEP at most " + shown(most) +
                  ", below bmep_bar = " + shown(*o.bmep_bar) +
                  ": an engine gives no more than its gas; suspect TDC, the pressure unit or the displacement"));
  }
}

void add_warnings(TraceAnalysis& a, const Cylinder& cylinder, const TraceOptions& options, const BurnWindow& burn) {
  doubt_coverage(a, cylinder);
  doubt_spikes(a);
  doubt_level(a, cylinder, options);
  doubt_compression(a, cylinder, options, burn);
  doubt_mass(a, cylinder);
  doubt_window(a, options, burn);
  doubt_dead_centre(a);
  doubt_gain(a, cylinder, options);
}

}  // namespace mgdd::engine
