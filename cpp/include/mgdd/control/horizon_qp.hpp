// Quadratic program of a linear horizon of one input with bounds and a limit of its change per sample, solved exactly
// by Riccati sweeps over an active set: O(N n^3) per sweep. With V_k the cost to go as a function of the deviation of
// the state and of the input before, a stage is free, fixed or tied to the input before it; the multipliers are the
// slopes of the stage costs (recursion: Bertsekas 2017; active sets: Nocedal and Wright 2006, section 16.5). Every
// iterate is feasible and none costs more than the one before. noexcept; double or float; heap-free where N and n are
// known to the compiler (Eigen::Dynamic: sized once by `resize`, then the heap is used in every sweep).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "mgdd/control/horizon_set.hpp"

namespace mgdd::control {

enum class QpResult { solved, sweep_limit, not_finite };

/// min sum_k [weight_k (error_k + c_k' x_{k+1})^2 + input u_k^2 + change (u_k - u_{k-1})^2] over u, k = 0..N-1, with
/// x_{k+1} = a_k x_k + b_k (u_k - nominal_k), lower <= u_k <= upper and |u_k - u_{k-1}| <= largest_change. Convex where
/// `input_weight` or `change_weight` is positive.
template <class T, int N, int n>
class HorizonQp {
 public:
  using Square = Eigen::Matrix<T, n, n>;
  using Column = Eigen::Matrix<T, n, 1>;
  using Inputs = Along<T, N>;
  struct Stage {
    Square a = zero_or_empty<Square>();
    Column b = zero_or_empty<Column>(), c = zero_or_empty<Column>();
    T error{0}, weight{0};
  };

  Along<Stage, N> stages{};
  Inputs nominal{};  ///< must be feasible: the start of the search, too
  HorizonSet<T, N> set{};
  T input_weight{0}, change_weight{0};

  /// Of a horizon whose length or order is told at run time.
  void resize(std::size_t length, Eigen::Index order) {
    stretch(stages, length);
    for (Stage& stage : stages) {
      stage.a.setZero(order, order);
      stage.b.setZero(order);
      stage.c.setZero(order);
    }
    for (Inputs* line : {&nominal, &input_, &target_, &trial_, &slope_})
      stretch(*line, length);
    stretch(to_go_, length);
    stretch(law_, length);
    set.resize(length);
    trial_set_.resize(length);
    start_.setZero(order);
    invalidate();
  }
  std::size_t size() const noexcept { return stages.size(); }
  /// Refactors everything at the next solve: stages or weights are new.
  void invalidate() noexcept { valid_from_ = static_cast<int>(size()); }
  /// What does not depend on errors and the state may be done ahead of `solve`.
  void factor(T before) noexcept {
    set.arrange(nominal, before, valid_from_);
    factor();
  }

  /// From the deviation of the state now and the input before.
  QpResult solve(const Column& deviation, T before, int max_sweeps) noexcept {
    start_ = deviation;
    before_ = before;
    input_ = nominal;
    bool cost_known = false;
    for (sweeps_ = 1;; ++sweeps_) {
      set.arrange(nominal, before, valid_from_);
      factor();
      gradients();
      const T target_cost = to_target();
      if (!std::isfinite(target_cost)) return QpResult::not_finite;
      const bool many = sweeps_ <= jumps;  // the set changes by many entries at once; then one by one, which ends
      const bool inside = set.contains(target_, before);
      const bool right = set.judge(slope_, slope_tolerance(), many);
      if (inside) {
        input_ = target_;
        cost_ = target_cost;
        cost_known = true;
        set.clamp(input_, before);
        if (right) return QpResult::solved;
        if (sweeps_ >= max_sweeps) return QpResult::sweep_limit;
        set.drop_wrong();
        continue;
      }
      if (!cost_known) cost_ = roll([&](std::size_t k, T, T) { return input_[k] - nominal[k]; });
      if (!(many && (jump() || project()))) {
        set.advance(input_, target_, before);
        cost_ = roll([&](std::size_t k, T, T) { return input_[k] - nominal[k]; });
      }
      cost_known = true;
      if (sweeps_ >= max_sweeps) return QpResult::sweep_limit;
    }
  }

  const Inputs& input() const noexcept { return input_; }
  T cost() const noexcept { return cost_; }
  int sweeps() const noexcept { return sweeps_; }

 private:
  static constexpr int jumps = 50, shares = 4;

  // Half the cost to go: 1/2 x'Px + v a'x + 1/2 b v^2 and slopes, v the deviation of the input before.
  struct CostToGo {
    Square p;
    Column a;
    T b{0.0};
  };
  struct Law {
    Column x;  // derivative of the slope of the stage cost to the state
    T u{0.0};  // to the input
    T over_u{0.0};
    T slope{0.0};  // at rest
  };

