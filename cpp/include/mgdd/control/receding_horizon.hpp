// Receding-horizon control of a discrete model of one input: every sample the N inputs ahead are improved by
// Gauss-Newton steps on sum q (y - r)^2 + terminal + input + change weights + squared excess over soft bounds of the
// output, under bounds of the input and of its change, and the first is applied. One step per sample from the shifted
// inputs is the real-time iteration (Diehl, Bock and Schlöder 2005): `prepare` linearises while the sample passes,
// `feedback` answers to the state. Units are the model's own, one input per sample. All steps are noexcept; double or
// float; heap-free where N and n are known to the compiler (Eigen::Dynamic: told at run time).
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <span>
#include <string>

#include "mgdd/common/state.hpp"
#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/horizon_outputs.hpp"
#include "mgdd/control/horizon_qp.hpp"
#include "mgdd/control/horizon_settings.hpp"
#include "mgdd/control/horizon_slopes.hpp"
#include "mgdd/dynamics/discrete_model.hpp"

namespace mgdd::control {

/// Slopes go through the first `n` numbers of the state: all of them, or those that the inputs and the others reach
/// (without a delay line that is not in use, the observed ones). `length` is told where N is Eigen::Dynamic.
template <dynamics::DiscreteModel M, int N, int n = static_cast<int>(dynamics::n_numbers<M>)>
  requires std::floating_point<typename M::Scalar>
class RecedingHorizon {
 public:
  using Scalar = typename M::Scalar;
  using State = typename M::State;
  // Told at run time anyway, all orders share one program.
  using Qp = HorizonQp<Scalar, N, N == Eigen::Dynamic ? Eigen::Dynamic : n>;
  using Inputs = typename Qp::Inputs;

  /// ParameterError for settings out of range. `start` follows.
  RecedingHorizon(const M& model, const HorizonSettings& settings, int length = N)
      : model_(model), slopes_(model), settings_((validate(settings), settings)) {
    require_within("horizon_samples", length, 1.0, 1000.0);
    if constexpr (N == Eigen::Dynamic || n == Eigen::Dynamic) {
      qp_.resize(static_cast<std::size_t>(length), static_cast<Eigen::Index>(slopes_.order()));
    }
    stretch(inputs_, qp_.size());
    outputs_.set(settings, qp_.size());
    qp_.set.limit(narrow(settings.lower), narrow(settings.upper), narrow(settings.largest_change));
    qp_.input_weight = narrow(settings.input_weight);
    qp_.change_weight = narrow(settings.change_weight);
    outputs_.settle(qp_.stages);
    start({}, Scalar(0));
  }

  /// From a state after an input that acted last, which is planned on.
  void start(const State& state, Scalar applied) noexcept {
    state_ = state;
    applied_ = std::clamp(applied, narrow(settings_.lower), narrow(settings_.upper));
    std::ranges::fill(inputs_, applied_);
    qp_.set.clear();
    shifted_ = true;  // nothing to shift
    linearised_ = false;
    status_ = HorizonStatus::iteration_limit;
  }
  /// Tells what acted instead of the last result, where it differs: the changes are counted from it.
  void applied(Scalar input) noexcept {
    if (!std::isfinite(input) || input == applied_) return;
    applied_ = std::clamp(input, narrow(settings_.lower), narrow(settings_.upper));
    if (shifted_) qp_.set.clamp(inputs_, applied_);
    qp_.set.clear();
    linearised_ = false;
  }

  /// Ahead of the next state: shifts the inputs, predicts that state and linearises along both.
  void prepare() noexcept {
    if (!shifted_) {
      model_.step(state_, dynamics::input_of(model_, applied_));
      std::copy(inputs_.begin() + 1, inputs_.end(), inputs_.begin());
      qp_.set.shift();
      qp_.set.clamp(inputs_, applied_);
      shifted_ = true;
    }
    linearise();
  }

