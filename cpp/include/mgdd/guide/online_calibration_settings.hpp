// What an online calibration adapts, by which method, and what it holds for known beforehand.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/guide/calibration_parameters.hpp"
#include "mgdd/guide/correlated_step.hpp"
#include "mgdd/guide/cycle_window.hpp"

namespace mgdd::guide {

enum class CalibrationMethod { extremum_seeking, gauss_newton, recursive };

/// Place of a parameter in a CalibrationVector; ParameterError of `field` that lists the names.
int parse_calibrated(std::string_view field, std::string_view name);

struct OnlineCalibrationSettings {
  engine::Cylinder cylinder{};
  CalibrationMethod method = CalibrationMethod::gauss_newton;
  /// Parameters to adapt; extremum seeking takes the wall heat alone.
  std::array<bool, n_calibrated> wanted{true};
  /// Standard deviation of what is known of the others, >= 0; 0: exactly as the model has it.
  std::array<double, n_calibrated> uncertainty = default_uncertainty();
  CycleWindowSettings window{};
  double forgetting = 0.9;  ///< recursive: weight of a window in the next one, in [0, 1]
  /// Scatter of the true start of combustion about the told one from cycle to cycle, in [0, 5]; 0 where it is measured.
  /// It blurs the mean pressure, and what is left of it in one window does not belong to the next.
  double soc_scatter_cad = 0.3;
  double jump_factor = 3.0;   ///< a cycle whose residual is so many times the usual one is not believed, in [1.5, 100]
  int trials_per_update = 5;  ///< extremum seeking, in [1, 100]
  double step_cad = engine::default_step_cad;
  engine::Integrator integrator = engine::Integrator::trapezoid;

  static constexpr std::array<double, n_calibrated> default_uncertainty() noexcept {
    std::array<double, n_calibrated> sd{};
    for (std::size_t i = 0; i < sd.size(); ++i)
      sd[i] = calibrated_parameters[i].known_sd;
    return sd;
  }
};

/// ParameterError names field, value and bound. The window checks its own settings.
void validate(const OnlineCalibrationSettings& settings);

/// Start and knowledge of every parameter; nothing but the width of its domain is known of a wanted one.
Beforehand beforehand_of(const OnlineCalibrationSettings& settings);

}  // namespace mgdd::guide
