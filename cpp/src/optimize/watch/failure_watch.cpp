#include "mgdd/optimize/watch/failure_watch.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr std::int64_t hopeless = 12;                                 // in a row: at two places that worked as well
constexpr double chance_of_an_edge = 1e-4;                            // that so many fail by chance
constexpr double remembered_cycles = 200.0, faultless_cycles = 10.0;  // behind the share by chance, and before it
constexpr double first_wait = 5.0, longest_wait = 320.0;
constexpr double finest_share = 0.01;  // of what works: an edge is not looked for more closely
constexpr double none = largest_reading;
constexpr std::array rings{0.125, 0.25, 0.5, 0.9};
constexpr std::array places{0.0, 1.0, 0.5, 0.25, 0.75};  // between the lowest and the highest that has worked

constexpr double sign(std::size_t side) noexcept {
  return side == 0 ? 1.0 : -1.0;
}

constexpr double number_of(Eigen::Index i, std::size_t side) noexcept {
  return static_cast<double>(2 * i) + static_cast<double>(side);
}

}  // namespace

FailureWatch::FailureWatch(Eigen::Index inputs, bool edges) noexcept
    : edges_(edges), sent_(Inputs::Zero(inputs)), good_(sent_) {
  for (Side& side : sides_)
    side.reach = side.farthest = Inputs::Constant(inputs, -none);
  forget();
}

void FailureWatch::forget() noexcept {
  const Eigen::Index n = sent_.size();
  const Inputs far = Inputs::Constant(n, none), zero = Inputs::Zero(n);
  for (Side& side : sides_)
    side = {side.farthest, side.farthest, far, Inputs::Constant(n, first_wait), zero, Inputs::Ones(n)};
  failures_.side.fill(-1.0);
  failures_.at.fill(0.0);
  failures_.since.fill(0.0);
  in_a_row_ = 0;
  probe_ = -1;
}

Inputs FailureWatch::edge(std::size_t side) const noexcept {
  const Inputs& edge = sides_[side].edge;
  return (edge.array() < none).select(edge, Inputs::Constant(edge.size(), unlimited));
}

bool FailureWatch::failing_everywhere() const noexcept {
  return in_a_row_ >= hopeless;
}

const Inputs& FailureWatch::pass(const Inputs& input) noexcept {
  probe_ = -1;
  differs_ = false;
  sent_ = input;
  return input;  // NOLINT(bugprone-return-const-ref-from-parameter)
}

Inputs FailureWatch::keep(const Inputs& input) const noexcept {
  Inputs out = input;
  for (std::size_t s = 0; s < 2; ++s) {
    const auto& edge = sides_[s].edge.array();
    out = sign(s) * (edge < none).select((sign(s) * out).cwiseMin(sides_[s].reach), sign(s) * out);
  }
  return out;
}

const Inputs& FailureWatch::admit(const Inputs& wanted) noexcept {
  probe_ = -1;
  sent_ = wanted;
  if (worked_ && failing_everywhere()) {  // in turn: as wanted, and places between the ends of what has ever worked
    const auto turn = static_cast<std::size_t>(in_a_row_ - hopeless) % (places.size() + 1);
    if (turn > 0) sent_ = places[turn - 1] * sides_[0].farthest - (1.0 - places[turn - 1]) * sides_[1].farthest;
  } else if (edges_ && lost()) {
    if ((in_a_row_ - hopeless) % 4 < 3) sent_ = elsewhere();
  } else {
    for (Eigen::Index i = 0; i < sent_.size(); ++i) {
      for (std::size_t s = 0; s < 2; ++s) {
        Side& side = sides_[s];
        if (!(side.edge[i] < none && sign(s) * wanted[i] > side.reach[i])) continue;
        double to = side.reach[i];
        if (probe_ < 0 && ++side.held[i] > side.wait[i]) {
          probe_ = 2 * i + static_cast<std::int64_t>(s);
          const double gap = side.edge[i] - side.reach[i];
          const bool whole = side.again[i] > 0.0 || gap <= finest_share * (sides_[0].reach[i] + sides_[1].reach[i]);
          to = std::min(sign(s) * wanted[i], whole ? side.edge[i] : side.reach[i] + 0.5 * gap);
        }
        sent_[i] = sign(s) * to;
      }
    }
  }
  return settle(Inputs(sent_), wanted);
}

const Inputs& FailureWatch::settle(const Inputs& input, const Inputs& wanted) noexcept {
  sent_ = input;
  differs_ = sent_ != wanted;
  return differs_ ? sent_ : wanted;  // NOLINT(bugprone-return-const-ref-from-parameter)
}

void FailureWatch::roam(const Inputs& start, const Inputs& lower, const Inputs& upper) noexcept {
  start_ = start;
  const Inputs away = start.cwiseAbs().cwiseMax(1.0);  // where there is no bound
  lower_ = (lower.array() > -none).select(lower, start - away);
  upper_ = (upper.array() < none).select(upper, start + away);
}

// The start, then one input at a time, an eighth, a quarter, a half and most of the way to each bound, then anywhere.
Inputs FailureWatch::elsewhere() const noexcept {
  const std::int64_t turn = in_a_row_ - hopeless - (in_a_row_ - hopeless) / 4;
  const Eigen::Index n = start_.size();
  const std::int64_t ring = (turn - 1) / (2 * n);
  Inputs out = start_;
  if (turn == 0) return out;
  if (ring < static_cast<std::int64_t>(rings.size())) {
    const Eigen::Index i = (turn - 1) / 2 % n;
    out[i] += rings[static_cast<std::size_t>(ring)] * ((turn % 2 == 1 ? upper_ : lower_)[i] - start_[i]);
    return out;
  }
  for (Eigen::Index i = 0; i < n; ++i) {  // Kronecker's sequence: even, and never the same twice
    const double place = static_cast<double>(turn) * std::sqrt(static_cast<double>(i * i + i + 2));
    out[i] = lower_[i] + (place - std::floor(place)) * (upper_[i] - lower_[i]);
  }
  return out;
}

