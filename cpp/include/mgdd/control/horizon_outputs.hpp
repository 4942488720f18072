// Outputs along a horizon, their weights and their soft bounds: beyond one, the price of the squared excess joins the
// weight of the output, so that the quadratic program keeps its form. Units are the model's own. noexcept; heap-free
// where N is known to the compiler.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "mgdd/control/horizon_line.hpp"
#include "mgdd/control/horizon_settings.hpp"

namespace mgdd::control {

/// A number of the settings as the scalar of a horizon, which may be float.
template <class T>
T narrowed(double value) noexcept {
  return static_cast<T>(std::clamp(value, -1e30, 1e30));
}

template <class T, int N>
class HorizonOutputs {
 public:
  Along<T, N> values{};

  void set(const HorizonSettings& s, std::size_t length) {
    stretch(values, length);
    stretch(sides_, length);
    weight_ = narrowed<T>(s.output_weight);
    terminal_weight_ = narrowed<T>(s.terminal_weight);
    price_ = narrowed<T>(s.output_limit_weight);
    least_ = narrowed<T>(s.least_output);
    largest_ = narrowed<T>(s.largest_output);
  }
  bool bounded() const noexcept { return price_ > T(0); }

  /// Of the squared error, without a price.
  T weight(std::size_t k) const noexcept { return k + 1 < values.size() ? weight_ : terminal_weight_; }
  /// What an output costs.
  T cost(std::size_t k, T y, T reference) const noexcept {
    const T error = y - reference, excess = y - std::clamp(y, least_, largest_);
    return weight(k) * error * error + (bounded() ? price_ * excess * excess : T(0));
  }

  /// Puts the values on their sides of the soft bounds, and their weights into the stages.
  template <class Stages>
  void settle(Stages& stages) noexcept {
    for (std::size_t k = 0; k < values.size(); ++k)
      stand(stages[k], k, side(values[k]));
  }
  /// Error at the value: beyond a soft bound q (y - r)^2 + p (y - bound)^2 is one square in y.
  T error(std::size_t k, T reference) const noexcept {
    if (sides_[k] == 0) return values[k] - reference;
    const T bound = sides_[k] > 0 ? largest_ : least_;
    return values[k] - bound + weight(k) / (weight(k) + price_) * (bound - reference);
  }
  /// Puts the outputs at the solution of a program, or only the first that is wrong, on their sides; whether one was on
  /// another.
  template <class Qp>
  bool change_sides(Qp& qp, const typename Qp::Column& deviation, bool all) noexcept {
    typename Qp::Column x = deviation;
    bool changed = false;
    for (std::size_t k = 0; k < values.size(); ++k) {
      auto& stage = qp.stages[k];
      x = (stage.a * x + stage.b * (qp.input()[k] - qp.nominal[k])).eval();
      const int beyond = side(values[k] + stage.c.dot(x));
      if (beyond == sides_[k]) continue;
      stand(stage, k, beyond);
      changed = true;
      if (!all) break;
    }
    return changed;
  }

 private:
  int side(T y) const noexcept { return !bounded() ? 0 : y > largest_ ? 1 : y < least_ ? -1 : 0; }
  template <class Stage>
  void stand(Stage& stage, std::size_t k, int beyond) noexcept {
    sides_[k] = static_cast<std::int8_t>(beyond);
    stage.weight = weight(k) + (beyond == 0 ? T(0) : price_);
  }

  Along<std::int8_t, N> sides_{};
  T weight_{0}, terminal_weight_{0}, price_{0}, least_{0}, largest_{0};
};

}  // namespace mgdd::control
