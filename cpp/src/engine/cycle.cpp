#include "mgdd/engine/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/cycle_indicators.hpp"
#include "mgdd/engine/gas.hpp"
#include "mgdd/engine/wall_heat.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::engine {

template <class T>
CycleModel<T>::CycleModel(const BasicCylinder<T>& cylinder, std::vector<double> angles_cad, Integrator integrator)
    : cylinder_(cylinder), geometry_(cylinder.geometry), integrator_(integrator), angles_(std::move(angles_cad)) {
  const std::size_t n = angles_.size();
  if (n < 3)
    throw about("angles_cad", ShapeError("angles_cad has " + std::to_string(n) + " entries: a cycle needs at least 3"));
  for (std::size_t k = 1; k < n; ++k) {
    if (!(angles_[k] > angles_[k - 1])) {
      throw DataError("angles_cad[" + std::to_string(k) + "] = " + std::to_string(angles_[k]) +
                      ": crank angles must increase strictly");
    }
  }
  volume_.resize(n);
  wall_term_.resize(n);
  motored_ratio_.resize(n);
  keep_.resize(n);
  gain_.resize(n);
  tabulate();
}

template <class T>
void CycleModel<T>::set_cylinder(const BasicCylinder<T>& cylinder) noexcept {
  const auto tables_of = [](const BasicCylinder<T>& c) {
    const GeometryParameters<T>& g = c.geometry;
    return std::tie(g.bore_mm, g.stroke_mm, g.connecting_rod_mm, g.compression_ratio, g.bowl_area_factor, c.gas.gamma,
                    c.gas.gamma_model, c.wall_heat.wall_heat_model);
  };
  const bool same = tables_of(cylinder) == tables_of(cylinder_);
  cylinder_ = cylinder;
  if (same) return;
  geometry_ = Geometry<T>(cylinder_.geometry);
  tabulate();
}

template <class T>
void CycleModel<T>::tabulate() noexcept {
  using std::pow;
  const std::size_t n = angles_.size();
  for (std::size_t k = 0; k < n; ++k)
    volume_[k] = geometry_.volume_m3(angles_[k]);
  volume_before_first_ = geometry_.volume_m3(angles_[0] - (angles_[1] - angles_[0]));
  for (std::size_t k = 0; k < n; ++k) {
    const double step = k + 1 < n ? angles_[k + 1] - angles_[k] : 0.0;
    wall_term_[k] = WallHeat<T>::volume_term(cylinder_.wall_heat.wall_heat_model, geometry_, volume_[k], step);
    motored_ratio_[k] = pow(volume_[0] / volume_[k], cylinder_.gas.gamma);
  }
  if (cylinder_.gas.gamma_model != GammaModel::constant) return;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const StepCoefficients c = coefficients(cylinder_.gas.gamma, k);
    keep_[k] = c.keep;
    gain_[k] = c.gain;
  }
}

template <class T>
T CycleModel<T>::volume_before(std::size_t k) const noexcept {
  return k > 0 ? volume_[k - 1] : volume_before_first_;
}

// First law over one step, dU = dQ - dW with U = p V / (gamma - 1), in the four forms of the work term dW:
// trapezoid (p0 + p1)/2 dV; euler p0 dV; tan2018_lagged p0 (V0 - V_before), as printed in Tan 2018, eqs 2-11 to 2-15;
// split: half the heat at V0, adiabatic to V1, half the heat at V1 (Strang 1968).
template <class T>
MGDD_INLINE typename CycleModel<T>::StepCoefficients CycleModel<T>::coefficients(const T& gamma,
                                                                                 std::size_t k) const noexcept {
  using std::pow;
  const T& v0 = volume_[k];
  const T& v1 = volume_[k + 1];
  const T inner = gamma - 1.0;
  switch (integrator_) {
    case Integrator::trapezoid: {
      const T half = 0.5 * inner * (v1 - v0);
      const T per_volume = 1.0 / (v1 + half);
      return {(v0 - half) * per_volume, inner * per_volume};
    }
    case Integrator::split: {
      const T adiabatic = pow(v0 / v1, gamma);
      return {adiabatic, 0.5 * inner * (adiabatic / v0 + 1.0 / v1)};
    }
    case Integrator::tan2018_lagged:
      return {(v0 - inner * (v0 - volume_before(k))) / v1, inner / v1};
    case Integrator::euler:
      break;
  }
  return {(v0 - inner * (v1 - v0)) / v1, inner / v1};
}

