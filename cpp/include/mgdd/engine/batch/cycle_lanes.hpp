// Up to sixteen cycles on the crank grid of one model, run side by side, for constant gamma: what `CycleModel::run` and
// `indicators` give for one, met to 1e-9 and better. T is double, or Dual<1> for the derivatives along one input.
// noexcept and allocation-free once it has a model, so that it may stand in a loop.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "mgdd/engine/batch/cycle_block.hpp"
#include "mgdd/engine/batch/indicator_lanes.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cycle_indicators.hpp"
#include "mgdd/engine/wall_heat.hpp"

namespace mgdd::engine {

template <class T>
class CycleLanes {
 public:
  /// The grid, geometry and gamma of all lanes; the model must outlive them. Allocates.
  void use(const CycleModel<double>& model) {
    model_ = &model;
    const BasicCylinder<T> cylinder = lift<T>(model.cylinder());
    gas_ = cylinder.gas;
    geometry_ = Geometry<T>(cylinder.geometry);
    volume_.assign(model.volume_m3().begin(), model.volume_m3().end());
    trace_.resize(model.angles_cad().size());
    for (Member& member : members_)
      member.known = false;
    window_ = no_window;
    lead_known_ = false;
  }

  /// Charge and wall heat of a lane.
  void set_charge(std::size_t l, const Charge<T>& charge, const WallHeatParameters<T>& wall) noexcept {
    Member& m = members_[l];
    const bool same = m.known && m.charge.pressure_pa == charge.pressure_pa &&
                      m.charge.gas_j_per_k == charge.gas_j_per_k && m.charge.speed_rpm == charge.speed_rpm &&
                      m.wall == wall;
    m.charge = charge;
    block_.pressure.set(l, charge.pressure_pa);  // the state, which a run has moved
    if (same) return;
    m.wall = wall;
    m.known = true;
    if (!lead_known_ || !(wall == lead_wall_)) {
      lead_ = WallHeat<T>::lead(wall, geometry_);
      lead_wall_ = wall;
      lead_known_ = true;
    }
    const auto c =
        WallHeat<T>(wall, geometry_, charge.pressure_pa, charge.gas_j_per_k, charge.speed_rpm, lead_).constants();
    block_.per_gas.set(l, 1.0 / charge.gas_j_per_k);
    block_.scale.set(l, c.scale);
    block_.wall_k.set(l, c.wall_k);
    block_.still.set(l, c.still);
    block_.still_power.set(l, c.still_power);
    block_.burning.set(l, c.burning);
    block_.per_pa.set(l, c.burning_per_pa);
  }

  /// Burn of a lane, after its charge; a charge without fuel is motored.
  void set_burn(std::size_t l, const BurnParameters<T>& parameters, const T& soc_cad) noexcept {
    Member& m = members_[l];
    m.burn.reset();
    if (!(value_of(m.charge.fuel_heat_j) > 0.0)) return set_motored(l);
    const Burn<T>& burn = m.burn.emplace(parameters, soc_cad, m.charge.burn_duration_cad);
    const std::size_t first = first_not_before(burn.start_cad());
    const std::size_t heated_from = std::max<std::size_t>(first, 1) - 1;
    m.heated_to = std::min(first_not_before(burn.end_cad()), trace_.size() - 1);
    window_.from = std::min(window_.from, heated_from);
    window_.to = std::max(window_.to, m.heated_to);
    block_.first_burning.set(l, static_cast<double>(first));
    block_.heat.set(l, m.charge.fuel_heat_j);
    block_.start.set(l, burn.soc_cad);
    block_.per_duration.set(l, 1.0 / burn.duration_cad);
    if (parameters.burn_shape == BurnShape::triangle) return;
    block_.a.set(l, burn.a);
    block_.exponent.set(l, burn.m + 1.0);
    block_.per_complete.set(l, 1.0 / burn.complete);
    block_.second_share.set(l, burn.second_fraction);
    block_.second_start.set(l, burn.soc_cad + burn.second_delay_cad);
    block_.second_per_duration.set(l, 1.0 / burn.second_duration_cad);
    block_.second_exponent.set(l, burn.second_m + 1.0);
  }

  /// Runs the first `count` lanes, which have been set since the last run, from IVC to EVO.
  void run(std::size_t count, InstructionSet set) noexcept {
    fill_up(count);
    const CycleTables tables(*model_);
    block_.begin(tables);
    integrate(tables, shape(), wall_model(), heat_window(), block_, trace_.data(), set);
    window_ = no_window;
  }

  /// False: the pressure of that lane left the physical range. A pressure that was not positive made the root, and all
  /// that follows, NaN.
  bool physical(std::size_t l) const noexcept {
    const double last = value_of(block_.pressure.get(l));
    return std::isfinite(last) && last > 0.0;
  }
  Indicators<T> indicators(std::size_t l, bool burn_angles = true) const noexcept {
    Indicators<T> out = indicators_of(own_figures(l), members_[l].charge, volumes(),
                                      [this](const T&) MGDD_INLINE_LAMBDA { return gas_.gamma; });
    const Member& m = members_[l];
    if (m.burn && burn_angles) {
      out.ca10_cad = m.burn->angle_of(0.1);
      out.ca50_cad = m.burn->angle_of(0.5);
      out.ca90_cad = m.burn->angle_of(0.9);
    }
    return out;
  }
  /// Those of all lanes, in vectors.
  void indicators(IndicatorLanes& out, bool burn_angles, InstructionSet set) const noexcept {
    for (std::size_t l = 0; l < block_lanes; ++l)
      out.set(l, own_figures(l), members_[l].charge);
    finish(out, burn_angles, set);
  }