  /// Input of this sample: `reference[k]` is wanted of the output k + 1 samples from now, the last one from there on.
  Scalar feedback(const State& state, std::span<const Scalar> reference) noexcept {
    if (!usable(state, reference)) {
      status_ = HorizonStatus::not_finite;
      return applied_;
    }
    if (!shifted_ || !linearised_) prepare();
    typename Qp::Column deviation = Qp::Column::Zero(static_cast<Eigen::Index>(slopes_.order()));
    const auto now = M::numbers(state);
    const auto predicted = M::numbers(state_);
    for (std::size_t i = 0; i < slopes_.order(); ++i)
      deviation(static_cast<Eigen::Index>(i)) = *now[i] - *predicted[i];
    search(state, deviation, reference);
    if (status_ == HorizonStatus::not_finite) {
      start(state, applied_);
      status_ = HorizonStatus::not_finite;
      return applied_;
    }
    state_ = state;
    applied_ = inputs_[0];
    shifted_ = linearised_ = false;
    return applied_;
  }
  /// The reference held over the horizon.
  Scalar feedback(const State& state, Scalar reference) noexcept {
    return feedback(state, std::span<const Scalar>(&reference, 1));
  }
  Scalar step(const State& state, std::span<const Scalar> reference) noexcept {
    prepare();
    return feedback(state, reference);
  }
  Scalar step(const State& state, Scalar reference) noexcept {
    return step(state, std::span<const Scalar>(&reference, 1));
  }

  HorizonStatus status() const noexcept { return status_; }
  int iterations() const noexcept { return iterations_; }
  /// Sweeps of the quadratic programs of the last sample.
  int sweeps() const noexcept { return sweeps_; }
  /// The plan: after `feedback` the inputs from this sample on, after `prepare` those from the next.
  const Inputs& inputs() const noexcept { return inputs_; }
  /// The state that the plan starts from: after `feedback` the one given, after `prepare` the predicted one.
  const State& state() const noexcept { return state_; }
  Scalar last_input() const noexcept { return applied_; }
  const HorizonSettings& settings() const noexcept { return settings_; }
  const M& model() const noexcept { return model_; }
  /// Other numbers, the same plan.
  void set_model(const M& model) noexcept {
    model_ = model;
    slopes_ = HorizonSlopes<M, n>(model);
    linearised_ = false;
  }

  /// The weighted squares of a run from a state under inputs; the first change is from the input applied last.
  Scalar cost(const State& state, const Inputs& inputs, std::span<const Scalar> reference) const noexcept {
    State s = state;
    Scalar sum(0), before = applied_;
    for (std::size_t k = 0; k < size(); ++k) {
      model_.step(s, dynamics::input_of(model_, inputs[k]));
      const Scalar change = inputs[k] - before;
      sum += outputs_.cost(k, model_.output(s), wanted(reference, k)) + qp_.input_weight * inputs[k] * inputs[k] +
             qp_.change_weight * change * change;
      before = inputs[k];
    }
    return sum;
  }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const {
    Scalar before = applied_;
    require_within("state column 'applied'", applied_, narrow(settings_.lower), narrow(settings_.upper));
    for (std::size_t k = 0; k < size(); ++k) {
      if (k > 0 || shifted_) {
        require_within("state column 'input_" + std::to_string(k) + "'", inputs_[k], qp_.set.lowest(before),
                       qp_.set.highest(before));
      }
      require_within("state column 'tie_" + std::to_string(k) + "'", qp_.set.ties()[k], -1.0, 1.0);
      require_within("state column 'bound_" + std::to_string(k) + "'", qp_.set.bounds()[k], -1.0, 1.0);
      before = inputs_[k];
    }
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    const auto numbers = M::numbers(self.state_);
    for (std::size_t i = 0; i < self.slopes_.n_saved(); ++i)
      visit_number(v, "state_" + std::to_string(i), *numbers[i]);
    visit_number(v, "applied", self.applied_);
    for (std::size_t k = 0; k < self.size(); ++k) {
      visit_number(v, "input_" + std::to_string(k), self.inputs_[k]);
      visit_sign(v, "tie_" + std::to_string(k), self.qp_.set.ties()[k]);
      visit_sign(v, "bound_" + std::to_string(k), self.qp_.set.bounds()[k]);
    }
    v("shifted", self.shifted_);
    if constexpr (!std::is_const_v<Self>) self.linearised_ = false;
  }

 private:
  static constexpr int halvings = 12;
  static constexpr int rounds = 8;  // sides change by many at once; then by the first (Murty 1974), against cycles

  std::size_t size() const noexcept { return qp_.size(); }
  static Scalar narrow(double value) noexcept { return narrowed<Scalar>(value); }
  template <class V, class Sign>
  static void visit_sign(V& v, const std::string& name, Sign& sign) {
    std::int64_t wide = int{sign};  // NOLINT(misc-const-correctness): a reader writes it
    v(name, wide);
    if constexpr (!std::is_const_v<Sign>) sign = static_cast<Sign>(std::clamp<std::int64_t>(wide, -2, 2));
  }
  static Scalar wanted(std::span<const Scalar> reference, std::size_t k) noexcept {
    return reference[std::min(k, reference.size() - 1)];
  }
  static bool usable(const State& state, std::span<const Scalar> reference) noexcept {
    const auto finite = [](Scalar x) { return std::isfinite(x); };
    return !reference.empty() && std::ranges::all_of(reference, finite) &&
           std::ranges::all_of(M::numbers(state), [](const Scalar* x) { return std::isfinite(*x); });
  }

