// A straight line (plane) through the last cycles: exponentially weighted regression of one measured quantity on the
// applied input. Seekers use it to know limits and to take the trend off J. noexcept and allocation-free.
#pragma once

#include <string>

#include "mgdd/optimize/ask_tell/seeker.hpp"

namespace mgdd::optimize {

class LocalModel {
 public:
  /// `memory`: number of cycles that count, 2 at least.
  LocalModel(Eigen::Index inputs, double memory) noexcept;

  void record(const Inputs& applied, double value) noexcept;
  void forget() noexcept;

  double cycles() const noexcept { return weight_; }  ///< effective number of cycles behind the plane
  Inputs slope() const noexcept;                      ///< zero while the input has not moved
  double predict(const Inputs& at) const noexcept;
  double residual_variance() const noexcept;  ///< mean square of what was recorded about the plane

  /// Standard deviation of the readings about the plane; 0 before there are enough to tell.
  double scatter() const noexcept;

  /// True where some entry of the slope exceeds `errors` of its standard errors.
  bool slope_known(double errors) const noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_weight", self.weight_);
    v(name + "_mean", self.mean_);
    v(name + "_variance", self.variance_);
    v(name + "_mean_input", self.mean_input_);
    v(name + "_cross", self.cross_);
    v(name + "_spread", self.spread_);
  }

 private:
  double forgetting_;
  double weight_ = 0.0, mean_ = 0.0, variance_ = 0.0;
  Inputs mean_input_, cross_;
  InputMatrix spread_;
};

}  // namespace mgdd::optimize
