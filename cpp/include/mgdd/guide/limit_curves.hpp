// Measured limits of a curve-guided seeker. The guide's curve m of a limited quantity gives the shape, the readings
// give level and slope: L = a + b m(x), a and b normal (Bayesian linear regression, Gelman et al. 2013), readings fade.
// Without a curve m is the straight line. An input is allowed where the mean, two standard deviations of it and the
// margin lie below the limit: what was never tried is left alone until the readings speak for it.
// noexcept and allocation-free after construction. Units of the input and of the limited quantity.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/guide/curve.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"
#include "mgdd/optimize/watch/causing_inputs.hpp"

namespace mgdd::guide {

class LimitCurves {
 public:
  /// One curve per limit, or none at all. Inputs lie in [lower, upper]; `reach` is a distance over which the guide may
  /// be trusted to know a slope's size. `step` is the least that can be tried without a curve.
  LimitCurves(std::vector<optimize::Limit> limits, std::vector<Curve> curves, double lower, double upper, double reach,
              double memory_cycles, double step = 0.0);

  std::size_t size() const noexcept { return limits_.size(); }
  /// Takes the values that were read after this input was applied.
  void record(double applied, std::span<const double> values) noexcept;
  /// Nothing is known of another operating point but its curves; empty: the old ones.
  void restart(std::span<const Curve> curves) noexcept;

  /// Largest excess at this input over the limits less their margins, in their scales; > 0: not allowed.
  double excess(double input) const noexcept;
  /// The nearest allowed input; where there is none, the one with the least excess. Stays at the last input while a
  /// limit without a curve has not been read.
  double nearest(double wanted) noexcept;
  optimize::LimitState state(std::size_t i) const noexcept;
  double delay_cycles(std::size_t i) const noexcept { return causes_.delay_cycles(i); }  ///< as far as readings tell

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    for (std::size_t i = 0; i < self.sums_.size(); ++i)
      v("limit_sums" + std::to_string(i), self.sums_[i]);
    v("limit_states", self.states_);
    v("limit_last", self.last_);
    optimize::CausingInputs::visit(self.causes_, v, "limit_cause");
    for (std::size_t i = 0; i < self.curves_.size(); ++i) {
      Prefixed<V> own{v, self.prefixes_[i]};
      Curve::visit(self.curves_[i], own);
    }
  }

 private:
  static constexpr std::size_t max_limits = 8;
  enum Number : std::size_t { count, mean_m, mean_y, mm, my, yy, numbers };  // means, and means of products about them
  struct Line {  // of one limit: a + b (m - centre), the variances of a and b, and of a reading
    double centre, a, b, var_a, var_b, noise;
  };
  double shape(std::size_t i, double input) const noexcept;
  Line line(std::size_t i) const noexcept;
  bool blind() const noexcept;
  double scaled_excess(std::size_t i, double input, const Line& line) const noexcept;

  std::vector<optimize::Limit> limits_;
  std::vector<Curve> curves_;  // empty: straight lines
  std::vector<std::string> prefixes_;
  optimize::CausingInputs causes_;
  double lower_, upper_, reach_, step_, fading_;
  std::vector<std::array<double, numbers>> sums_;
  std::vector<double> states_;  // a LimitState each
  std::optional<double> last_;  // input recorded last
};

}  // namespace mgdd::guide
