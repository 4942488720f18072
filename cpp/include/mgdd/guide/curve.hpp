// What a model says of one quantity (J, or a limited one) over one input: a smooth curve through given points, held as
// a table at even distances, that goes on straight beyond its ends. Units of the input and of the quantity.
// Trivially copyable; reading it and putting other points in are noexcept and free of allocation.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "mgdd/common/bounds.hpp"

namespace mgdd::guide {

class Curve {
 public:
  static constexpr std::size_t nodes = 513;
  static constexpr std::size_t fewest_points = 3;

  /// Zero everywhere on [0, 1].
  Curve() noexcept = default;
  /// Through points of increasing input. ShapeError or ParameterError name what is wrong with them.
  Curve(std::span<const double> inputs, std::span<const double> values);
  /// curvature/2 (x - best)^2 on [best - reach, best + reach].
  static Curve parabola(double curvature, double best, double reach);

  /// The same with other points; false, and nothing changed, where the constructor would throw.
  bool put(std::span<const double> inputs, std::span<const double> values) noexcept;

  /// NaN at NaN.
  double operator()(double input) const noexcept {
    const double at = (input - first_) * per_step_;
    if (!(at > 0.0)) return values_[0] + at * (values_[1] - values_[0]);
    if (at >= static_cast<double>(nodes - 1)) {
      return values_[nodes - 1] + (at - static_cast<double>(nodes - 1)) * (values_[nodes - 1] - values_[nodes - 2]);
    }
    const auto i = static_cast<std::size_t>(at);
    return values_[i] + (at - static_cast<double>(i)) * (values_[i + 1] - values_[i]);
  }

  double lower() const noexcept { return first_; }
  double upper() const noexcept { return first_ + static_cast<double>(nodes - 1) / per_step_; }
  /// Input of the largest value between `lower` and `upper`, between nodes by a parabola, and the value there.
  double best() const noexcept { return best_; }
  double top() const noexcept { return top_; }
  /// Second difference over +-`reach` about the best input; < 0 where the curve has a maximum that counts.
  double curvature(double reach) const noexcept {
    return ((*this)(best_ - reach) - 2.0 * (*this)(best_) + (*this)(best_ + reach)) / (reach * reach);
  }
  /// By how much it rises again within `reach` of its best input, as a share of its height there; 0 with one maximum.
  double rises_again(double reach) const noexcept;
  /// Whether the largest value lies inside, not at an end.
  bool has_maximum() const noexcept { return inside_; }

  bool operator==(const Curve&) const = default;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("first", self.first_);
    v("per_step", self.per_step_);
    v("values", self.values_);
    v("best", self.best_);
    v("top", self.top_);
    v("inside", self.inside_);
  }
  /// ParameterError for a restored table that cannot be read.
  void require_usable() const { require_in(above(0.0), "per_step", per_step_); }

 private:
  void find_best() noexcept;

  double first_ = 0.0;
  double per_step_ = static_cast<double>(nodes - 1);
  std::array<double, nodes> values_{};
  double best_ = 0.0, top_ = 0.0;
  bool inside_ = false;
};

}  // namespace mgdd::guide
