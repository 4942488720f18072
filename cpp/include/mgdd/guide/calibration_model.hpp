// The cycle model as a pressure sensor would show it, and its exact derivatives by the parameters of a calibration:
// reading(angle) = gain p(angle - tdc) + offset. Angles °CA aTDC, pressure bar. `predict` and `differentiate` are
// noexcept and allocation-free.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/guide/calibration_parameters.hpp"
#include "mgdd/math/cubic_weights.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::guide {

inline constexpr int model_directions = 8;  ///< parameters inside the cycle model
using CalibrationScalar = Dual<model_directions>;
using CalibrationColumns = Eigen::Matrix<double, Eigen::Dynamic, n_calibrated>;

/// Mean conditions of the cycles whose mean pressure is compared.
struct CalibrationConditions {
  engine::OperatingPoint point{};
  double soc_cad = 0.0;      ///< mean start of combustion as told
  double soc_sd_cad = 0.0;   ///< its standard deviation among these cycles: a dither moves it on purpose
  double scatter_cad = 0.0;  ///< standard deviation of the true timing about the told one
};

class CalibrationModel {
 public:
  /// Errors of `engine::crank_grid` and the cylinder's own.
  CalibrationModel(const engine::Cylinder& cylinder, double step_cad, engine::Integrator integrator);

  /// The mean reading of cycles that burn at the mean of their timings plus and minus one standard deviation, which is
  /// exact to third order. False where no such cycle exists.
  bool predict(const CalibrationVector& x, const CalibrationConditions& at, std::span<double> reading_bar) noexcept;

  /// d reading / d x, one row per angle, at the mean timing; `reading_bar` as predicted there. False where no such
  /// cycle exists.
  bool differentiate(const CalibrationVector& x, const CalibrationConditions& at, std::span<const double> reading_bar,
                     CalibrationColumns& out) noexcept;

  /// The cylinder of the guide with the parameters for which `taken` is set.
  engine::Cylinder cylinder(const CalibrationVector& x, const std::array<bool, n_calibrated>& taken) const noexcept;

  std::span<const double> angles_cad() const noexcept { return plain_.angles_cad(); }
  std::span<const double> volume_m3() const noexcept { return plain_.volume_m3(); }
  double swept_m3() const noexcept { return plain_.geometry().swept_m3; }
  const engine::Cylinder& base() const noexcept { return base_; }

 private:
  template <class T>
  bool run(engine::CycleModel<T>& model, engine::CycleWorkspace<T>& work, const engine::BasicCylinder<T>& base,
           const CalibrationVector& x, const CalibrationConditions& at, double soc_cad) noexcept;
  void shift_to(double tdc_cad) noexcept;

  engine::Cylinder base_;
  engine::BasicCylinder<CalibrationScalar> lifted_;
  engine::CycleModel<double> plain_;
  engine::CycleModel<CalibrationScalar> dual_;
  engine::CycleWorkspace<double> plain_work_;
  engine::CycleWorkspace<CalibrationScalar> dual_work_;
  std::vector<CubicWeights> weights_;  // of each angle less the offset of TDC
  double shifted_by_cad_ = 0.0;
};

}  // namespace mgdd::guide
