#include "mgdd/optimize/seekers/failure_watch.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {
namespace {

constexpr double failures_of_an_edge = 4.0;
constexpr std::int64_t hopeless = 12;  // in a row: at two places that worked as well
constexpr double first_wait = 5.0, longest_wait = 320.0;
constexpr double finest_share = 0.01;  // of what works: an edge is not looked for more closely
constexpr double none = largest_reading;
constexpr std::array places{0.0, 1.0, 0.5, 0.25, 0.75};  // between the lowest and the highest that has worked

constexpr double sign(std::size_t side) noexcept {
  return side == 0 ? 1.0 : -1.0;
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
    side = {side.farthest, side.farthest, far, far, zero, Inputs::Constant(n, first_wait), zero, Inputs::Ones(n)};
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
  differs_ = sent_ != wanted;
  return differs_ ? sent_ : wanted;  // NOLINT(bugprone-return-const-ref-from-parameter)
}

void FailureWatch::worked() noexcept {
  good_ = sent_;
  worked_ = true;
  in_a_row_ = 0;
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
      if (at < side.suspect[i]) continue;
      side.suspect[i] = none;
      side.failures[i] = 0.0;
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
  ++in_a_row_;
  if (!worked_ || !edges_) return;  // nowhere to go back to
  if (failing_everywhere()) {
    for (Side& side : sides_) {
      side.edge.setConstant(none);
      side.suspect.setConstant(none);
      side.failures.setZero();
    }
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
  side.suspect[input] = std::min(side.suspect[input], sign(which) * sent_[input]);
  side.failures[input] += 1.0;
  if (side.failures[input] < failures_of_an_edge) return;
  side.again[input] = 1.0;
  set_edge(side, input, side.suspect[input], sign(which) * from[input]);
  side.suspect[input] = none;
  side.failures[input] = 0.0;
}

void FailureWatch::set_edge(Side& side, Eigen::Index i, double failing, double good) noexcept {
  side.edge[i] = std::min(side.edge[i], failing);
  if (side.reach[i] >= side.edge[i]) side.reach[i] = std::min(good, side.edge[i]);
  side.held[i] = 0.0;
  side.wait[i] = std::min(2.0 * side.wait[i], longest_wait);
}

}  // namespace mgdd::optimize
