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
  using Qp = HorizonQp<Scalar, N, n>;
  using Inputs = typename Qp::Inputs;

  /// ParameterError for settings out of range. `start` follows.
  RecedingHorizon(const M& model, const HorizonSettings& settings, int length = N)
      : model_(model), slopes_(model), settings_((validate(settings), settings)) {
    require_within("horizon_samples", length, 1.0, 1000.0);
    if constexpr (N == Eigen::Dynamic || n == Eigen::Dynamic) {
      qp_.resize(static_cast<std::size_t>(length), static_cast<Eigen::Index>(slopes_.order()));
    }
    for (Inputs* line : {&inputs_, &outputs_})
      stretch(*line, qp_.size());
    stretch(sides_, qp_.size());
    qp_.set.limit(narrow(settings.lower), narrow(settings.upper), narrow(settings.largest_change));
    qp_.input_weight = narrow(settings.input_weight);
    qp_.change_weight = narrow(settings.change_weight);
    for (std::size_t k = 0; k < size(); ++k)
      qp_.stages[k].weight = weight(k);
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
      const Scalar y = model_.output(s), error = y - wanted(reference, k), change = inputs[k] - before;
      sum += weight(k) * error * error + qp_.input_weight * inputs[k] * inputs[k] + qp_.change_weight * change * change;
      if (bounds_outputs()) {
        const Scalar excess = y - std::clamp(y, narrow(settings_.least_output), narrow(settings_.largest_output));
        sum += narrow(settings_.output_limit_weight) * excess * excess;
      }
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

  std::size_t size() const noexcept { return qp_.size(); }
  static Scalar narrow(double value) noexcept { return static_cast<Scalar>(std::clamp(value, -1e30, 1e30)); }
  template <class V, class Sign>
  static void visit_sign(V& v, const std::string& name, Sign& sign) {
    std::int64_t wide = sign;  // NOLINT(misc-const-correctness): a reader writes it
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
    slopes_.along(state_, inputs_, outputs_, qp_.stages);
    if (bounds_outputs()) {
      for (std::size_t k = 0; k < size(); ++k)
        stand(k, side(outputs_[k]));
    }
    qp_.nominal = inputs_;
    qp_.invalidate();
    qp_.factor(applied_);
    linearised_ = true;
  }

  Scalar weight(std::size_t k) const noexcept {
    return narrow(k + 1 < size() ? settings_.output_weight : settings_.terminal_weight);
  }
  bool bounds_outputs() const noexcept { return settings_.output_limit_weight > 0.0; }
  /// Beyond which soft bound an output lies.
  int side(Scalar y) const noexcept {
    return y > narrow(settings_.largest_output) ? 1 : y < narrow(settings_.least_output) ? -1 : 0;
  }
  /// Beyond a soft bound its price joins the weight of the output.
  void stand(std::size_t k, int beyond) noexcept {
    sides_[k] = static_cast<std::int8_t>(beyond);
    qp_.stages[k].weight = weight(k) + (beyond == 0 ? Scalar(0) : narrow(settings_.output_limit_weight));
  }
  /// Error of an output, that beyond a soft bound meant with it: q (y - r)^2 + p (y - bound)^2 has one square in y.
  Scalar error(std::size_t k, Scalar reference) const noexcept {
    if (sides_[k] == 0) return outputs_[k] - reference;
    const Scalar bound = narrow(sides_[k] > 0 ? settings_.largest_output : settings_.least_output);
    const Scalar share = weight(k) / qp_.stages[k].weight;
    return outputs_[k] - bound + share * (bound - reference);
  }
  /// Puts the outputs at the solution on their sides of the soft bounds; whether one was on another.
  bool change_sides(const typename Qp::Column& deviation) noexcept {
    typename Qp::Column x = deviation;
    bool changed = false;
    for (std::size_t k = 0; k < size(); ++k) {
      const auto& stage = qp_.stages[k];
      x = (stage.a * x + stage.b * (qp_.input()[k] - qp_.nominal[k])).eval();
      const int beyond = side(outputs_[k] + stage.c.dot(x));
      if (beyond == sides_[k]) continue;
      stand(k, beyond);
      changed = true;
    }
    return changed;
  }

  QpResult solve(const typename Qp::Column& deviation, std::span<const Scalar> reference) noexcept {
    for (int spent = 0;;) {
      for (std::size_t k = 0; k < size(); ++k)
        qp_.stages[k].error = error(k, wanted(reference, k));
      const QpResult result = qp_.solve(deviation, applied_, settings_.max_sweeps - spent);
      spent += qp_.sweeps();
      sweeps_ += qp_.sweeps();
      if (result != QpResult::solved || !bounds_outputs() || !change_sides(deviation)) return result;
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
  Inputs inputs_{}, outputs_{};
  Along<std::int8_t, N> sides_{};  // of the soft bounds on which the outputs are
  Scalar applied_{0};
  bool shifted_ = true, linearised_ = false;
  HorizonStatus status_ = HorizonStatus::iteration_limit;
  int iterations_ = 0, sweeps_ = 0;
};

}  // namespace mgdd::control
