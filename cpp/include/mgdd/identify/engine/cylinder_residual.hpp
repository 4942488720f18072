// The residual of a cylinder calibration with its exact Jacobian: numbers in, numbers out, nothing allocated per call.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/sensitivity.hpp"
#include "mgdd/identify/engine/cylinder_fit.hpp"

namespace mgdd::identify {

class CylinderResidual {
 public:
  /// `common` and `load` index `cylinder_fields` and `load_fields`. Parameter vector: the common ones first, then per
  /// trace the load ones. Traces are kept by reference and must outlive the object.
  CylinderResidual(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder,
                   std::vector<LoadBurn> start, std::vector<std::size_t> common, std::vector<std::size_t> load,
                   double step_cad, engine::Integrator integrator);

  /// Residual (model - measured)/p_max of all traces, and d residual / d parameter when asked. False when the model
  /// leaves the numbers (a pressure that is not finite and positive).
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) noexcept;

  Eigen::Index n_residuals() const noexcept { return n_residuals_; }
  Eigen::Index n_parameters() const noexcept;

  /// Burn of a load, and cylinder of all loads, at a parameter vector.
  LoadBurn burn(std::size_t trace, const Eigen::VectorXd& x) const noexcept;
  engine::Cylinder cylinder(const Eigen::VectorXd& x) const noexcept;

  /// Burn of a load before the search, with the measured start pressure where none was given.
  const LoadBurn& start(std::size_t trace) const noexcept { return start_[trace]; }

  /// Measured highest sample [bar] that scales the residual of a trace.
  double p_max_bar(std::size_t trace) const noexcept { return loads_[trace].p_max_bar; }

  struct Simulated {
    std::vector<double> pressure_bar;  ///< on the measured angles
    engine::Indicators<double> indicators;
    double trapped_mass_g = undefined<double>();
  };
  Simulated simulate(std::size_t trace, const Eigen::VectorXd& x);

 private:
  using Scalar = engine::SensitivityScalar;
  template <class T>
  struct Runner {
    engine::CycleModel<T> model;
    engine::CycleWorkspace<T> work;
  };
  struct Load {
    const MeasuredCycle* trace;
    double p_max_bar;
    Eigen::Index first_row;
    std::vector<std::size_t> sample;  // grid index of each measured angle
    Runner<double> plain;
    Runner<Scalar> dual;
  };

  template <class T>
  Runner<T>& runner(Load& load) noexcept;
  template <class T>
  BasicLoadBurn<T> load_burn(std::size_t trace, const Eigen::VectorXd& x, std::size_t first_lane) const noexcept;
  template <class T>
  engine::BasicCylinder<T> cylinder_of(const Eigen::VectorXd& x, std::size_t first_lane) const noexcept;
  template <class T>
  bool run(std::size_t trace, const Eigen::VectorXd& x, std::size_t first_lane) noexcept;
  template <class T>
  engine::Charge<T> charge(const Load& load, const engine::CycleModel<T>& model, const engine::BasicCylinder<T>& c,
                           const BasicLoadBurn<T>& burn) const noexcept;
  Eigen::Index column(std::size_t trace, std::size_t active) const noexcept;

  engine::Cylinder base_;
  std::vector<LoadBurn> start_;
  std::vector<std::size_t> common_, load_;
  std::vector<Load> loads_;
  Eigen::Index n_residuals_ = 0;
};

}  // namespace mgdd::identify