template <class T>
std::size_t CycleModel<T>::fill_heat_release(const Charge<T>& charge, const T& soc_cad,
                                             CycleWorkspace<T>& work) const noexcept {
  const std::size_t n = angles_.size();
  std::fill(work.heat_release_j.begin(), work.heat_release_j.end(), T(0.0));
  if (is_constant_zero(charge.fuel_heat_j)) return n;
  const Burn<T> burn(cylinder_.burn, soc_cad, charge.burn_duration_cad);
  const auto begin = angles_.begin();
  const auto first = static_cast<std::size_t>(std::upper_bound(begin, angles_.end(), burn.start_cad()) - begin);
  const double end = burn.end_cad();
  T burned(0.0);  // heat before the first grid angle is lost to the model, as fuel burned before IVC would be
  if (first == 0) burned = burn.fraction(angles_[0]);
  for (std::size_t k = std::max<std::size_t>(first, 1); k < n; ++k) {
    const T next = burn.fraction(angles_[k]);
    work.heat_release_j[k - 1] = charge.fuel_heat_j * (next - burned);
    burned = next;
    if (angles_[k] >= end) break;
  }
  if (!(value_of(charge.fuel_heat_j) > 0.0)) return n;
  return static_cast<std::size_t>(std::lower_bound(begin, angles_.end(), burn.start_cad()) - begin);
}

template <class T>
void CycleModel<T>::run(const Charge<T>& charge, const T& soc_cad, CycleWorkspace<T>& work) const noexcept {
  const std::size_t burning = fill_heat_release(charge, soc_cad, work);
  with_wall_heat(cylinder_.wall_heat.wall_heat_model, [&]<WallHeatModel model>() {
    cylinder_.gas.gamma_model == GammaModel::constant ? integrate<true, model>(charge, burning, work)
                                                      : integrate<false, model>(charge, burning, work);
  });
}

template <class T>
template <bool ConstantGamma, WallHeatModel Model>
void CycleModel<T>::integrate(const Charge<T>& charge, std::size_t first_burning,
                              CycleWorkspace<T>& work) const noexcept {
  const std::size_t n = angles_.size();
  const T per_gas = 1.0 / charge.gas_j_per_k;
  const WallHeat<T> wall(cylinder_.wall_heat, geometry_, charge.pressure_pa, charge.gas_j_per_k, charge.speed_rpm);
  T pressure = charge.pressure_pa;
  work.pressure_pa[0] = pressure;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const T temperature = pressure * volume_[k] * per_gas;
    const T lead = wall.lead_j(temperature, wall_term_[k]);
    const auto film = wall.template film<Model>(pressure, motored_ratio_[k], k >= first_burning);
    const T loss = film.times(lead);
    work.heat_loss_j[k] = loss;
    if constexpr (ConstantGamma) {
      // The film is the last to be known: everything else stands ready, so that one product and one sum wait for it.
      pressure = (keep_[k] * pressure + gain_[k] * work.heat_release_j[k]) - film.times(gain_[k] * lead);
    } else {
      const T heat = work.heat_release_j[k] - loss;
      // gamma at the step's start, then twice at its mean temperature.
      T gamma = gamma_at(cylinder_.gas, temperature);
      T next{};
      for (int pass = 0;; ++pass) {
        const StepCoefficients c = coefficients(gamma, k);
        next = c.keep * pressure + c.gain * heat;
        if (pass == 2) break;
        gamma = gamma_at(cylinder_.gas, T(0.5 * (temperature + next * volume_[k + 1] * per_gas)));
      }
      work.gamma[k] = gamma;
      pressure = next;
    }
    work.pressure_pa[k + 1] = pressure;
  }
  work.heat_loss_j[n - 1] = T(0.0);
}

template <class T>
void CycleModel<T>::wall_heat(const Charge<T>& charge, std::span<const T> pressure_pa, double burning_from_cad,
                              std::span<T> loss_j) const noexcept {
  const WallHeat<T> wall(cylinder_.wall_heat, geometry_, charge.pressure_pa, charge.gas_j_per_k, charge.speed_rpm);
  with_wall_heat(cylinder_.wall_heat.wall_heat_model, [&]<WallHeatModel model>() {
    for (std::size_t k = 0; k + 1 < angles_.size(); ++k) {
      const T& p = pressure_pa[k];
      const T temperature = p * volume_[k] / charge.gas_j_per_k;
      const bool burning = angles_[k] >= burning_from_cad;
      loss_j[k] = wall.template step_j<model>(p, temperature, wall_term_[k], motored_ratio_[k], burning);
    }
  });
}

