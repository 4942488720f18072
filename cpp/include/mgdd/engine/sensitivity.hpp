// Exact forward sensitivities of one cycle, and the step-size error of each indicator. Offline code.
// Sources: Griewank and Walther 2008 (forward mode); Richardson 1911 and Roache 1994 (step-size error).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/indicators.hpp"

namespace mgdd::engine {

inline constexpr int sensitivity_lanes = 4;  ///< directions per pass
using SensitivityScalar = Dual<sensitivity_lanes>;

/// A cycle's continuous inputs in scalar type T, so that any of them can be a variable.
template <class T>
struct CycleInputs {
  BasicCylinder<T> cylinder;
  BasicOperatingPoint<T> point;
  T soc_cad;
};

/// Names of every input with a derivative: `soc_cad`, `burn_duration_cad`, `trapped_mass_g`, the fields of the point
/// and the fields of the cylinder, without IVC and EVO (they place the grid).
std::vector<std::string> differentiable_inputs();

/// Unit of a differentiable input; ParameterError for another name.
std::string_view input_unit(std::string_view name);

/// The input of that name; an optional of the point is filled with the value in force first. ParameterError otherwise.
double& input(CycleInputs<double>& inputs, std::string_view name);
Dual<1>& input(CycleInputs<Dual<1>>& inputs, std::string_view name);
SensitivityScalar& input(CycleInputs<SensitivityScalar>& inputs, std::string_view name);

/// The derivatives along one direction.
template <int N>
Indicators<double> derivatives(const Indicators<Dual<N>>& from, std::size_t direction) noexcept {
  Indicators<double> to;
  constexpr auto source = indicator_fields<Dual<N>>();
  constexpr auto target = indicator_fields<double>();
  for (std::size_t i = 0; i < source.size(); ++i)
    to.*(target[i].member) = (from.*(source[i].member)).grad[direction];
  return to;
}

struct Sensitivities {
  std::vector<std::string> names;  ///< of the inputs, in the order asked
  std::vector<double> angles_cad;
  std::vector<Indicators<double>> indicators;  ///< d indicator / d input, per unit of each
  Eigen::MatrixXd pressure_bar;                ///< [angle, input] d p / d input
  Indicators<double> value;
};

/// Derivatives of every indicator and of the pressure trace. All inputs are validated first.
Sensitivities sensitivities(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                            const std::vector<std::string>& names, double step_cad = default_step_cad,
                            Integrator integrator = Integrator::trapezoid);

/// Step-size error of one indicator at `step_cad` from runs at h, h/2 and h/4.
struct ConvergenceEstimate {
  std::string_view name, unit;
  double value;         ///< at h
  double extrapolated;  ///< Richardson's limit
  double error;         ///< value - extrapolated
  double order;         ///< observed, NaN where the differences do not shrink
};
std::vector<ConvergenceEstimate> convergence(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                                             double step_cad = default_step_cad,
                                             Integrator integrator = Integrator::trapezoid);

}  // namespace mgdd::engine
