// The best timing of the cycle model at an operating point, for use while the engine runs: a bounded amount of work.
// Gradient ascent  theta <- theta + lambda_c [J(theta + c) - J(theta - c)]/(2 c)  (Tan 2018 names lambda_c and c) from
// the best of a coarse scan; golden section (Kiefer 1953) between the neighbours of that angle where the ascent does
// not converge, ends below the scan, or from the outset. SOC in °CA aTDC, J in the unit of the performance.
// `find` is noexcept and allocation-free: at most 9 + 2 iterations + 20 + 2 cycles on the default bounds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/emissions.hpp"
#include "mgdd/engine/performance.hpp"
#include "mgdd/guide/curve.hpp"
#include "mgdd/guide/guide_path.hpp"
#include "mgdd/optimize/laws/gradient_descent.hpp"

namespace mgdd::guide {

enum class OptimumMethod { gradient, golden_section };

struct ModelOptimumSettings {
  engine::Cylinder cylinder{};
  engine::Performance performance{};  ///< to be maximised
  engine::NoxModel nox{};             ///< NOx of the model, where the performance uses it
  OptimumMethod method = OptimumMethod::gradient;
  double lower_cad = -30.0, upper_cad = 10.0;
  double step_size = 15.0;       ///< lambda_c [CAD^2 per unit of J], > 0; converges below 2/|J''|
  double difference_cad = 1.0;   ///< c, > 0; at least 1 where J has kinks
  double tolerance_cad = 0.02;   ///< of a step, > 0
  std::int64_t iterations = 60;  ///< of the ascent, >= 1
  double step_cad = engine::default_step_cad;
  engine::Integrator integrator = engine::Integrator::trapezoid;
};
void validate(const ModelOptimumSettings& settings);

struct ModelOptimumResult {
  bool found = false;  ///< false: no fuel, a point outside the domain of its fields, or no physical cycle
  double soc_cad = 0.0;
  double j = 0.0;
  double curvature = 0.0;  ///< J'' over +-3 CAD; 0 where a neighbour leaves the timing window
  bool at_bound = false;
  OptimumMethod method = OptimumMethod::gradient;  ///< that found it
  std::int64_t iterations = 0;                     ///< of the ascent, the stopping one included
};

class ModelOptimum {
 public:
  static constexpr std::size_t max_curves = 8;

  /// ParameterError naming the field.
  explicit ModelOptimum(const ModelOptimumSettings& settings);

  ModelOptimumResult find(const engine::OperatingPoint& point) noexcept;

  /// J of the model over SOC at an operating point, from 15 CAD before the bounds to 10 after them, and the named
  /// indicators where asked for. False, and nothing written, where `find` would find nothing. About 66 cycles.
  bool tabulate(const engine::OperatingPoint& point, Curve& j) noexcept { return tabulate(point, j, {}, {}); }
  bool tabulate(const engine::OperatingPoint& point, Curve& j,
                std::span<double engine::Indicators<double>::* const> indicators, std::span<Curve> curves) noexcept;

  /// The same model with other parameters, as a calibration finds them; geometry and grid stay. ParameterError for an
  /// invalid cylinder, and nothing has changed then.
  void set_cylinder(const engine::Cylinder& cylinder);
  /// The same for a cylinder that is known to be valid and of that geometry.
  void put_cylinder(const engine::Cylinder& cylinder) noexcept;

  const ModelOptimumSettings& settings() const noexcept { return settings_; }

 private:
  double performance_at(double soc_cad) noexcept;  // -infinity where that cycle is not physical
  double performance_at(double soc_cad, engine::Indicators<double>& cycle) noexcept;
  bool climb(double start_cad, ModelOptimumResult& out) noexcept;
  void divide(double lower_cad, double upper_cad, ModelOptimumResult& out) noexcept;

  ModelOptimumSettings settings_;
  engine::CycleModel<double> model_;
  engine::CycleWorkspace<double> work_;
  optimize::GradientDescent ascent_;
  engine::Charge<double> charge_{};
  std::vector<double> timings_, values_;  // of a curve
  std::array<std::vector<double>, max_curves> indicator_values_;
};

/// What a feed-forward takes: the timing as the one input, with its curvature where that is known.
GuideValue guide_value(const ModelOptimumResult& found) noexcept;

}  // namespace mgdd::guide
