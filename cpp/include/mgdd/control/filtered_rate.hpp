// Rate of change of a sampled signal: backward difference behind a first-order lag (Åström and Hägglund 2006). A
// sample that is not finite repeats the last one, the first finite one starts at rate 0. noexcept, heap-free.
#pragma once

#include <cmath>
#include <string_view>
#include <type_traits>

#include "mgdd/dynamics/lag.hpp"

namespace mgdd::control {

/// One number of a controller's state on double or float, saved as double: exact both ways.
template <class V, class Number>
void visit_number(V& visitor, std::string_view name, Number& number) {
  double wide = static_cast<double>(number);  // NOLINT(misc-const-correctness): a reader writes it
  visitor(name, wide);
  if constexpr (!std::is_const_v<Number>) number = static_cast<Number>(wide);
}

template <class T>
class FilteredRate {
 public:
  /// Differences faster than `jump_per_s` are steps: they set the rate to 0.
  FilteredRate(double lag_s, double sample_s, double jump_per_s = 1e300) noexcept
      : share_(static_cast<T>(dynamics::lag_share(lag_s, sample_s))),
        sample_s_(static_cast<T>(sample_s)),
        jump_per_s_(static_cast<T>(std::fmin(jump_per_s, 1e30))) {}

  void step(T value) noexcept {
    if (!std::isfinite(value)) return;
    if (!started_) {
      start(value);
      return;
    }
    const T slope = (value - value_) / sample_s_;
    rate_ = std::abs(slope) > jump_per_s_ ? T(0.0) : rate_ + share_ * (slope - rate_);
    value_ = value;
  }
  /// At rest at a value.
  void start(T value) noexcept {
    value_ = value;
    rate_ = T(0.0);
    started_ = true;
  }
  void forget() noexcept {
    value_ = rate_ = T(0.0);
    started_ = false;
  }

  bool started() const noexcept { return started_; }
  T value() const noexcept { return value_; }
  T rate() const noexcept { return rate_; }

  template <class Self, class V>
  static void visit(Self& self, V&& v) {
    v("started", self.started_);
    visit_number(v, "value", self.value_);
    visit_number(v, "rate", self.rate_);
  }

 private:
  T share_, sample_s_, jump_per_s_;
  T value_{0.0}, rate_{0.0};
  bool started_ = false;
};

}  // namespace mgdd::control
