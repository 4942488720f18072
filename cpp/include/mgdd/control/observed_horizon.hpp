// A receding horizon that is told a measured output, or the state itself: between samples its model predicts, fixed
// gains pull the prediction toward what is measured. Units are the model's own. `step` is noexcept, and heap-free where
// the horizon is.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "mgdd/common/state.hpp"
#include "mgdd/control/receding_horizon.hpp"

namespace mgdd::control {

/// `Gains` is what `correct(state, measured, gains)` of the model takes.
template <class Horizon, class Gains>
class ObservedHorizon {
 public:
  using Scalar = typename Horizon::Scalar;
  using State = typename Horizon::State;
  using Model = std::remove_cvref_t<decltype(std::declval<const Horizon&>().model())>;

  ObservedHorizon(Horizon horizon, const Gains& gains) : horizon_(std::move(horizon)), gains_(gains) {}

  /// Input of this sample from a measured output. NaN corrects nothing; before the first finite one the input is the
  /// one that acted last.
  Scalar step(std::span<const Scalar> reference, Scalar measured) noexcept {
    if (!started_ && !std::isfinite(measured)) return horizon_.last_input();
    State state{};
    if (started_) {
      horizon_.prepare();
      state = horizon_.state();
    } else if constexpr (dynamics::StartsAtRest<Model>) {
      state = horizon_.model().at_rest(measured);
    }
    if (std::isfinite(measured)) horizon_.model().correct(state, measured, gains_);
    return answer(state, reference);
  }
  /// The same from the state.
  Scalar step_from(std::span<const Scalar> reference, const State& state) noexcept { return answer(state, reference); }

  /// From a state after an input that acted last.
  void start(const State& state, Scalar applied) noexcept {
    horizon_.start(state, applied);
    started_ = true;
  }
  /// Waits for the first measurement; the first change counts from 0, or from the bound nearest to it.
  void reset() noexcept {
    horizon_.start({}, Scalar(0));
    started_ = false;
  }
  void applied(Scalar input) noexcept { horizon_.applied(input); }

  /// Of the last sample that was answered.
  HorizonStatus status() const noexcept { return status_; }
  const Horizon& horizon() const noexcept { return horizon_; }

  /// ParameterError for a restored state that the settings do not allow.
  void require_usable() const { horizon_.require_usable(); }
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("started", self.started_);
    Horizon::visit(self.horizon_, v);
  }

 private:
  Scalar answer(const State& state, std::span<const Scalar> reference) noexcept {
    if (!started_) horizon_.start(state, horizon_.last_input());
    const Scalar input = horizon_.feedback(state, reference);
    status_ = horizon_.status();
    // A prediction that is not finite would stay so: the next measurement starts anew.
    started_ = std::ranges::all_of(Model::numbers(state), [](const Scalar* x) { return std::isfinite(*x); });
    if (!started_) horizon_.start({}, horizon_.last_input());
    return input;
  }

  Horizon horizon_;
  Gains gains_;
  bool started_ = false;
  HorizonStatus status_ = HorizonStatus::iteration_limit;
};

}  // namespace mgdd::control
