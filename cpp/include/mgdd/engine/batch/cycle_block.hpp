// Sixteen cycles on one crank grid, integrated side by side: the step of `CycleModel` for constant gamma, written as
// loops over lanes that the compiler turns into vectors of whatever width the processor has; T is double, or Dual<1>
// for the derivative along one direction. The result of a lane does not depend on its neighbours. SI and °CA aTDC;
// noexcept, no heap.
#pragma once

#include <algorithm>
#include <cstddef>

#include "mgdd/engine/batch/lane.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/math/dispatch.hpp"

namespace mgdd::engine {

/// What all cycles of a block share: columns of a `CycleModel`, which must outlive them.
struct CycleTables {
  const double* angle_cad;
  const double* volume_m3;
  const double* wall_term;
  const double* motored_ratio;
  const double* keep;
  const double* gain;
  std::size_t n = 0;
  std::size_t falling_from = 0;  ///< second sample after the top dead centre: from there the gas expands

  explicit CycleTables(const CycleModel<double>& model) noexcept
      : angle_cad(model.angles_cad().data()),
        volume_m3(model.volume_m3().data()),
        wall_term(model.wall_term().data()),
        motored_ratio(model.motored_ratio().data()),
        keep(model.keep().data()),
        gain(model.gain().data()),
        n(model.angles_cad().size()),
        falling_from(std::min(first_after(0.0) + 1, n - 1)) {}

  /// The first sample after an angle; n if there is none.
  std::size_t first_after(double angle) const noexcept {
    return static_cast<std::size_t>(std::upper_bound(angle_cad, angle_cad + n, angle) - angle_cad);
  }
};

/// State, constants and sums of every lane.
template <class T>
struct alignas(64) CycleBlock {
  Lane<T> pressure, per_gas;                                   // state; 1/(N R)
  Lane<T> scale, wall_k, still, still_power, burning, per_pa;  // of the wall heat
  Lane<T> heat, start, per_duration;                           // of the burn
  Lane<T> a, exponent, per_complete;                           // of the Wiebe laws
  Lane<T> second_share, second_start, second_per_duration, second_exponent;
  Lane<double> first_burning;  // step from which Woschni's combustion term acts
  Lane<double> stop;           // step before which work and loss are summed
  Lane<T> burned, work, loss;  // work is twice the trapezoid of p dV
  Lane<double> p_best, p_at, energy_best, energy_at, rise_best, rise_at;

  /// Sums at zero and the peaks at the first sample.
  void begin(const CycleTables& tables) noexcept;
  /// Constants of one lane in another.
  void copy_lane(std::size_t from, std::size_t to) noexcept;
};

/// Indices between which a block has its heat release: [0, from) without, [from, to) with, [to, n - 1) after it.
struct HeatWindow {
  std::size_t from, to;
};

/// Runs all lanes, which have begun, from IVC to EVO. `trace` gets the pressures, one row for each sample.
template <class T>
void integrate(const CycleTables& tables, BurnShape shape, WallHeatModel model, HeatWindow window, CycleBlock<T>& block,
               Lane<T>* trace, InstructionSet set) noexcept;

/// Runs all lanes over the steps [window.from, window.to) only, from the pressures and sums that stand in the block;
/// work and loss of a lane count before its `stop`.
void integrate_window(const CycleTables& tables, BurnShape shape, WallHeatModel model, HeatWindow window,
                      CycleBlock<double>& block, Lane<double>* trace, InstructionSet set) noexcept;

/// Runs all lanes without heat release from `from` to EVO, with the combustion term of the wall heat.
void integrate_tail(const CycleTables& tables, WallHeatModel model, std::size_t from, CycleBlock<double>& block,
                    Lane<double>* trace, InstructionSet set) noexcept;

extern template struct CycleBlock<double>;
extern template struct CycleBlock<Dual<1>>;

}  // namespace mgdd::engine
