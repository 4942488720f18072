#include "mgdd/identify/engine/cylinder_residual.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/units.hpp"

namespace mgdd::identify {
namespace {

// The variable at place `active` of a trace's parameters, with its derivative where it falls into this pass.
template <class T>
T as_variable(double value, std::size_t active, std::size_t first_lane) noexcept {
  if constexpr (is_dual_v<T>) {
    const std::size_t lanes = T{}.grad.size();
    if (active >= first_lane && active < first_lane + lanes) {
      return T::seeded(value, static_cast<int>(active - first_lane));
    }
  }
  return T(value);
}

}  // namespace

CylinderResidual::CylinderResidual(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder,
                                   std::vector<LoadBurn> start, std::vector<std::size_t> common,
                                   std::vector<std::size_t> load, double step_cad, engine::Integrator integrator)
    : base_(cylinder), start_(std::move(start)), common_(std::move(common)), load_(std::move(load)) {
  for (std::size_t t = 0; t < traces.size(); ++t) {
    const MeasuredCycle& trace = traces[t];
    if (start_[t].start_pressure_bar == 0.0) start_[t].start_pressure_bar = trace.pressure_bar.front();
    std::vector<double> grid;
    std::vector<std::size_t> sample;
    for (std::size_t k = 0; k < trace.angle_cad.size(); ++k) {
      if (k > 0) {
        const double from = trace.angle_cad[k - 1];
        const double span = trace.angle_cad[k] - from;
        const int parts = std::max(1, static_cast<int>(std::ceil(span / step_cad - 1e-9)));
        for (int i = 1; i < parts; ++i)
          grid.push_back(from + span * i / parts);
      }
      sample.push_back(grid.size());
      grid.push_back(trace.angle_cad[k]);
    }
    engine::CycleModel<double> plain(cylinder, grid, integrator);
    engine::CycleModel<Scalar> dual(engine::lift<Scalar>(cylinder), grid, integrator);
    engine::CycleWorkspace<double> plain_work = plain.make_workspace();
    engine::CycleWorkspace<Scalar> dual_work = dual.make_workspace();
    loads_.push_back({&trace, *std::max_element(trace.pressure_bar.begin(), trace.pressure_bar.end()), n_residuals_,
                      std::move(sample), Runner<double>{std::move(plain), std::move(plain_work)},
                      Runner<Scalar>{std::move(dual), std::move(dual_work)}});
    n_residuals_ += static_cast<Eigen::Index>(trace.angle_cad.size());
  }
}

Eigen::Index CylinderResidual::n_parameters() const noexcept {
  return static_cast<Eigen::Index>(common_.size() + loads_.size() * load_.size());
}

Eigen::Index CylinderResidual::column(std::size_t trace, std::size_t active) const noexcept {
  const std::size_t own = active < common_.size() ? active : active + trace * load_.size();
  return static_cast<Eigen::Index>(own);
}

template <>
CylinderResidual::Runner<double>& CylinderResidual::runner(Load& load) noexcept {
  return load.plain;
}
template <>
CylinderResidual::Runner<CylinderResidual::Scalar>& CylinderResidual::runner(Load& load) noexcept {
  return load.dual;
}

template <class T>
BasicLoadBurn<T> CylinderResidual::load_burn(std::size_t trace, const Eigen::VectorXd& x,
                                             std::size_t first_lane) const noexcept {
  BasicLoadBurn<T> burn;
  constexpr auto from = load_fields<double>();
  constexpr auto to = load_fields<T>();
  for (std::size_t i = 0; i < to.size(); ++i)
    to[i].in(burn) = T(from[i].in(start_[trace]));
  for (std::size_t i = 0; i < load_.size(); ++i) {
    const std::size_t active = common_.size() + i;
    to[load_[i]].in(burn) = as_variable<T>(x[column(trace, active)], active, first_lane);
  }
  return burn;
}

template <class T>
engine::BasicCylinder<T> CylinderResidual::cylinder_of(const Eigen::VectorXd& x,
                                                       std::size_t first_lane) const noexcept {
  engine::BasicCylinder<T> c = engine::lift<T>(base_);
  constexpr auto fields = engine::cylinder_fields<T>();
  for (std::size_t i = 0; i < common_.size(); ++i) {
    fields[common_[i]].in(c) = as_variable<T>(x[static_cast<Eigen::Index>(i)], i, first_lane);
  }
  return c;
}

template <class T>
engine::Charge<T> CylinderResidual::charge(const Load& load, const engine::CycleModel<T>& model,
                                           const engine::BasicCylinder<T>& c,
                                           const BasicLoadBurn<T>& burn) const noexcept {
  engine::BasicOperatingPoint<T> point = engine::lift<T>(load.trace->point);
  const T first_pa = burn.start_pressure_bar * units::pa_per_bar;
  point.intake_pressure_kpa = first_pa / units::pa_per_kpa;
  point.burn_duration_cad = burn.burn_duration_cad;
  point.fuel_mg = burn.fuel_heat_j / c.gas.lower_heating_value_mj_per_kg;
  engine::Charge<T> charge = model.charge(point);
  charge.pressure_pa = first_pa;
  charge.gas_j_per_k = engine::measured_gas_j_per_k<T>(load.trace->angle_cad, load.trace->pressure_bar,
                                                       model.geometry(), base_.geometry.ivc_cad, point);
  return charge;
}

template <class T>
bool CylinderResidual::run(std::size_t trace, const Eigen::VectorXd& x, std::size_t first_lane) noexcept {
  Load& load = loads_[trace];
  Runner<T>& own = runner<T>(load);
  const BasicLoadBurn<T> burn = load_burn<T>(trace, x, first_lane);
  const engine::BasicCylinder<T> c = with_burn(cylinder_of<T>(x, first_lane), burn);
  own.model.set_cylinder(c);
  own.model.run(charge(load, own.model, c, burn), burn.soc_cad, own.work);
  return std::all_of(own.work.pressure_pa.begin(), own.work.pressure_pa.end(),
                     [](const T& p) { return std::isfinite(value_of(p)) && value_of(p) > 0.0; });
}

bool CylinderResidual::operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual,
                                  Eigen::MatrixXd* jacobian) noexcept {
  const std::size_t own = common_.size() + load_.size();
  if (jacobian != nullptr) jacobian->setZero();
  for (std::size_t t = 0; t < loads_.size(); ++t) {
    if (!run<double>(t, x, 0)) return false;
    const Load& load = loads_[t];
    const auto row = [&](std::size_t i) { return load.first_row + static_cast<Eigen::Index>(i); };
    for (std::size_t i = 0; i < load.sample.size(); ++i) {
      const double model_bar = load.plain.work.pressure_pa[load.sample[i]] / units::pa_per_bar;
      residual[row(i)] = (model_bar - load.trace->pressure_bar[i]) / load.p_max_bar;
    }
    if (jacobian == nullptr) continue;
    constexpr auto lanes = static_cast<std::size_t>(engine::sensitivity_lanes);
    for (std::size_t first = 0; first < own; first += lanes) {
      if (!run<Scalar>(t, x, first)) return false;
      for (std::size_t lane = 0; lane < std::min(lanes, own - first); ++lane) {
        const Eigen::Index c = column(t, first + lane);
        for (std::size_t i = 0; i < load.sample.size(); ++i) {
          (*jacobian)(row(i), c) =
              load.dual.work.pressure_pa[load.sample[i]].grad[lane] / (units::pa_per_bar * load.p_max_bar);
        }
      }
    }
  }
  return true;
}

LoadBurn CylinderResidual::burn(std::size_t trace, const Eigen::VectorXd& x) const noexcept {
  return load_burn<double>(trace, x, 0);
}

engine::Cylinder CylinderResidual::cylinder(const Eigen::VectorXd& x) const noexcept {
  return cylinder_of<double>(x, 0);
}

CylinderResidual::Simulated CylinderResidual::simulate(std::size_t trace, const Eigen::VectorXd& x) {
  run<double>(trace, x, 0);
  const Load& load = loads_[trace];
  const LoadBurn at = burn(trace, x);
  const engine::Cylinder c = with_burn(cylinder(x), at);
  Simulated out;
  for (const std::size_t k : load.sample) {
    out.pressure_bar.push_back(load.plain.work.pressure_pa[k] / units::pa_per_bar);
  }
  const engine::Charge<double> own = charge(load, load.plain.model, c, at);
  out.indicators = load.plain.model.indicators(own, at.soc_cad, load.plain.work);
  out.trapped_mass_g = engine::mass_of_gas_g(own.gas_j_per_k);
  return out;
}

}  // namespace mgdd::identify
