#include "mgdd/engine/batch/cycle_block.hpp"

#include <cmath>
#include <limits>

#include "mgdd/engine/wall_heat.hpp"

namespace mgdd::engine {
namespace {

enum class Heat { none, triangle, wiebe, double_wiebe };

constexpr std::size_t lanes = block_lanes;

// The laws of burn.hpp without branches.
template <class T>
MGDD_INLINE T within_unit(const T& s) noexcept {
  const T above = select(value_of(s) > 0.0, s, T(0.0));
  return select(value_of(above) < 1.0, above, T(1.0));
}
template <class T>
MGDD_INLINE T triangle(const T& s) noexcept {
  const T c = within_unit(s);
  const T second = select(value_of(c) > 0.5, T(c + c - 1.0), T(0.0));
  return 2.0 * c * c - second * second;
}
template <class T>
MGDD_INLINE T wiebe(const T& s, const T& a, const T& exponent, const T& per_complete) noexcept {
  const T inside = select(value_of(s) > 1e-300, s, T(1e-300));
  const T power = lane_exp(T(exponent * lane_log(inside)));
  const T fraction = (1.0 - lane_exp(T(-(a * power)))) * per_complete;
  const T begun = select(value_of(s) > 0.0, fraction, T(0.0));
  return select(value_of(s) < 1.0, begun, T(1.0));
}

template <Heat heat, class T>
MGDD_INLINE T burned_fraction(const CycleBlock<T>& b, std::size_t l, double angle) noexcept {
  const T s = (angle - b.start.get(l)) * b.per_duration.get(l);
  if constexpr (heat == Heat::triangle) {
    return triangle(s);
  } else {
    const T a = b.a.get(l), per_complete = b.per_complete.get(l);
    const T first = wiebe(s, a, b.exponent.get(l), per_complete);
    if constexpr (heat == Heat::wiebe) return first;
    const T s2 = (angle - b.second_start.get(l)) * b.second_per_duration.get(l);
    const T share = b.second_share.get(l);
    return (1.0 - share) * first + share * wiebe(s2, a, b.second_exponent.get(l), per_complete);
  }
}

/// Remembers where the first maximum stands: `at` where `value` passes `best`, otherwise 0, and the largest of them. An
/// assignment under a condition would become a branch.
MGDD_INLINE void keep_peak(Lane<double>& best, Lane<double>& best_at, std::size_t l, double value, double at) noexcept {
  const double passed = value > best.value[l] ? at : 0.0;
  best_at.value[l] = passed > best_at.value[l] ? passed : best_at.value[l];
  best.value[l] = value > best.value[l] ? value : best.value[l];
}

// One loop for each stage of a step: sixteen lanes at a time keep the processor busy while each waits for its roots.
template <WallHeatModel wall, bool burning, Heat heat, bool stopping = false, bool peaks = true, class T>
MGDD_INLINE void steps(const CycleTables& t, std::size_t from, std::size_t to, CycleBlock<T>& b,
                       Lane<T>* trace) noexcept {
  // NOLINTBEGIN(misc-const-correctness): set where a wall heat needs them
  alignas(64) Lane<double> root{}, fifth{};
  alignas(64) Lane<T> velocity{}, film{}, released{};
  // NOLINTEND(misc-const-correctness)
  for (std::size_t k = from; k < to; ++k) {
    const double v0 = t.volume_m3[k], v1 = t.volume_m3[k + 1], dv = v1 - v0, term = t.wall_term[k];
    const double ratio = t.motored_ratio[k], keep = t.keep[k], gain = t.gain[k];
    const double angle = t.angle_cad[k + 1], per_cad = 1.0 / (angle - t.angle_cad[k]);
    const auto at = static_cast<double>(k);
    const double next_at = at + 1.0;

    if constexpr (wall != WallHeatModel::eichelberg) {
      for (std::size_t l = 0; l < lanes; ++l)
        root.value[l] = std::sqrt(b.pressure.value[l]);
    }
    if constexpr (wall == WallHeatModel::woschni) {
      for (std::size_t l = 0; l < lanes; ++l) {
        if constexpr (burning) {
          const T w = (b.still.get(l) - b.burning.get(l) * ratio) + b.per_pa.get(l) * b.pressure.get(l);
          velocity.set(l, w);
          fifth.value[l] = inverse_fifth_root_guess(value_of(w));
        }
        root.value[l] = std::sqrt(root.value[l]);
      }
      if constexpr (burning) {
        for (std::size_t l = 0; l < lanes; ++l)
          fifth.value[l] = inverse_fifth_root_first(velocity.value[l], fifth.value[l]);
      }
    } else if constexpr (wall == WallHeatModel::hohenberg) {
      for (std::size_t l = 0; l < lanes; ++l)
        fifth.value[l] = inverse_fifth_root_first(root.value[l], inverse_fifth_root_guess(root.value[l]));
    }
    if constexpr (heat != Heat::none) {
      for (std::size_t l = 0; l < lanes; ++l) {
        const T fraction = burned_fraction<heat>(b, l, angle);
        released.set(l, b.heat.get(l) * (fraction - b.burned.get(l)));
        b.burned.set(l, fraction);
      }
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      const T p = b.pressure.get(l);
      if constexpr (wall == WallHeatModel::eichelberg) {
        film.set(l, p);
      } else if constexpr (wall == WallHeatModel::hohenberg) {
        film.set(l, with_power(four_fifths_last(root.value[l], fifth.value[l]), 0.4, p));
      } else {
        const T still_power = b.still_power.get(l), fourth = with_power(root.value[l], 0.25, p);
        if constexpr (burning) {
          const T w = velocity.get(l);
          const T fast = with_power(four_fifths_last(velocity.value[l], fifth.value[l]), 0.8, w);
          const T moved = select(velocity.value[l] > b.still.value[l], fast, still_power);
          film.set(l, fourth * select(at < b.first_burning.value[l], still_power, moved));
        } else {
          film.set(l, fourth * still_power);
        }
      }
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      const T p = b.pressure.get(l);
      const T loss = b.scale.get(l) * term * (p * v0 * b.per_gas.get(l) - b.wall_k.get(l)) * film.get(l);
      T warmed = keep * p;
      if constexpr (heat != Heat::none) warmed = warmed + gain * released.get(l);
      const T next = warmed - gain * loss;
      b.pressure.set(l, next);
      trace[k + 1].set(l, next);
      const T work = (p + next) * dv;
      const bool counts = !stopping || at < b.stop.value[l];
      b.work.set(l, b.work.get(l) + select(counts, work, T(0.0)));
      b.loss.set(l, b.loss.get(l) + select(counts, loss, T(0.0)));
      if constexpr (!peaks) continue;
      const double after = value_of(next);
      keep_peak(b.p_best, b.p_at, l, after, next_at);
      keep_peak(b.energy_best, b.energy_at, l, after * v1, next_at);
      keep_peak(b.rise_best, b.rise_at, l, (after - value_of(p)) * per_cad, at);
    }
  }
}

template <Heat heat, class T>
MGDD_INLINE void begin_heat(const CycleTables& t, std::size_t from, CycleBlock<T>& b) noexcept {
  for (std::size_t l = 0; l < lanes; ++l)
    b.burned.set(l, burned_fraction<heat>(b, l, t.angle_cad[from]));
}

MGDD_INLINE std::size_t larger_index(std::size_t a, std::size_t b) noexcept {
  return a > b ? a : b;
}

/// Whether the gas of every lane is hotter than the wall at that sample.
template <class T>
MGDD_INLINE bool walls_cool(const CycleTables& t, std::size_t at, const CycleBlock<T>& b) noexcept {
  bool cool = true;
  for (std::size_t l = 0; l < lanes; ++l)
    cool = cool && b.pressure.value[l] * t.volume_m3[at] * b.per_gas.value[l] > b.wall_k.value[l];
  return cool;
}

// The bodies work on a local copy, so that nothing else can point to it.
template <WallHeatModel wall, Heat heat, class T>
MGDD_INLINE void run(const CycleTables& t, HeatWindow window, CycleBlock<T>& block, Lane<T>* trace) noexcept {
  CycleBlock<T> b = block;
  steps<wall, false, Heat::none>(t, 0, window.from, b, trace);
  begin_heat<heat>(t, window.from, b);
  steps<wall, true, heat>(t, window.from, window.to, b, trace);
  // In expansion without heat release no peak follows, unless a wall that is hotter than the gas still heats it.
  const std::size_t last = t.n - 1, falling = larger_index(window.to, t.falling_from);
  steps<wall, true, Heat::none>(t, window.to, falling, b, trace);
  if (walls_cool(t, falling, b)) {
    steps<wall, true, Heat::none, false, false>(t, falling, last, b, trace);
  } else {
    steps<wall, true, Heat::none>(t, falling, last, b, trace);
  }
  block = b;
}

template <WallHeatModel wall, Heat heat>
MGDD_INLINE void run_window(const CycleTables& t, HeatWindow window, CycleBlock<double>& block,
                            Lane<double>* trace) noexcept {
  CycleBlock<double> b = block;
  begin_heat<heat>(t, window.from, b);
  steps<wall, true, heat, true>(t, window.from, window.to, b, trace);
  block = b;
}

template <WallHeatModel wall>
MGDD_INLINE void run_tail(const CycleTables& t, std::size_t from, CycleBlock<double>& block,
                          Lane<double>* trace) noexcept {
  CycleBlock<double> b = block;
  steps<wall, true, Heat::none, false, false>(t, from, t.n - 1, b, trace);
  block = b;
}

/// Calls `with.operator()<wall, heat>()` for the laws.
template <class With>
void choose(BurnShape shape, WallHeatModel model, const With& with) noexcept {
  with_wall_heat(model, [&]<WallHeatModel wall>() {
    switch (shape) {
      case BurnShape::triangle:
        return with.template operator()<wall, Heat::triangle>();
      case BurnShape::wiebe:
        return with.template operator()<wall, Heat::wiebe>();
      case BurnShape::double_wiebe:
        break;
    }
    with.template operator()<wall, Heat::double_wiebe>();
  });
}

}  // namespace

template <class T>
void CycleBlock<T>::begin(const CycleTables& tables) noexcept {
  work.fill(T(0.0));
  loss.fill(T(0.0));
  for (Lane<double>* place : {&p_at, &energy_at, &rise_at})
    place->fill(0.0);
  p_best.value = pressure.value;
  for (std::size_t l = 0; l < lanes; ++l)
    energy_best.value[l] = pressure.value[l] * tables.volume_m3[0];
  rise_best.fill(-std::numeric_limits<double>::infinity());
}

template <class T>
void CycleBlock<T>::copy_lane(std::size_t from, std::size_t to) noexcept {
  for (Lane<T>* lane :
       {&pressure, &per_gas, &scale, &wall_k, &still, &still_power, &burning, &per_pa, &heat, &start, &per_duration, &a,
        &exponent, &per_complete, &second_share, &second_start, &second_per_duration, &second_exponent})
    lane->set(to, lane->get(from));
  for (Lane<double>* lane : {&first_burning, &stop})
    lane->set(to, lane->get(from));
}

template struct CycleBlock<double>;
template struct CycleBlock<Dual<1>>;

template <class T>
void integrate(const CycleTables& tables, BurnShape shape, WallHeatModel model, HeatWindow window, CycleBlock<T>& block,
               Lane<T>* trace, InstructionSet set) noexcept {
  trace[0] = block.pressure;
  choose(shape, model, [&]<WallHeatModel wall, Heat heat>() {
    dispatch(set, [&]() MGDD_INLINE_LAMBDA { run<wall, heat>(tables, window, block, trace); });
  });
}
template void integrate(const CycleTables&, BurnShape, WallHeatModel, HeatWindow, CycleBlock<double>&, Lane<double>*,
                        InstructionSet) noexcept;
template void integrate(const CycleTables&, BurnShape, WallHeatModel, HeatWindow, CycleBlock<Dual<1>>&, Lane<Dual<1>>*,
                        InstructionSet) noexcept;

void integrate_window(const CycleTables& tables, BurnShape shape, WallHeatModel model, HeatWindow window,
                      CycleBlock<double>& block, Lane<double>* trace, InstructionSet set) noexcept {
  trace[window.from] = block.pressure;
  choose(shape, model, [&]<WallHeatModel wall, Heat heat>() {
    dispatch(set, [&]() MGDD_INLINE_LAMBDA { run_window<wall, heat>(tables, window, block, trace); });
  });
}

void integrate_tail(const CycleTables& tables, WallHeatModel model, std::size_t from, CycleBlock<double>& block,
                    Lane<double>* trace, InstructionSet set) noexcept {
  trace[from] = block.pressure;
  with_wall_heat(model, [&]<WallHeatModel wall>() {
    dispatch(set, [&]() MGDD_INLINE_LAMBDA { run_tail<wall>(tables, from, block, trace); });
  });
}

}  // namespace mgdd::engine