  // What another way to EVO needs.
  /// Sums of that way; `pressure(k)` around the peaks of the block.
  template <class Pressure>
  TraceFigures<T> figures(std::size_t l, const T& twice_work, const T& loss, const T& last_pressure,
                          const Pressure& pressure) const noexcept {
    TraceSums<T> sums;
    sums.work_closed_j = 0.5 * twice_work;
    sums.heat_loss_j = loss;
    sums.last_pressure_pa = last_pressure;
    sums.p_max_at = static_cast<std::size_t>(block_.p_at.get(l));
    sums.t_max_at = static_cast<std::size_t>(block_.energy_at.get(l));
    sums.dp_max_at = static_cast<std::size_t>(block_.rise_at.get(l));
    return figures_of<T>(model_->angles_cad(), std::span<const T>(volume_), sums, pressure);
  }
  /// Indicators of the figures that `out` holds.
  void finish(IndicatorLanes& out, bool burn_angles, InstructionSet set) const noexcept {
    out.compute(volumes(), gas_.gamma, set);
    if (!burn_angles) return;
    for (std::size_t l = 0; l < block_lanes; ++l) {
      const auto& burn = members_[l].burn;
      if (burn) out.set_burn_angles(l, burn->angle_of(0.1), burn->angle_of(0.5), burn->angle_of(0.9));
    }
  }
  const Charge<T>& charge(std::size_t l) const noexcept { return members_[l].charge; }
  void fill_up(std::size_t count) noexcept {
    for (std::size_t l = count; l < block_lanes; ++l) {
      block_.copy_lane(0, l);
      members_[l].known = false;
    }
  }
  HeatWindow heat_window() const noexcept {
    const std::size_t last = trace_.size() - 1, from = std::min(window_.from, last);
    return {from, std::max(std::min(window_.to, last), from)};
  }
  void forget_window() noexcept { window_ = no_window; }
  std::size_t heated_to(std::size_t l) const noexcept { return members_[l].heated_to; }
  BurnShape shape() const noexcept { return model_->cylinder().burn.burn_shape; }
  WallHeatModel wall_model() const noexcept { return model_->cylinder().wall_heat.wall_heat_model; }
  const Geometry<T>& geometry() const noexcept { return geometry_; }
  CycleBlock<T>& block() noexcept { return block_; }
  Lane<T>* trace() noexcept { return trace_.data(); }

 private:
  struct Member {
    Charge<T> charge{};
    WallHeatParameters<T> wall{};
    bool known = false;  ///< whether the block holds the constants of charge and wall
    std::optional<Burn<T>> burn{};
    std::size_t heated_to = 0;
  };
  static constexpr HeatWindow no_window{std::numeric_limits<std::size_t>::max(), 0};

  /// Sample of the grid, from its step, which only the last one may not have.
  std::size_t first_not_before(double angle_cad) const noexcept {
    const std::span<const double> angles = model_->angles_cad();
    const double steps = (angle_cad - angles[0]) / (angles[1] - angles[0]);
    auto k = static_cast<std::size_t>(std::clamp(steps, 0.0, static_cast<double>(angles.size() - 1)));
    while (k > 0 && angles[k - 1] >= angle_cad)
      --k;
    while (k < angles.size() && angles[k] < angle_cad)
      ++k;
    return k;
  }

  TraceFigures<T> own_figures(std::size_t l) const noexcept {
    return figures(l, block_.work.get(l), block_.loss.get(l), block_.pressure.get(l),
                   [this, l](std::size_t k) { return trace_[k].get(l); });
  }
  CycleVolumes<T> volumes() const noexcept { return {geometry_, std::span<const T>(volume_)}; }

  void set_motored(std::size_t l) noexcept {
    block_.first_burning.set(l, static_cast<double>(trace_.size()));
    for (Lane<T>* none : {&block_.heat, &block_.start, &block_.second_start, &block_.second_share})
      none->set(l, T(0.0));
    for (Lane<T>* one : {&block_.per_duration, &block_.a, &block_.exponent, &block_.per_complete,
                         &block_.second_per_duration, &block_.second_exponent})
      one->set(l, T(1.0));
  }

  const CycleModel<double>* model_ = nullptr;
  GasParameters<T> gas_{};
  Geometry<T> geometry_{GeometryParameters<T>{}};
  std::vector<T> volume_;
  T lead_{};  // of the last wall heat
  WallHeatParameters<T> lead_wall_{};
  bool lead_known_ = false;
  CycleBlock<T> block_{};
  HeatWindow window_ = no_window;
  std::vector<Lane<T>> trace_;
  std::array<Member, block_lanes> members_{};
};

}  // namespace mgdd::engine
