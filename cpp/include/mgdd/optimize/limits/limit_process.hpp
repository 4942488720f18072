// What a Gaussian process knows of a limited quantity. Where its readings stand well above zero the logarithm is
// learnt, with slope 1 at the limit: quantities as NOx spread over powers of ten. noexcept and allocation-free after
// construction.
#pragma once

#include <string>
#include <type_traits>

#include "mgdd/optimize/belief/process_model.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"

namespace mgdd::optimize {

class LimitProcess {
 public:
  /// `settings` without what follows from the limit and its guide, which may be empty. Its uncertainty is widened as
  /// that of readings less `freedom`; the logarithm of a guide is learnt where it spans so many times its least value.
  LimitProcess(const Limit& limit, ProcessModel::Settings settings, const Surface& guide, Eigen::Index freedom,
               double spans);

  ProcessModel& model() noexcept { return model_; }
  const ProcessModel& model() const noexcept { return model_; }
  /// `sd`: of the readings that were averaged, as in `ProcessModel::scattered`; 0 where there is none.
  void record(const Inputs& z, double value, const Inputs& about, double readings = 1.0, double sd = 0.0) noexcept;

  /// What the limit would be exceeded by at a point of the last prediction, that many standard deviations above the
  /// mean, in its scale.
  double excess(int point, double quantile) const noexcept;
  /// The standard deviation that counts there, in the scale of the limit.
  double sd(int point) const noexcept;
  /// By what its quantiles of few readings exceed normal ones.
  double widening() const noexcept { return model_.widening(freedom_); }
  /// What the largest kept reading leaves free, in the scale of the limit.
  double room() const noexcept { return (limit_.upper - limit_.margin - model_.highest()) / limit_.scale; }

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_logarithm", self.logarithm_);
    ProcessModel::visit(self.model_, v, name);
  }

 private:
  Limit limit_;
  bool guided_, logarithm_;
  Eigen::Index freedom_;
  ProcessModel model_;
};

}  // namespace mgdd::optimize
