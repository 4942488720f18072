#include "mgdd/guide/calibration_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "mgdd/common/units.hpp"

namespace mgdd::guide {
namespace {

constexpr double least_variance_share = 0.01;

// The number itself, or the variable in its direction.
template <class T>
T variable(const CalibrationVector& x, int parameter) noexcept {
  if constexpr (is_dual_v<T>) {
    return T::seeded(x[parameter], parameter);
  } else {
    return x[parameter];
  }
}

// Of the timings in the window; a dither and the scatter about it may by chance cancel, but never to less than nothing.
double soc_variance(const CalibrationVector& x, const CalibrationConditions& at) noexcept {
  const double scatter = at.scatter_cad * at.scatter_cad, told = at.soc_sd_cad * at.soc_sd_cad;
  return std::max(told + x[Calibrated::soc_variance] * scatter, least_variance_share * (told + scatter));
}

template <class T>
T& gamma_in_force(engine::GasParameters<T>& gas) noexcept {
  switch (gas.gamma_model) {
    case engine::GammaModel::linear:
      return gas.gamma_linear_300k;
    case engine::GammaModel::polynomial:
      return gas.gamma_polynomial_c0;
    case engine::GammaModel::constant:
      break;
  }
  return gas.gamma;
}

}  // namespace

CalibrationModel::CalibrationModel(const engine::Cylinder& cylinder, double step_cad, engine::Integrator integrator)
    : base_(cylinder),
      lifted_(engine::lift<CalibrationScalar>(cylinder)),
      plain_(cylinder, engine::crank_grid(cylinder, step_cad), integrator),
      dual_(lifted_, engine::crank_grid(cylinder, step_cad), integrator),
      plain_work_(plain_.make_workspace()),
      dual_work_(dual_.make_workspace()),
      weights_(plain_.angles_cad().size()) {
  shifted_by_cad_ = 1.0;
  shift_to(0.0);
}

void CalibrationModel::shift_to(double tdc_cad) noexcept {
  if (tdc_cad == shifted_by_cad_) return;
  const auto angles = plain_.angles_cad();
  std::size_t k = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double at = angles[i] - tdc_cad;
    while (k + 2 < angles.size() && angles[k + 1] <= at)
      ++k;
    weights_[i] = cubic_weights(angles, k, at);
  }
  shifted_by_cad_ = tdc_cad;
}

template <class T>
bool CalibrationModel::run(engine::CycleModel<T>& model, engine::CycleWorkspace<T>& work,
                           const engine::BasicCylinder<T>& base, const CalibrationVector& x,
                           const CalibrationConditions& at, double soc_cad) noexcept {
  engine::BasicCylinder<T> own = base;
  own.wall_heat.wall_heat_scale = variable<T>(x, Calibrated::wall_heat_scale);
  own.wall_heat.wall_temperature_k += variable<T>(x, Calibrated::wall_temperature);
  own.geometry.compression_ratio += variable<T>(x, Calibrated::compression_ratio);
  T& gamma = gamma_in_force(own.gas);
  gamma += variable<T>(x, Calibrated::gamma);
  model.set_cylinder(own);
  engine::Charge<T> charge = model.charge(engine::lift<T>(at.point));
  const T energy = charge.pressure_pa * model.volume_m3()[0];
  charge.gas_j_per_k = energy / (energy / charge.gas_j_per_k + variable<T>(x, Calibrated::charge_temperature));
  charge.fuel_heat_j *= variable<T>(x, Calibrated::fuel_heat);
  charge.burn_duration_cad *= variable<T>(x, Calibrated::burn_duration);
  model.run(charge, soc_cad + variable<T>(x, Calibrated::soc_offset), work);
  return model.first_unphysical(work) == model.angles_cad().size();
}

bool CalibrationModel::predict(const CalibrationVector& x, const CalibrationConditions& at,
                               std::span<double> reading_bar) noexcept {
  shift_to(x[Calibrated::tdc]);
  const double sd = std::sqrt(soc_variance(x, at));
  const std::array<double, 2> nodes{at.soc_cad - sd, at.soc_cad + sd};
  const std::size_t n_nodes = sd > 0.0 ? 2 : 1;
  const double share = x[Calibrated::gain] / (units::pa_per_bar * static_cast<double>(n_nodes));
  std::fill(reading_bar.begin(), reading_bar.end(), x[Calibrated::offset]);
  for (std::size_t node = 0; node < n_nodes; ++node) {
    if (!run(plain_, plain_work_, base_, x, at, nodes[node])) return false;
    for (std::size_t k = 0; k < reading_bar.size(); ++k)
      reading_bar[k] += share * weights_[k].value_of(plain_work_.pressure_pa);
  }
  return true;
}

bool CalibrationModel::differentiate(const CalibrationVector& x, const CalibrationConditions& at,
                                     std::span<const double> reading_bar, CalibrationColumns& out) noexcept {
  shift_to(x[Calibrated::tdc]);
  if (!run(dual_, dual_work_, lifted_, x, at, at.soc_cad)) return false;
  const double gain = x[Calibrated::gain];
  const double variance = soc_variance(x, at);
  const double blur = variance > 0.0 ? at.scatter_cad * at.scatter_cad / variance : 0.0;
  for (std::size_t k = 0; k < weights_.size(); ++k) {
    const CubicWeights& w = weights_[k];
    double pressure = 0.0, slope = 0.0;
    std::array<double, model_directions> by{};
    for (std::size_t i = 0; i < w.count; ++i) {
      const CalibrationScalar& p = dual_work_.pressure_pa[w.first + i];
      pressure += w.value[i] * p.value;
      slope += w.slope[i] * p.value;
      for (std::size_t j = 0; j < by.size(); ++j)
        by[j] += w.value[i] * p.grad[j];
    }
    const auto row = static_cast<Eigen::Index>(k);
    for (std::size_t j = 0; j < by.size(); ++j)
      out(row, static_cast<Eigen::Index>(j)) = gain * by[j] / units::pa_per_bar;
    out(row, Calibrated::tdc) = -gain * slope / units::pa_per_bar;
    out(row, Calibrated::gain) = pressure / units::pa_per_bar;
    out(row, Calibrated::offset) = 1.0;
    // The mean of two timings less the cycle at their mean is the bend times half the variance.
    out(row, Calibrated::soc_variance) =
        blur * (reading_bar[k] - gain * pressure / units::pa_per_bar - x[Calibrated::offset]);
  }
  return true;
}

engine::Cylinder CalibrationModel::cylinder(const CalibrationVector& x,
                                            const std::array<bool, n_calibrated>& taken) const noexcept {
  engine::Cylinder own = base_;
  const auto is = [&](int parameter) { return taken[static_cast<std::size_t>(parameter)]; };
  if (is(Calibrated::wall_heat_scale)) own.wall_heat.wall_heat_scale = x[Calibrated::wall_heat_scale];
  if (is(Calibrated::wall_temperature)) own.wall_heat.wall_temperature_k += x[Calibrated::wall_temperature];
  if (is(Calibrated::compression_ratio)) own.geometry.compression_ratio += x[Calibrated::compression_ratio];
  if (is(Calibrated::gamma)) gamma_in_force(own.gas) += x[Calibrated::gamma];
  if (is(Calibrated::burn_duration)) own.burn.burn_duration_ref_cad *= x[Calibrated::burn_duration];
  if (is(Calibrated::fuel_heat)) own.gas.lower_heating_value_mj_per_kg *= x[Calibrated::fuel_heat];
  return own;
}

}  // namespace mgdd::guide
