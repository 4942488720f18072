#include "mgdd/guide/model_optimum.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

constexpr double scan_cad = 5.0;                        // guards against flat regions and edges
constexpr int golden_evaluations = 20;                  // from 10 CAD to 0.002
constexpr double golden = 0.38196601125010515;          // (3 - sqrt 5)/2
constexpr double secant_cad = 3.0;                      // of the curvature
constexpr double before_cad = 15.0, behind_cad = 10.0;  // of the bounds: how far a curve goes on
constexpr double worth = 1e-9;                          // of J: an ascent may end that much below the scan

ModelOptimumSettings checked(const ModelOptimumSettings& s) {
  validate(s);
  return s;
}

optimize::GradientDescent ascent_of(const ModelOptimumSettings& s) {
  optimize::GradientDescentSettings g;
  g.space = {optimize::scalar_input(0.5 * (s.lower_cad + s.upper_cad)),
             optimize::scalar_input(s.lower_cad),
             optimize::scalar_input(s.upper_cad),
             {}};
  g.step_size = optimize::scalar_input(s.step_size);
  g.difference = optimize::scalar_input(s.difference_cad);
  g.tolerance = optimize::scalar_input(s.tolerance_cad);
  g.iterations = s.iterations;
  return optimize::GradientDescent(std::move(g));
}

// Of a curve: a degree apart, from before the bounds to behind them as far as the valves are closed.
std::vector<double> timings_of(const ModelOptimumSettings& s) {
  const auto& geometry = s.cylinder.geometry;
  const double first = std::max({s.lower_cad - before_cad, engine::timing_lower_cad, geometry.ivc_cad});
  const double last = std::min({s.upper_cad + behind_cad, engine::timing_upper_cad, geometry.evo_cad - 1.0});
  const auto steps = static_cast<std::size_t>(std::ceil(last - first));
  std::vector<double> out;
  for (std::size_t k = 0; k <= steps; ++k)
    out.push_back(first + (last - first) * static_cast<double>(k) / static_cast<double>(steps));
  return out;
}

bool inside_domains(const engine::OperatingPoint& point) noexcept {
  bool inside = point.fuel_mg > 0.0;
  for (const auto& f : engine::operating_point_fields<double>())
    inside = inside && f.info.domain.contains(f.in(point));
  const auto fits = [](const FieldInfo& info, const std::optional<double>& value) {
    return !value || info.domain.contains(*value);
  };
  return inside && fits(engine::burn_duration_info, point.burn_duration_cad) &&
         fits(engine::trapped_mass_info, point.trapped_mass_g) &&
         fits(engine::ivc_temperature_info, point.ivc_temperature_k);
}

}  // namespace

void validate(const ModelOptimumSettings& s) {
  engine::validate(s.cylinder);
  engine::validate(s.nox);
  engine::validate_timing("lower_cad", s.lower_cad, s.cylinder);
  engine::validate_timing("upper_cad", s.upper_cad, s.cylinder);
  require_positive("step_size", s.step_size);
  require_positive("difference_cad", s.difference_cad);
  require_positive("tolerance_cad", s.tolerance_cad);
  if (s.iterations < 1) throw ParameterError("iterations", s.iterations, "must be >= 1");
  if (!(s.upper_cad - s.lower_cad > 2.0 * s.difference_cad)) {
    throw ParameterError("upper_cad", s.upper_cad, "must be more than 2 difference_cad above lower_cad");
  }
}

ModelOptimum::ModelOptimum(const ModelOptimumSettings& settings)
    : settings_(checked(settings)),
      model_(settings_.cylinder, engine::crank_grid(settings_.cylinder, settings_.step_cad), settings_.integrator),
      work_(model_.make_workspace()),
      ascent_(ascent_of(settings_)),
      timings_(timings_of(settings_)),
      values_(timings_.size(), 0.0) {
  indicator_values_.fill(values_);
}

void ModelOptimum::set_cylinder(const engine::Cylinder& cylinder) {
  engine::validate(cylinder);
  if (!(cylinder.geometry == settings_.cylinder.geometry)) {
    throw ParameterError("geometry of the cylinder differs: make a ModelOptimum of it");
  }
  put_cylinder(cylinder);
}

void ModelOptimum::put_cylinder(const engine::Cylinder& cylinder) noexcept {
  settings_.cylinder = cylinder;
  model_.set_cylinder(cylinder);
}

double ModelOptimum::performance_at(double soc_cad) noexcept {
  engine::Indicators<double> cycle;
  return performance_at(soc_cad, cycle);
}

double ModelOptimum::performance_at(double soc_cad, engine::Indicators<double>& cycle) noexcept {
  model_.run(charge_, soc_cad, work_);
  if (model_.first_unphysical(work_) < model_.angles_cad().size()) return -optimize::unlimited;
  cycle = model_.indicators(charge_, soc_cad, work_);
  const double j = settings_.performance.value(engine::signals_of(cycle, settings_.nox.ppm(cycle.t_max_k)));
  return std::isfinite(j) ? j : -optimize::unlimited;
}

