#include "mgdd/engine/pressure/indicating.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/engine/pressure/angles.hpp"
#include "mgdd/engine/pressure/heat.hpp"
#include "mgdd/engine/pressure/pegging.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

constexpr double j_per_bar_l = units::pa_per_bar * units::m3_per_l;
constexpr double same_step = 0.01;        // share by which steps of an even grid may differ
constexpr double transition_share = 0.5;  // of the lower end of the band
constexpr double least_knock_cad = 10.0;

SampleRange closed_part(const Column& angle, const GeometryParameters<double>& g) {
  const SampleRange closed = samples_within(angle, g.ivc_cad, g.evo_cad);
  if (closed.second < closed.first + 20) {
    throw DataError("only " + std::to_string(closed.second - closed.first) + " samples lie between ivc_cad = " +
                    text(g.ivc_cad) + " and evo_cad = " + text(g.evo_cad) + ": an analysis needs at least 20");
  }
  return closed;
}

Column volumes_l(const Column& angle, const Geometry<double>& geometry) {
  Column out;
  for (const double at : angle)
    out.push_back(geometry.volume_m3(at) / units::m3_per_l);
  return out;
}

// Integral of p dV over [from, to] by trapezoids, p linear between samples; empty where the trace does not reach.
WeightedSum work_between(const Column& angle, const Geometry<double>& geometry, double from_cad, double to_cad) {
  if (angle.front() > from_cad + 1e-9 || angle.back() < to_cad - 1e-9) return {};
  WeightedSum out{0, Column(angle.size(), 0.0), 0.0};
  for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
    const double from = std::max(angle[k], from_cad), to = std::min(angle[k + 1], to_cad);
    if (!(from < to)) continue;
    const double half = 0.5 * (geometry.volume_m3(to) - geometry.volume_m3(from)) / geometry.swept_m3;
    const double step = angle[k + 1] - angle[k];
    const double late = (from - angle[k] + to - angle[k]) / step;  // share of the later sample in both ends
    out.weights[k] += half * (2.0 - late);
    out.weights[k + 1] += half * late;
  }
  return out;
}

// The same over all 720 degrees, from the last sample to the first one; empty where the trace has fewer.
WeightedSum work_around(const Column& angle, const Geometry<double>& geometry, double step_cad) {
  const double open = 720.0 - (angle.back() - angle.front());
  if (!(open > -1e-6 && open < 1.5 * step_cad)) return {};
  WeightedSum out = work_between(angle, geometry, angle.front(), angle.back());
  const double half = 0.5 * (geometry.volume_m3(angle.front()) - geometry.volume_m3(angle.back())) / geometry.swept_m3;
  out.weights.front() += half;
  out.weights.back() += half;
  return out;
}

double constant_gamma(const TraceOptions& options) {
  validate(options);
  if (options.gamma_source != AnalysisGamma::constant) {
    throw ParameterError(
        "gamma must be a number for the figures of single cycles: the other forms belong to the whole analysis");
  }
  return options.gamma;
}

MGDD_INLINE bool all_finite(const double* p, std::size_t n) noexcept {
  constexpr std::size_t side_by_side = 16;
  std::array<double, side_by_side> sums{};
  std::size_t k = 0;
  for (; k + side_by_side <= n; k += side_by_side) {
    for (std::size_t i = 0; i < side_by_side; ++i)
      sums[i] += 0.0 * p[k + i];
  }
  for (; k < n; ++k)
    sums[0] += 0.0 * p[k];
  return std::accumulate(sums.begin(), sums.end(), 0.0) == 0.0;
}

MGDD_INLINE std::size_t place_of_highest(const double* p, SampleRange range) noexcept {
  constexpr std::size_t side_by_side = 16;
  std::array<double, side_by_side> most{};
  most.fill(p[range.first]);
  std::size_t k = range.first;
  for (; k + side_by_side <= range.second; k += side_by_side) {
    for (std::size_t i = 0; i < side_by_side; ++i)
      most[i] = p[k + i] > most[i] ? p[k + i] : most[i];
  }
  for (; k < range.second; ++k)
    most[0] = p[k] > most[0] ? p[k] : most[0];
  const double highest = *std::max_element(most.begin(), most.end());
  return static_cast<std::size_t>(std::find(p + range.first, p + range.second, highest) - p);
}

}  // namespace