  void factor() noexcept {
    const int last = static_cast<int>(size()) - 1;
    for (int i = std::min(valid_from_ - 1, last); i >= 0; --i) {
      const std::size_t k = static_cast<std::size_t>(i);
      const Stage& stage = stages[k];
      CostToGo ahead = to_go_[k];  // that of the outputs from here on is added below
      if (i == last) {
        ahead.p.setZero(stage.b.size(), stage.b.size());
        ahead.a.setZero(stage.b.size());
        ahead.b = T(0);
      }
      ahead.p.noalias() += (stage.weight * stage.c) * stage.c.transpose();
      const Square pa = ahead.p * stage.a;
      const Column pb = ahead.p * stage.b + ahead.a;
      Law& law = law_[k];
      law.x.noalias() = stage.a.transpose() * pb;
      law.u = stage.b.dot(pb) + stage.b.dot(ahead.a) + ahead.b + input_weight + change_weight;
      if (i == 0) {
        law.over_u = T(1) / law.u;
        continue;
      }
      CostToGo& behind = to_go_[k - 1];
      behind.p.noalias() = stage.a.transpose() * pa;
      switch (set.kind(k)) {
        case StageKind::free: {
          law.over_u = T(1) / law.u;
          const Column gain = law.over_u * law.x;
          behind.p.noalias() -= law.x * gain.transpose();
          behind.a = change_weight * gain;
          behind.b = change_weight - change_weight * change_weight * law.over_u;
          break;
        }
        case StageKind::fixed:
          behind.a.setZero(stage.b.size());
          behind.b = change_weight;
          break;
        case StageKind::tied:
          behind.a = law.x;
          behind.b = law.u - change_weight;
          break;
      }
    }
    valid_from_ = 0;
  }

  void gradients() noexcept {
    Column p = Column::Zero(start_.size());
    T g(0);
    for (std::size_t k = size(); k-- > 0;) {
      const Stage& stage = stages[k];
      p += (stage.weight * stage.error) * stage.c;
      const T moved = change_weight * (nominal[k] - (k == 0 ? before_ : nominal[k - 1]));
      Law& law = law_[k];
      law.slope = stage.b.dot(p) + g + input_weight * nominal[k] + moved;
      if (k == 0) break;
      const T value = set.value(k);
      p = stage.a.transpose() * p;
      switch (set.kind(k)) {
        case StageKind::free: {
          const T step = law.over_u * law.slope;
          p -= step * law.x;
          g = change_weight * step - moved;
          break;
        }
        case StageKind::fixed:
          p += value * law.x;
          g = -moved - change_weight * value;
          break;
        case StageKind::tied:
          p += value * law.x;
          g = law.slope - moved + (law.u - change_weight) * value;
          break;
      }
    }
  }

  /// Deviation of the input at a stage by its law; `free_slope` is the slope of the stage cost at no deviation.
  T by_law(std::size_t k, T free_slope, T last) const noexcept {
    switch (set.kind(k)) {
      case StageKind::free:
        return -law_[k].over_u * free_slope;
      case StageKind::fixed:
        return set.value(k);
      default:
        return last + set.value(k);
    }
  }

  T to_target() noexcept {
    scale_ = T(0);
    return roll([&](std::size_t k, T free_slope, T last) {
      const T w = by_law(k, free_slope, last);
      slope_[k] = set.kind(k) == StageKind::free ? T(0) : free_slope + law_[k].u * w;
      scale_ = std::max(scale_, std::abs(free_slope) + std::abs(law_[k].u * w));
      target_[k] = nominal[k] + w;
      return w;
    });
  }
  T slope_tolerance() const noexcept { return T(1e3) * std::numeric_limits<T>::epsilon() * scale_; }

  /// The laws with every input confined to what it may be; taken where that costs less than the present inputs.
  bool jump() noexcept {
    return attempt([&](std::size_t k, T free_slope, T last) { return nominal[k] + by_law(k, free_slope, last); });
  }
  /// The way to the target, or a share of it, confined to the limits (projected search: Bertsekas 1982).
  bool project() noexcept {
    T share(1);
    for (int i = 0; i < shares; ++i, share /= T(4)) {
      if (attempt([&](std::size_t k, T, T) { return input_[k] + share * (target_[k] - input_[k]); })) return true;
    }
    return false;
  }
  template <class Wanted>
  bool attempt(Wanted&& wanted) noexcept {
    trial_set_ = set;
    const T trial_cost = roll([&](std::size_t k, T free_slope, T last) {
      trial_[k] = trial_set_.confine(k, wanted(k, free_slope, last), k == 0 ? before_ : trial_[k - 1]);
      return trial_[k] - nominal[k];
    });
    if (!(trial_cost < cost_)) return false;
    set = trial_set_;
    input_ = trial_;
    cost_ = trial_cost;
    return true;
  }

  /// The cost along inputs whose deviation `choose(k, slope of the stage cost without it, deviation before)` tells.
  template <class Choose>
  T roll(Choose&& choose) const noexcept {
    Column x = start_;
    T last(0), cost(0), u_last = before_;
    for (std::size_t k = 0; k < size(); ++k) {
      const Stage& stage = stages[k];
      const T w = choose(k, law_[k].x.dot(x) + law_[k].slope - change_weight * last, last);
      const T u = nominal[k] + w, moved = u - u_last;
      const Column next = stage.a * x + stage.b * w;
      x = next;
      const T error = stage.error + stage.c.dot(x);
      cost += stage.weight * error * error + input_weight * u * u + change_weight * moved * moved;
      last = w;
      u_last = u;
    }
    return cost;
  }

  Along<CostToGo, N> to_go_{};  // [k]: behind stage k, without the output after it
  Along<Law, N> law_{};
  int valid_from_ = N;  // laws of the stages from here on fit the set
  Column start_ = zero_or_empty<Column>();
  Inputs input_{}, target_{}, trial_{}, slope_{};
  HorizonSet<T, N> trial_set_{};
  T before_{0}, cost_{0}, scale_{0};
  int sweeps_ = 0;
};

}  // namespace mgdd::control
