#include "shared_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mgdd/engine/cylinder.hpp"
#include "mgdd/math/lane_functions.hpp"
#include "mgdd/math/lanes.hpp"

namespace mgdd::engine {
namespace {

// Pressures of the nodes over that of the motored gas at the first sample of the tail.
constexpr double lowest_ratio = 1.1;
constexpr double ratio_growth = 1.15;  ///< of the lowest, until no node meets the kink of Woschni's law
constexpr int growths = 6;
constexpr double highest_ratio = 16.0;
constexpr double tolerance = 1e-8;  ///< of a polynomial's last coefficient over its values

}  // namespace

void SharedPoint::prepare(const CycleTables& tables, const CycleBlock<double>& block, WallHeatModel wall,
                          InstructionSet set) {
  n_ = tables.n;
  tail_from_ = tables.falling_from;
  run_motored(tables, block, wall);
  has_tail_ = false;
  double ratio = lowest_ratio;
  for (int i = 0; i < growths && !has_tail_; ++i, ratio *= ratio_growth) {
    const double lowest = ratio * block.pressure.value[0] * tables.motored_ratio[tail_from_];
    has_tail_ = run_tail(tables, block, lowest, wall, set);
  }
}

// The same operations in the same order as a lane of a block, whose bits it must give.
void SharedPoint::run_motored(const CycleTables& t, const CycleBlock<double>& block, WallHeatModel wall) {
  const std::size_t last = std::min(t.first_after(timing_upper_cad), t.n - 1);
  motored_.resize(last + 1);
  const double p0 = block.pressure.value[0];
  MotoredSample s{p0, 0.0, 0.0, p0, 0.0, p0 * t.volume_m3[0], 0.0, -std::numeric_limits<double>::infinity(), 0.0};
  motored_[0] = s;
  for (std::size_t k = 0; k < last; ++k) {
    const double p = s.pressure, v0 = t.volume_m3[k], v1 = t.volume_m3[k + 1];
    double film = p;  // Eichelberg's
    if (wall == WallHeatModel::woschni) film = std::sqrt(std::sqrt(p)) * block.still_power.value[0];
    if (wall == WallHeatModel::hohenberg) film = lane_four_fifths(std::sqrt(p));
    const double loss =
        block.scale.value[0] * t.wall_term[k] * (p * v0 * block.per_gas.value[0] - block.wall_k.value[0]) * film;
    s.pressure = t.keep[k] * p - t.gain[k] * loss;
    s.work += (p + s.pressure) * (v1 - v0);
    s.loss += loss;
    const double energy = s.pressure * v1;
    const double rise = (s.pressure - p) * (1.0 / (t.angle_cad[k + 1] - t.angle_cad[k]));
    if (s.pressure > s.p_best) s.p_best = s.pressure, s.p_at = static_cast<double>(k + 1);
    if (energy > s.energy_best) s.energy_best = energy, s.energy_at = static_cast<double>(k + 1);
    if (rise > s.rise_best) s.rise_best = rise, s.rise_at = static_cast<double>(k);
    motored_[k + 1] = s;
  }
}

bool SharedPoint::run_tail(const CycleTables& t, const CycleBlock<double>& block, double lowest_pa, WallHeatModel wall,
                           InstructionSet set) {
  const double reference_pa = block.pressure.value[0];  // p(IVC), where Woschni's motored pressure begins
  CycleBlock<double> nodes{};
  const double highest = highest_ratio * reference_pa * t.motored_ratio[tail_from_];
  const double half = 0.5 * std::log(highest / lowest_pa);
  for (std::size_t j = 0; j < n_nodes; ++j) {  // Chebyshev's extrema, from the lowest to the highest
    const double angle = std::numbers::pi * static_cast<double>(j) / static_cast<double>(n_nodes - 1);
    nodes.pressure.value[j] = lowest_pa * std::exp(half * (1.0 - std::cos(angle)));
    nodes.per_gas.value[j] = block.per_gas.value[0];
    nodes.scale.value[j] = block.scale.value[0];
    nodes.wall_k.value[j] = block.wall_k.value[0];
    nodes.still.value[j] = block.still.value[0];
    nodes.still_power.value[j] = block.still_power.value[0];
    nodes.burning.value[j] = block.burning.value[0];
    nodes.per_pa.value[j] = block.per_pa.value[0];
    nodes.first_burning.value[j] = 0.0;
  }
  nodes.begin(t);
  trace_.resize(n_);
  coldest_pa_.resize(n_);
  for (std::size_t k = tail_from_; k < n_; ++k)
    coldest_pa_[k] = block.wall_k.value[0] / (t.volume_m3[k] * block.per_gas.value[0]);
  integrate_tail(t, wall, tail_from_, nodes, trace_.data(), set);
  // Work and heat that are left, from the end backwards; the heat from the pressures, in which every step is linear.
  work_left_.assign(n_ * n_nodes, 0.0);
  loss_left_.assign(n_ * n_nodes, 0.0);
  log_pressure_.resize(n_ * n_nodes);
  weight_.resize(n_ * n_nodes);
  row_.assign(n_, Row::unknown);
  for (std::size_t k = n_ - 1; k-- > tail_from_;) {
    const double dv = t.volume_m3[k + 1] - t.volume_m3[k], per_gain = 1.0 / t.gain[k];
    for (std::size_t j = 0; j < n_nodes; ++j) {
      const double p = trace_[k].value[j], next = trace_[k + 1].value[j];
      work_left_[k * n_nodes + j] = work_left_[(k + 1) * n_nodes + j] + (p + next) * dv;
      loss_left_[k * n_nodes + j] = loss_left_[(k + 1) * n_nodes + j] + (t.keep[k] * p - next) * per_gain;
    }
  }
  if (wall != WallHeatModel::woschni) return true;
  for (std::size_t k = tail_from_; k < n_; ++k) {
    if (!(trace_[k].value[0] > reference_pa * t.motored_ratio[k])) return false;
  }
  return true;
}

void SharedPoint::begin(std::size_t k, CycleBlock<double>& block) const noexcept {
  const MotoredSample& s = motored_[k];
  block.pressure.fill(s.pressure);
  block.work.fill(s.work);
  block.loss.fill(s.loss);
  block.p_best.fill(s.p_best);
  block.p_at.fill(s.p_at);
  block.energy_best.fill(s.energy_best);
  block.energy_at.fill(s.energy_at);
  block.rise_best.fill(s.rise_best);
  block.rise_at.fill(s.rise_at);
}

void SharedPoint::prepare_row(std::size_t k) noexcept {
  double* q = log_pressure_.data() + k * n_nodes;
  double* weight = weight_.data() + k * n_nodes;
  for (std::size_t j = 0; j < n_nodes; ++j)
    q[j] = lane_log(trace_[k].value[j]);
  for (std::size_t j = 0; j < n_nodes; ++j) {
    double product = 1.0;
    for (std::size_t i = 0; i < n_nodes; ++i)
      product *= i == j ? 1.0 : q[j] - q[i];
    weight[j] = 1.0 / product;
  }
  // The last Chebyshev coefficient of each polynomial says how well the nodes resolve it.
  const double half = 0.5 * (q[n_nodes - 1] - q[0]);
  const double of_last = std::ldexp(std::pow(half, n_nodes - 1), 2 - static_cast<int>(n_nodes));
  const auto resolved = [&](const double* f) {
    double leading = 0.0, largest = 0.0;
    for (std::size_t j = 0; j < n_nodes; ++j) {
      leading += weight[j] * f[j];
      largest = std::max(largest, std::abs(f[j]));
    }
    return std::abs(leading) * of_last <= tolerance * largest;
  };
  const bool good = resolved(work_left_.data() + k * n_nodes) && resolved(loss_left_.data() + k * n_nodes) &&
                    resolved(trace_[n_ - 1].value.data());
  row_[k] = good ? Row::good : Row::unresolved;
}

bool SharedPoint::reaches(std::size_t k, double pressure_pa) noexcept {
  const double* p = trace_[k].value.data();
  // A gas that is colder than the wall might still find its peak.
  if (!has_tail_ || !(pressure_pa > coldest_pa_[k])) return false;
  if (!(pressure_pa >= p[0] && pressure_pa <= p[n_nodes - 1])) return false;
  if (row_[k] == Row::unknown) prepare_row(k);
  return row_[k] == Row::good;
}

void SharedPoint::find(TailLanes& tails, InstructionSet set) noexcept {
  for (std::size_t l = 0; l < block_lanes; ++l)
    tails.known[l] = reaches(tails.from[l], tails.pressure.value[l]);
  dispatch(set, [&]() MGDD_INLINE_LAMBDA {
    Lane<double> at{};
    for (std::size_t l = 0; l < block_lanes; ++l)
      at.value[l] = lane_log(tails.pressure.value[l]);
    for (std::size_t l = 0; l < block_lanes; ++l) {
      if (!tails.known[l]) continue;
      const std::size_t first = tails.from[l] * n_nodes;
      const double* q = log_pressure_.data() + first;
      const double* weight = weight_.data() + first;
      const double* work = work_left_.data() + first;
      const double* loss = loss_left_.data() + first;
      const double* last = trace_[n_ - 1].value.data();
      // Four sums of each, which are one vector.
      using Sums = Lanes<4>;
      Sums sum(0.0), work_sum(0.0), loss_sum(0.0), last_sum(0.0);
      for (std::size_t j = 0; j < n_nodes; j += 4) {
        const Sums share = Sums::load(weight + j) / (Sums(at.value[l]) - Sums::load(q + j));
        sum += share;
        work_sum += share * Sums::load(work + j);
        loss_sum += share * Sums::load(loss + j);
        last_sum += share * Sums::load(last + j);
      }
      const auto total = [](const Sums& s) MGDD_INLINE_LAMBDA { return (s[0] + s[1]) + (s[2] + s[3]); };
      const double per_sum = 1.0 / total(sum);
      tails.work.value[l] = total(work_sum) * per_sum;
      tails.loss.value[l] = total(loss_sum) * per_sum;
      tails.last_pressure.value[l] = total(last_sum) * per_sum;
    }
  });
  for (std::size_t l = 0; l < block_lanes; ++l) {
    if (!tails.known[l] || std::isfinite(tails.work.value[l])) continue;
    const double* p = trace_[tails.from[l]].value.data();  // on a node, or so near to one that a share is infinite
    const auto j = static_cast<std::size_t>(
        std::ranges::min_element(p, p + n_nodes, {}, [&](double x) { return std::abs(x - tails.pressure.value[l]); }) -
        p);
    tails.work.value[l] = work_left_[tails.from[l] * n_nodes + j];
    tails.loss.value[l] = loss_left_[tails.from[l] * n_nodes + j];
    tails.last_pressure.value[l] = trace_[n_ - 1].value[j];
  }
}

}  // namespace mgdd::engine