Indicating::Indicating(const std::vector<double>& angle_cad, const Cylinder& cylinder, double speed_rpm,
                       const TraceOptions& o)
    : angle_cad_(angle_cad),
      closed_(closed_part(angle_cad, cylinder.geometry)),
      gamma_(constant_gamma(o)),
      step_cad_(median_step(angle_cad)),
      pegging_(pegging_of(angle_cad, cylinder, o)),
      rise_(std::span(angle_cad).subspan(closed_.first, closed_.second - closed_.first)) {
  const Geometry<double> geometry(cylinder.geometry);
  volume_l_ = volumes_l(angle_cad, geometry);
  const double closed_from = angle_cad[closed_.first], closed_to = angle_cad[closed_.second - 1];
  work_closed_ = work_between(angle_cad, geometry, closed_from, closed_to);
  closed_change_ = std::accumulate(work_closed_.weights.begin(), work_closed_.weights.end(), 0.0);
  work_gross_ = work_between(angle_cad, geometry, -180.0, 180.0);
  work_net_ = work_around(angle_cad, geometry, step_cad_);

  const auto clipped = [&](double from, double to) {
    return samples_within(angle_cad_, std::max(from, closed_from), std::min(to, closed_to));
  };
  heat_ = clipped(o.heat_from_cad.value_or(idle_heat_from_cad), o.heat_to_cad.value_or(idle_heat_to_cad));
  const auto exponent = [&](double from, double to) {
    return exponent_of_logarithms(angle_cad_, volume_l_, std::max(from, closed_from), std::min(to, closed_to));
  };
  compression_ = exponent(compression_from_cad, compression_to_cad);
  expansion_ = exponent(expansion_from_cad, expansion_to_cad);

  if (!(speed_rpm >= 0.0 && speed_rpm < 1e6))
    throw ParameterError("speed_rpm", speed_rpm, "must be in [0, 1e6)", "rpm");
  const double nyquist_hz = 0.5 * units::cad_per_s_per_rpm * speed_rpm / step_cad_;
  const double low = o.knock_low_hz / nyquist_hz, transition = transition_share * low;
  if (!(low + transition < 1.0) || !is_even(angle_cad, same_step)) return;
  BandPass band(low, o.knock_high_hz / nyquist_hz, transition);
  const double margin_cad = (static_cast<double>(band.reach()) + 0.5) * step_cad_;
  const SampleRange window = samples_within(angle_cad_, std::max(o.knock_from_cad, angle_cad.front() + margin_cad),
                                            std::min(o.knock_to_cad, angle_cad.back() - margin_cad));
  if (static_cast<double>(window.second - window.first) * step_cad_ < least_knock_cad) return;
  knock_ = window;
  band_ = std::move(band);
}

Indicating::Workspace Indicating::make_workspace() const {
  return {Column(knock_.second - knock_.first), Column(heat_.second - heat_.first)};
}

CycleFigures Indicating::operator()(const double* p, Workspace& work) const noexcept {
  CycleFigures out;
  bool finite = true;
  std::size_t peak = closed_.first;
  dispatch([&]() MGDD_INLINE_LAMBDA {
    finite = all_finite(p, samples());
    if (!finite) return;
    out.pegging_bar = pegging_(p);
    out.imep_closed_bar = work_closed_(p) + closed_change_ * out.pegging_bar;
    if (!work_gross_.empty()) out.imep_gross_bar = work_gross_(p);
    if (!work_net_.empty()) out.imep_net_bar = work_net_(p);
    peak = place_of_highest(p, closed_);
  });
  if (!finite) {
    out.pegging_bar = undefined<double>();
    return out;
  }
  out.pmep_bar = out.imep_net_bar - out.imep_gross_bar;
  const auto [first, last] = closed_;
  const Peak<double> top =
      parabola_peak(samples_around<double>(std::span(angle_cad_).subspan(first, last - first), peak - first,
                                           [&](std::size_t k) { return p[first + k] + out.pegging_bar; }));
  out.p_max_bar = top.value;
  out.p_max_cad = top.angle_cad;
  const SteepestRise rise = rise_(p + first);
  out.dp_max_bar_per_cad = rise.bar_per_cad;
  out.dp_max_cad = rise.at_cad;
  add_heat(out, p, work);
  add_exponents(out, p);
  add_knock(out, p, work);
  return out;
}

void Indicating::add_heat(CycleFigures& out, const double* p, Workspace& work) const noexcept {
  const auto [first, last] = heat_;
  if (last < first + 2) return;
  const double level = out.pegging_bar;
  double heat = 0.0, best = 0.0;
  std::size_t at = 0;
  work.heat[0] = 0.0;
  for (std::size_t k = first; k + 1 < last; ++k) {
    heat += net_heat(gamma_, p[k] + level, volume_l_[k], p[k + 1] + level, volume_l_[k + 1]);
    work.heat[k + 1 - first] = heat;
    if (heat > best) best = heat, at = k + 1 - first;
  }
  out.heat_net_j = best * j_per_bar_l;
  const double energy = (p[first] + level) * volume_l_[first] / (gamma_ - 1.0);
  if (!(best > burning_share * energy)) return;
  const auto angle = std::span(angle_cad_).subspan(first, last - first);
  const auto reached = [&](double share) { return level_angle_cad(angle, work.heat, 0, at, share * best); };
  out.ca10_cad = reached(0.1);
  out.ca50_cad = reached(0.5);
  out.ca90_cad = reached(0.9);
}

void Indicating::add_exponents(CycleFigures& out, const double* p) const noexcept {
  const auto exponent = [&](const WeightedSum& sum) {
    double total = 0.0;
    for (std::size_t k = 0; k < sum.weights.size(); ++k)
      total += sum.weights[k] * std::log(p[sum.first + k] + out.pegging_bar);
    return !sum.empty() && std::isfinite(total) ? total : undefined<double>();
  };
  out.n_compression = exponent(compression_);
  out.n_expansion = exponent(expansion_);
}

std::span<const double> Indicating::oscillation(const double* p, Workspace& work) const noexcept {
  if (!band_) return {};
  const std::size_t count = knock_.second - knock_.first, reach = band_->reach();
  const std::span<double> sound = std::span(work.sound).first(count);
  band_->apply({p + knock_.first - reach, count + 2 * reach}, sound);
  return sound;
}

void Indicating::add_knock(CycleFigures& out, const double* p, Workspace& work) const noexcept {
  const std::span<const double> sound = oscillation(p, work);
  if (sound.empty()) return;
  double most = 0.0, sum = 0.0, squares = 0.0;
  for (const double x : sound)
    most = std::max(most, std::abs(x)), sum += std::abs(x), squares += x * x;
  out.mapo_bar = most;
  out.impo_bar_cad = sum * step_cad_;
  out.sepo_bar2_cad = squares * step_cad_;
}

}  // namespace mgdd::engine