void FailureWatch::worked() noexcept {
  found_ = !worked_ && differs_ && failing_everywhere();
  good_ = sent_;
  worked_ = true;
  in_a_row_ = 0;
  count_cycle();
  for (std::size_t s = 0; s < 2; ++s) {
    Side& side = sides_[s];
    for (Eigen::Index i = 0; i < sent_.size(); ++i) {
      const double at = sign(s) * sent_[i];
      side.reach[i] = std::max(side.reach[i], at);
      side.farthest[i] = std::max(side.farthest[i], at);
      if (at >= side.edge[i]) {
        side.edge[i] = none;
        side.wait[i] = std::max(0.5 * side.wait[i], first_wait);
      }
      for (std::size_t k = 0; k < failures_.at.size(); ++k) {
        if (failures_.side[k] != number_of(i, s)) continue;
        failures_.since[k] = std::max(failures_.since[k], at);
        if (at < failures_.at[k]) continue;
        failures_.side[k] = -1.0;
        by_chance_ += 1.0;
      }
    }
  }
  if (probe_ < 0) return;
  Side& side = sides_[static_cast<std::size_t>(probe_ % 2)];
  side.held[probe_ / 2] = 0.0;
  side.again[probe_ / 2] = 1.0 - side.again[probe_ / 2];
}

// The side on which the failing input lies farthest out of what has worked; where it lies within, away from what worked
// last, or from the middle of what has worked where that is the same input.
void FailureWatch::failed() noexcept {
  found_ = false;
  ++in_a_row_;
  count_cycle();
  if (!worked_ || !edges_) return;  // nowhere to go back to
  if (failing_everywhere()) {
    for (Side& side : sides_)
      side.edge.setConstant(none);
    failures_.side.fill(-1.0);
    return;
  }
  if (probe_ >= 0) {
    Side& side = sides_[static_cast<std::size_t>(probe_ % 2)];
    const Eigen::Index i = probe_ / 2;
    side.again[i] = 1.0 - side.again[i];
    return set_edge(side, i, sign(static_cast<std::size_t>(probe_ % 2)) * sent_[i], side.reach[i]);
  }
  const Inputs from = sent_ != good_ ? good_ : middle();
  double farthest = 0.0;
  Eigen::Index input = -1;
  std::size_t which = 0;
  for (Eigen::Index i = 0; i < sent_.size(); ++i) {
    const double width = std::max(sides_[0].reach[i] + sides_[1].reach[i], 1e-300);
    for (std::size_t s = 0; s < 2; ++s) {
      const double away = sign(s) * (sent_[i] - from[i]);
      if (!(away > 0.0)) continue;
      const double outside = std::max(0.0, sign(s) * sent_[i] - sides_[s].reach[i]);
      const double distance = (outside > 0.0 ? 1e6 * outside : away) / width;
      if (!(distance > farthest)) continue;
      farthest = distance;
      input = i;
      which = s;
    }
  }
  if (input < 0) return;
  Side& side = sides_[which];
  const double number = number_of(input, which);
  for (auto* column : {&failures_.side, &failures_.at, &failures_.since})
    std::rotate(column->begin(), column->begin() + 1, column->end());
  failures_.side.back() = number;
  failures_.at.back() = sign(which) * sent_[input];
  failures_.since.back() = -none;
  const double edge = fails_from(number);
  if (!(edge < none)) return;
  side.again[input] = 1.0;
  set_edge(side, input, edge, sign(which) * from[input]);
  for (std::size_t k = 0; k < failures_.at.size(); ++k)
    if (failures_.side[k] == number && failures_.at[k] >= edge) failures_.side[k] = -1.0;
}

void FailureWatch::count_cycle() noexcept {
  cycles_ += 1.0 - cycles_ / remembered_cycles;
  by_chance_ -= by_chance_ / remembered_cycles;
}

double FailureWatch::fails_from(double side) const noexcept {
  constexpr double fewest = 4.0;
  const double share = by_chance_ / (cycles_ + faultless_cycles);
  const double needed =
      share > 0.0 ? std::clamp(std::log(chance_of_an_edge) / std::log(share), fewest, hopeless - 1.0) : fewest;
  double nearest = none;
  for (std::size_t k = 0; k < failures_.at.size(); ++k) {
    if (failures_.side[k] != side) continue;
    double count = 0.0;
    for (std::size_t m = 0; m < failures_.at.size(); ++m)
      count += failures_.side[m] == side && failures_.at[m] >= failures_.at[k] && failures_.since[m] < failures_.at[k];
    if (count >= needed) nearest = std::min(nearest, failures_.at[k]);
  }
  return nearest;
}

void FailureWatch::set_edge(Side& side, Eigen::Index i, double failing, double good) noexcept {
  side.edge[i] = std::min(side.edge[i], failing);
  if (side.reach[i] >= side.edge[i]) side.reach[i] = std::min(good, side.edge[i]);
  side.held[i] = 0.0;
  side.wait[i] = std::min(2.0 * side.wait[i], longest_wait);
}

}  // namespace mgdd::optimize