  /// Along the inputs from `state_`.
  void linearise() noexcept {
    slopes_.along(state_, inputs_, outputs_.values, qp_.stages);
    outputs_.settle(qp_.stages);
    qp_.nominal = inputs_;
    qp_.invalidate();
    qp_.factor(applied_);
    linearised_ = true;
  }

  QpResult solve(const typename Qp::Column& deviation, std::span<const Scalar> reference) noexcept {
    int spent = 0;
    for (int round = 0;; ++round) {
      for (std::size_t k = 0; k < size(); ++k)
        qp_.stages[k].error = outputs_.error(k, wanted(reference, k));
      const QpResult result = qp_.solve(deviation, applied_, settings_.max_sweeps - spent);
      spent += qp_.sweeps();
      sweeps_ += qp_.sweeps();
      if (result != QpResult::solved || !outputs_.bounded() || !outputs_.change_sides(qp_, deviation, round < rounds))
        return result;
      if (spent >= settings_.max_sweeps) return QpResult::sweep_limit;
      qp_.set.clear();
      qp_.invalidate();
    }
  }

  void search(const State& state, const typename Qp::Column& deviation, std::span<const Scalar> reference) noexcept {
    sweeps_ = 0;
    iterations_ = 1;
    QpResult result = solve(deviation, reference);
    if (settings_.max_iterations == 1) {
      status_ = result == QpResult::not_finite ? HorizonStatus::not_finite
                : result == QpResult::solved   ? HorizonStatus::converged
                                               : HorizonStatus::iteration_limit;
      if (result != QpResult::not_finite) inputs_ = qp_.input();
      return;
    }
    Scalar best = cost(state, inputs_, reference);
    status_ = HorizonStatus::iteration_limit;
    state_ = state;
    for (;; ++iterations_) {
      if (result == QpResult::not_finite || !std::isfinite(best)) {
        status_ = HorizonStatus::not_finite;
        return;
      }
      const Scalar moved = descend(state, reference, best);
      // The first slopes belong to the predicted state: no step along them says nothing.
      if (iterations_ > 1 && result == QpResult::solved && moved < narrow(settings_.tolerance)) {
        status_ = HorizonStatus::converged;
        return;
      }
      if (iterations_ == settings_.max_iterations) return;
      linearise();
      result = solve(Qp::Column::Zero(static_cast<Eigen::Index>(slopes_.order())), reference);
    }
  }

  /// Goes to the solution of the quadratic program as far as the cost falls; the largest change of an input.
  Scalar descend(const State& state, std::span<const Scalar> reference, Scalar& best) noexcept {
    Inputs trial = qp_.input();
    Scalar share(1);
    for (int i = 0; i < halvings; ++i, share /= Scalar(2)) {
      if (i > 0) {
        for (std::size_t k = 0; k < size(); ++k)
          trial[k] = inputs_[k] + share * (qp_.input()[k] - inputs_[k]);
        qp_.set.clamp(trial, applied_);
      }
      const Scalar tried = cost(state, trial, reference);
      if (!(tried < best)) continue;
      best = tried;
      Scalar moved(0);
      for (std::size_t k = 0; k < size(); ++k)
        moved = std::max(moved, std::abs(trial[k] - inputs_[k]));
      if (i > 0) qp_.set.clear();  // what acts at the end of the step need not act before it
      inputs_ = trial;
      return moved;
    }
    qp_.set.clear();
    return Scalar(0);
  }

  M model_;
  HorizonSlopes<M, n> slopes_;
  HorizonSettings settings_;
  Qp qp_{};
  State state_{};  // after `prepare` the predicted one, after `feedback` the measured one
  Inputs inputs_{};
  HorizonOutputs<Scalar, N> outputs_{};
  Scalar applied_{0};
  bool shifted_ = true, linearised_ = false;
  HorizonStatus status_ = HorizonStatus::iteration_limit;
  int iterations_ = 0, sweeps_ = 0;
};

}  // namespace mgdd::control
