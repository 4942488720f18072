#include "cycle_block.hpp"

#include <algorithm>
#include <limits>

namespace mgdd::engine {
namespace {

enum class Heat { none, triangle, wiebe, double_wiebe };

constexpr std::size_t lanes = block_lanes;

// The laws of burn.hpp without branches.
MGDD_INLINE double within_unit(double s) noexcept {
  const double above = s > 0.0 ? s : 0.0;
  return above < 1.0 ? above : 1.0;
}
MGDD_INLINE double triangle(double s) noexcept {
  const double c = within_unit(s);
  const double second = c > 0.5 ? c + c - 1.0 : 0.0;
  return 2.0 * c * c - second * second;
}
MGDD_INLINE double wiebe(double s, double a, double exponent, double per_complete) noexcept {
  const double inside = s > 1e-300 ? s : 1e-300;
  const double fraction = (1.0 - lane_exp(-(a * lane_power(inside, exponent)))) * per_complete;
  const double begun = s > 0.0 ? fraction : 0.0;
  return s < 1.0 ? begun : 1.0;
}

template <Heat heat>
MGDD_INLINE double burned_fraction(const CycleBlock& b, std::size_t l, double angle) noexcept {
  const double s = (angle - b.start[l]) * b.per_duration[l];
  if constexpr (heat == Heat::triangle) {
    return triangle(s);
  } else {
    const double first = wiebe(s, b.a[l], b.exponent[l], b.per_complete[l]);
    if constexpr (heat == Heat::wiebe) return first;
    const double s2 = (angle - b.second_start[l]) * b.second_per_duration[l];
    return (1.0 - b.second_share[l]) * first +
           b.second_share[l] * wiebe(s2, b.a[l], b.second_exponent[l], b.per_complete[l]);
  }
}

/// `at` where `value` passes `best`, otherwise 0; the largest of them is the place of the first maximum. An assignment
/// under a condition would become a branch.
MGDD_INLINE double place_if(double value, double best, double at) noexcept {
  return value > best ? at : 0.0;
}
MGDD_INLINE double larger_of(double a, double b) noexcept {
  return a > b ? a : b;
}

// One loop for each stage of a step: sixteen lanes at a time keep the processor busy while each waits for its roots.
template <bool woschni, bool burning, Heat heat, bool stopping = false>
MGDD_INLINE void steps(const CycleTables& t, std::size_t from, std::size_t to, CycleBlock& b, double* trace) noexcept {
  alignas(64) Lane root, velocity, film, released;
  for (std::size_t k = from; k < to; ++k) {
    const double v0 = t.volume_m3[k], v1 = t.volume_m3[k + 1], dv = v1 - v0, term = t.wall_term[k];
    const double ratio = t.motored_ratio[k], keep = t.keep[k], gain = t.gain[k];
    const double angle = t.angle_cad[k + 1], per_cad = 1.0 / (angle - t.angle_cad[k]);
    const auto at = static_cast<double>(k);
    const double next_at = at + 1.0;

    for (std::size_t l = 0; l < lanes; ++l)
      root[l] = std::sqrt(b.pressure[l]);
    if constexpr (woschni) {
      for (std::size_t l = 0; l < lanes; ++l) {
        if constexpr (burning) {
          velocity[l] = (b.still[l] - b.burning[l] * ratio) + b.per_pa[l] * b.pressure[l];
          film[l] = inverse_fifth_root_guess(velocity[l]);
        }
        root[l] = std::sqrt(root[l]);
      }
      if constexpr (burning) {
        for (std::size_t l = 0; l < lanes; ++l)
          film[l] = inverse_fifth_root_first(velocity[l], film[l]);
      }
    } else {
      for (std::size_t l = 0; l < lanes; ++l)
        film[l] = inverse_fifth_root_first(root[l], inverse_fifth_root_guess(root[l]));
    }
    if constexpr (heat != Heat::none) {
      for (std::size_t l = 0; l < lanes; ++l) {
        const double fraction = burned_fraction<heat>(b, l, angle);
        released[l] = b.heat[l] * (fraction - b.burned[l]);
        b.burned[l] = fraction;
      }
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      if constexpr (!woschni) {
        film[l] = four_fifths_last(root[l], film[l]);  // p^0.4
      } else if constexpr (burning) {
        const double fast = four_fifths_last(velocity[l], film[l]);
        const double moved = velocity[l] > b.still[l] ? fast : b.still_power[l];
        film[l] = root[l] * (at < b.first_burning[l] ? b.still_power[l] : moved);
      } else {
        film[l] = root[l] * b.still_power[l];
      }
    }
    for (std::size_t l = 0; l < lanes; ++l) {
      const double p = b.pressure[l];
      const double loss = b.scale[l] * term * (p * v0 * b.per_gas[l] - b.wall_k[l]) * film[l];
      const double warmed = heat == Heat::none ? keep * p : keep * p + gain * released[l];
      const double next = warmed - gain * loss;
      b.pressure[l] = next;
      trace[(k + 1) * lanes + l] = next;
      const double work = (p + next) * dv;
      const bool counts = !stopping || at < b.stop[l];
      b.work[l] += counts ? work : 0.0;
      b.loss[l] += counts ? loss : 0.0;
      const double energy = next * v1, rise = (next - p) * per_cad;
      b.p_at[l] = larger_of(b.p_at[l], place_if(next, b.p_best[l], next_at));
      b.p_best[l] = larger_of(b.p_best[l], next);
      b.energy_at[l] = larger_of(b.energy_at[l], place_if(energy, b.energy_best[l], next_at));
      b.energy_best[l] = larger_of(b.energy_best[l], energy);
      b.rise_at[l] = larger_of(b.rise_at[l], place_if(rise, b.rise_best[l], at));
      b.rise_best[l] = larger_of(b.rise_best[l], rise);
    }
  }
}

template <Heat heat>
MGDD_INLINE void begin_heat(const CycleTables& t, std::size_t from, CycleBlock& b) noexcept {
  for (std::size_t l = 0; l < lanes; ++l)
    b.burned[l] = burned_fraction<heat>(b, l, t.angle_cad[from]);
}

// The body works on a local copy, so that nothing else can point to it.
template <bool woschni, Heat heat>
MGDD_INLINE void run(const CycleTables& t, HeatWindow window, CycleBlock& block, double* trace) noexcept {
  CycleBlock b = block;
  steps<woschni, false, Heat::none>(t, 0, window.from, b, trace);
  begin_heat<heat>(t, window.from, b);
  steps<woschni, true, heat>(t, window.from, window.to, b, trace);
  steps<woschni, true, Heat::none>(t, window.to, t.n - 1, b, trace);
  block = b;
}

template <bool woschni, Heat heat>
MGDD_INLINE void run_window(const CycleTables& t, HeatWindow window, CycleBlock& block, double* trace) noexcept {
  CycleBlock b = block;
  begin_heat<heat>(t, window.from, b);
  steps<woschni, true, heat, true>(t, window.from, window.to, b, trace);
  block = b;
}

template <bool woschni>
MGDD_INLINE void run_tail(const CycleTables& t, std::size_t from, CycleBlock& block, double* trace) noexcept {
  CycleBlock b = block;
  steps<woschni, true, Heat::none>(t, from, t.n - 1, b, trace);
  block = b;
}

/// Calls `with.operator()<woschni, heat>()` for the laws.
template <class With>
void choose(BurnShape shape, WallHeatModel wall, const With& with) noexcept {
  const auto of_shape = [&]<bool woschni>() {
    switch (shape) {
      case BurnShape::triangle:
        return with.template operator()<woschni, Heat::triangle>();
      case BurnShape::wiebe:
        return with.template operator()<woschni, Heat::wiebe>();
      case BurnShape::double_wiebe:
        break;
    }
    with.template operator()<woschni, Heat::double_wiebe>();
  };
  if (wall == WallHeatModel::woschni) return of_shape.template operator()<true>();
  of_shape.template operator()<false>();
}

void first_samples(const CycleBlock& block, std::size_t at, double* trace) noexcept {
  std::ranges::copy(block.pressure, trace + at * lanes);
}

}  // namespace

void CycleBlock::begin(const CycleTables& tables) noexcept {
  for (Lane* sum : {&work, &loss, &p_at, &energy_at, &rise_at})
    sum->fill(0.0);
  p_best = pressure;
  for (std::size_t l = 0; l < lanes; ++l)
    energy_best[l] = pressure[l] * tables.volume_m3[0];
  rise_best.fill(-std::numeric_limits<double>::infinity());
}

void integrate(const CycleTables& tables, BurnShape shape, WallHeatModel wall, HeatWindow window, CycleBlock& block,
               double* trace, InstructionSet set) noexcept {
  first_samples(block, 0, trace);
  choose(shape, wall, [&]<bool woschni, Heat heat>() {
    dispatch(set, [&]() MGDD_INLINE_LAMBDA { run<woschni, heat>(tables, window, block, trace); });
  });
}

void integrate_window(const CycleTables& tables, BurnShape shape, WallHeatModel wall, HeatWindow window,
                      CycleBlock& block, double* trace, InstructionSet set) noexcept {
  first_samples(block, window.from, trace);
  choose(shape, wall, [&]<bool woschni, Heat heat>() {
    dispatch(set, [&]() MGDD_INLINE_LAMBDA { run_window<woschni, heat>(tables, window, block, trace); });
  });
}

void integrate_tail(const CycleTables& tables, WallHeatModel wall, std::size_t from, CycleBlock& block, double* trace,
                    InstructionSet set) noexcept {
  first_samples(block, from, trace);
  if (wall == WallHeatModel::woschni) {
    return dispatch(set, [&]() MGDD_INLINE_LAMBDA { run_tail<true>(tables, from, block, trace); });
  }
  dispatch(set, [&]() MGDD_INLINE_LAMBDA { run_tail<false>(tables, from, block, trace); });
}

}  // namespace mgdd::engine