ModelOptimumResult ModelOptimum::find(const engine::OperatingPoint& point) noexcept {
  ModelOptimumResult out;
  if (!inside_domains(point)) return out;
  charge_ = model_.charge(point);
  const double range = settings_.upper_cad - settings_.lower_cad;
  const int cells = std::max(2, static_cast<int>(std::ceil(range / scan_cad)));
  const double width = range / cells;
  double start = settings_.lower_cad, best = -optimize::unlimited;
  for (int k = 0; k <= cells; ++k) {
    const double soc = settings_.lower_cad + k * width;
    const double j = performance_at(soc);
    if (j > best) {
      best = j;
      start = soc;
    }
  }
  if (std::isinf(best)) return out;
  out.j = best;
  const double lower = std::max(start - width, settings_.lower_cad);
  const double upper = std::min(start + width, settings_.upper_cad);
  if (settings_.method == OptimumMethod::golden_section || !climb(start, out)) divide(lower, upper, out);
  out.at_bound = out.soc_cad <= settings_.lower_cad || out.soc_cad >= settings_.upper_cad;
  if (out.soc_cad - secant_cad >= std::max(engine::timing_lower_cad, settings_.cylinder.geometry.ivc_cad) &&
      out.soc_cad + secant_cad <= std::min(engine::timing_upper_cad, settings_.cylinder.geometry.evo_cad - 1e-9)) {
    const double before = performance_at(out.soc_cad - secant_cad), after = performance_at(out.soc_cad + secant_cad);
    const double bend = (before - 2.0 * out.j + after) / (secant_cad * secant_cad);
    out.curvature = std::isfinite(bend) ? bend : 0.0;
  }
  out.found = true;
  return out;
}

// The ascent from the best angle of the scan; false where it does not converge, or to less.
bool ModelOptimum::climb(double start_cad, ModelOptimumResult& out) noexcept {
  ascent_.restart();
  ascent_.shift_estimate(optimize::scalar_input(start_cad - ascent_.estimate()[0]));
  while (ascent_.converged_at() < 0 && ascent_.iteration() < settings_.iterations) {
    const double j[] = {performance_at(ascent_.ask()[0])};
    if (ascent_.tell({j, {}, false}) != optimize::TellStatus::accepted) return false;
  }
  out.iterations = ascent_.iteration();
  const double found = ascent_.estimate()[0];
  if (ascent_.converged_at() < 0) return false;
  const double j = performance_at(found);
  if (!(j >= out.j - worth * std::abs(out.j))) return false;
  out.soc_cad = found;
  out.j = j;
  out.method = OptimumMethod::gradient;
  return true;
}

void ModelOptimum::divide(double lower_cad, double upper_cad, ModelOptimumResult& out) noexcept {
  double lower = lower_cad, upper = upper_cad;
  double left = lower + golden * (upper - lower), right = upper - golden * (upper - lower);
  double at_left = performance_at(left), at_right = performance_at(right);
  for (int k = 2; k < golden_evaluations; ++k) {
    if (at_left > at_right) {
      upper = right;
      right = left;
      at_right = at_left;
      left = lower + golden * (upper - lower);
      at_left = performance_at(left);
    } else {
      lower = left;
      left = right;
      at_left = at_right;
      right = upper - golden * (upper - lower);
      at_right = performance_at(right);
    }
  }
  out.soc_cad = at_left > at_right ? left : right;
  out.j = std::max(at_left, at_right);
  for (const double edge : {settings_.lower_cad, settings_.upper_cad}) {
    if (edge != lower && edge != upper) continue;
    const double j = performance_at(edge);
    if (j < out.j) continue;
    out.soc_cad = edge;
    out.j = j;
  }
  out.method = OptimumMethod::golden_section;
}

bool ModelOptimum::tabulate(const engine::OperatingPoint& point, Curve& j,
                            std::span<double engine::Indicators<double>::* const> indicators,
                            std::span<Curve> curves) noexcept {
  if (!inside_domains(point) || indicators.size() > max_curves || curves.size() != indicators.size()) return false;
  charge_ = model_.charge(point);
  for (std::size_t k = 0; k < timings_.size(); ++k) {
    engine::Indicators<double> cycle;
    values_[k] = performance_at(timings_[k], cycle);
    if (!std::isfinite(values_[k])) return false;
    for (std::size_t i = 0; i < indicators.size(); ++i)
      indicator_values_[i][k] = cycle.*indicators[i];
  }
  Curve drawn;
  std::array<Curve, max_curves> own;
  bool usable = drawn.put(timings_, values_);
  for (std::size_t i = 0; i < indicators.size(); ++i)
    usable = usable && own[i].put(timings_, indicator_values_[i]);
  if (!usable) return false;
  j = drawn;
  std::copy(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(curves.size()), curves.begin());
  return true;
}

GuideValue guide_value(const ModelOptimumResult& found) noexcept {
  if (!found.found) return {};
  GuideValue value{optimize::scalar_input(found.soc_cad)};
  if (found.curvature < 0.0) value.curvature = optimize::scalar_input(found.curvature);
  return value;
}

}  // namespace mgdd::guide
