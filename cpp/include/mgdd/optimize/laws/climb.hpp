// A climb to the best input within limits: slopes and bends from points beside the best one so far, then the limited
// step that gains most by them, half of it, and both moved back to the limits that they break. It slides along several
// limits at once, where few inputs drawn at random lie inside. noexcept and free of allocation.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "mgdd/optimize/limits/nearest_step.hpp"

namespace mgdd::optimize {

class Climb {
 public:
  static constexpr int rounds = 4;        // three inputs, two limits: .0002 points short of forty rounds
  static constexpr int tries = 2;         // of steps at once: all of it, and half
  static constexpr double inside = 1e-4;  // scales of a limit that it stays within: limits bend too

  /// What is known of an input: its largest excess over a limit, kept where that is not above 0, and what it is worth.
  struct Worth {
    double over, worth;
    bool better_than(const Worth& other) const noexcept {
      const bool safe = over <= 0.0, was = other.over <= 0.0;
      return safe != was ? safe : safe ? worth > other.worth : over < other.over;
    }
  };

  void begin(const Inputs& at, const Worth& worth) noexcept {
    best_ = at;
    known_ = worth;
    far_ = farthest;
    sides_ = 2;
    bend_ = Inputs::Zero(at.size());
  }
  const Inputs& best() const noexcept { return best_; }
  const Worth& known() const noexcept { return known_; }
  /// What the best is worth by now.
  void renew(const Worth& worth) noexcept { known_ = worth; }
  /// Whether it is better than the best, whose place it takes.
  bool consider(const Inputs& z, const Worth& worth) noexcept {
    if (!worth.better_than(known_)) return false;
    best_ = z;
    known_ = worth;
    return true;
  }

  int star() const noexcept { return 1 + sides_ * static_cast<int>(best_.size()); }
  /// The best, then to both sides of it along every input, within the bounds; after the first round to one side.
  Inputs beside(int k, const Inputs& aside) const noexcept {
    Inputs out = best_;
    if (k == 0) return out;
    const Eigen::Index i = (k - 1) / sides_;
    const bool up = sides_ == 2 ? k % 2 == 1 : best_[i] < 0.5;
    out[i] = std::clamp(best_[i] + (up ? aside[i] : -aside[i]), 0.0, 1.0);
    return out;
  }
  /// Slopes by values at the star.
  template <class Value, class Slopes>
  void slopes(const Inputs& aside, const Value& value, Slopes&& out) const noexcept {
    for (int i = 0; i < static_cast<int>(best_.size()); ++i) {
      const int first = 1 + sides_ * i, other = sides_ == 2 ? first + 1 : 0;
      out[i] = (value(first) - value(other)) / (beside(first, aside)[i] - beside(other, aside)[i]);
    }
  }
  /// The step that gains most, from the worth and the excesses at the star; `nearest` then tells what each limit costs.
  template <class Value, class Edges>
  void aim(const Inputs& aside, const Value& value, const Edges& edges, std::span<const double> over,
           NearestStep& nearest) noexcept {
    from_ = best_;
    Inputs rise(best_.size());
    slopes(aside, value, rise);
    for (int i = 0; i < static_cast<int>(best_.size()); ++i) {
      const int first = 1 + sides_ * i;
      const double off = beside(first, aside)[i] - best_[i];
      if (sides_ == 1) {
        rise[i] += 0.5 * bend_[i] * off;
        continue;
      }
      const double other = best_[i] - beside(first + 1, aside)[i];
      if (!(off > 0.0 && other > 0.0)) continue;
      bend_[i] = 2.0 * ((value(0) - value(first)) / off + (value(0) - value(first + 1)) / other) / (off + other);
    }
    bent_ = bend_.cwiseMax(rise.cwiseAbs() / (2.0 * far_));
    const double most = bent_.maxCoeff();
    bent_ = bent_.cwiseMax(most > 0.0 ? least_bend * most : 1.0);
    nearest.begin(rise.cwiseQuotient(bent_), bent_.cwiseInverse().asDiagonal(), lowest(), highest());
    step_ = limited(nearest, edges, over);
  }
  /// Try k of the steps.
  Inputs tried(int k) const noexcept { return from_ + std::ldexp(1.0, -k) * step_; }
  /// The same moved back to the limits, by the excesses there.
  template <class Edges>
  Inputs moved_back(int k, const Edges& edges, std::span<double> over, NearestStep& nearest) const noexcept {
    const Inputs at = tried(k);
    for (double& own : over)
      own += overshoot * std::max(own, 0.0);
    nearest.begin(Inputs::Zero(at.size()), bent_.cwiseInverse().asDiagonal(), from_ + lowest() - at,
                  from_ + highest() - at);
    return at + limited(nearest, edges, over);
  }
  /// After the steps have been considered.
  void narrow() noexcept {
    const double moved = (best_ - from_).cwiseAbs().maxCoeff();
    far_ = std::max(std::min(far_, 2.0 * moved), 0.25 * far_);
    sides_ = 1;
  }

 private:
  static constexpr double overshoot = 0.25;   // of what is moved back: limits bend towards it
  static constexpr double farthest = 0.3;     // ranges, of the first step: bends change beyond
  static constexpr double least_bend = 1e-6;  // of the largest: an input that changes limits alone is free to move

  template <class Edges>
  static const Inputs& limited(NearestStep& nearest, const Edges& edges, std::span<const double> over) noexcept {
    for (std::size_t i = 0; i < over.size(); ++i)
      nearest.add(pointing(edges.row(static_cast<Eigen::Index>(i)).transpose()), -over[i]);
    nearest.solve(0.0);
    return nearest.step();
  }
  Inputs lowest() const noexcept { return (-from_).cwiseMax(-far_); }
  Inputs highest() const noexcept { return (1.0 - from_.array()).min(far_); }

  Inputs best_, from_, bend_, bent_, step_;  // bend_ as the first round saw it, bent_ that the step is bounded by
  Worth known_{0.0, 0.0};
  double far_ = farthest;
  int sides_ = 2;
};

}  // namespace mgdd::optimize