template <class T>
std::size_t CycleModel<T>::first_unphysical(const CycleWorkspace<T>& work) const noexcept {
  const auto bad = [](const T& p) { return !(std::isfinite(value_of(p)) && value_of(p) > 0.0); };
  return static_cast<std::size_t>(std::find_if(work.pressure_pa.begin(), work.pressure_pa.end(), bad) -
                                  work.pressure_pa.begin());
}

template <class T>
void CycleModel<T>::require_physical(const CycleWorkspace<T>& work) const {
  const std::size_t k = first_unphysical(work);
  if (k == angles_.size()) return;
  throw ConvergenceError("the pressure leaves the physical range at " + text(angles_[k]) +
                         " °CA aTDC: take a smaller step_cad, less wall heat or another point");
}

template <class T>
T CycleModel<T>::step_gamma(std::size_t k, const CycleWorkspace<T>& work) const noexcept {
  return cylinder_.gas.gamma_model == GammaModel::constant ? cylinder_.gas.gamma : work.gamma[k];
}

template <class T>
T CycleModel<T>::booked_work_j(std::size_t k, const CycleWorkspace<T>& work) const noexcept {
  using std::pow;
  const T& p0 = work.pressure_pa[k];
  switch (integrator_) {
    case Integrator::trapezoid:
      return 0.5 * (p0 + work.pressure_pa[k + 1]) * (volume_[k + 1] - volume_[k]);
    case Integrator::split: {
      const T inner = step_gamma(k, work) - 1.0;
      const T heated = p0 * volume_[k] + 0.5 * inner * (work.heat_release_j[k] - work.heat_loss_j[k]);
      return heated * (1.0 - pow(volume_[k] / volume_[k + 1], inner)) / inner;
    }
    case Integrator::tan2018_lagged:
      return p0 * (volume_[k] - volume_before(k));
    case Integrator::euler:
      break;
  }
  return p0 * (volume_[k + 1] - volume_[k]);
}

template <class T>
T CycleModel<T>::energy_change_j(std::size_t k, const CycleWorkspace<T>& work) const noexcept {
  return (work.pressure_pa[k + 1] * volume_[k + 1] - work.pressure_pa[k] * volume_[k]) / (step_gamma(k, work) - 1.0);
}

template <class T>
Indicators<T> CycleModel<T>::indicators(const Charge<T>& charge, const T& soc_cad,
                                        const CycleWorkspace<T>& work) const noexcept {
  const std::size_t n = angles_.size();
  const std::vector<T>& p = work.pressure_pa;
  TraceSums<T> sums;
  double p_best = value_of(p[0]), t_best = value_of(p[0]) * value_of(volume_[0]);
  double slope_best = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k + 1 < n; ++k) {
    sums.work_closed_j += (p[k] + p[k + 1]) * (volume_[k + 1] - volume_[k]);
    sums.heat_loss_j += work.heat_loss_j[k];
    const double next = value_of(p[k + 1]);
    if (next > p_best) p_best = next, sums.p_max_at = k + 1;
    const double energy = next * value_of(volume_[k + 1]);
    if (energy > t_best) t_best = energy, sums.t_max_at = k + 1;
    const double slope = (next - value_of(p[k])) / (angles_[k + 1] - angles_[k]);
    if (slope > slope_best) slope_best = slope, sums.dp_max_at = k;
  }
  sums.work_closed_j = 0.5 * sums.work_closed_j;
  sums.last_pressure_pa = p[n - 1];
  const std::span<const T> volume(volume_);
  Indicators<T> out = indicators_of(figures_of<T>(angles_, volume, sums, [&p](std::size_t k) { return p[k]; }), charge,
                                    CycleVolumes<T>(geometry_, volume),
                                    [this](const T& t_k) MGDD_INLINE_LAMBDA { return gamma_at(cylinder_.gas, t_k); });
  if (value_of(charge.fuel_heat_j) > 0.0) {
    const Burn<T> burn(cylinder_.burn, soc_cad, charge.burn_duration_cad);
    out.ca10_cad = burn.angle_of(0.1);
    out.ca50_cad = burn.angle_of(0.5);
    out.ca90_cad = burn.angle_of(0.9);
  }
  return out;
}

template class CycleModel<double>;
template class CycleModel<Dual<4>>;
template class CycleModel<Dual<8>>;

}  // namespace mgdd::engine
