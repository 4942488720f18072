// What a Gaussian process knows of where cycles fail: of their labels, -1 where one worked, 1 where it failed; and
// whether they fail by their input at all, or anywhere. noexcept and allocation-free after construction.
#pragma once

#include <algorithm>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/belief/process_model.hpp"

namespace mgdd::optimize {

class FailingProcess {
 public:
  /// `settings` of a process of J over the same inputs.
  explicit FailingProcess(ProcessModel::Settings settings);

  void record(const Inputs& z, bool worked, const Inputs& about) noexcept;
  void fit(const Inputs& about) noexcept {
    if (known()) model_.fit(about);
  }
  void forget() noexcept;
  void reseed(std::uint64_t seed) noexcept { model_.reseed(seed); }
  bool seen_one() const noexcept { return model_.count_above(0.0) > 0; }
  /// Whether cycles have failed, and more likely by their input than anywhere.
  bool by_input() const noexcept { return known() && anywhere_ <= 0.0; }

  /// Which labels may be asked for: below `most`, that many standard deviations above the mean; or, where all of them
  /// may fail, as where cycles fail at random, within `room` of the least one.
  struct Demand {
    double quantile, most, room;
  };
  void predict(const InputTable& at, int points, int from = 0) noexcept { model_.predict(at, points, from); }
  /// `judge(excess, mean, point)` takes by how much a point that was predicted is above the demand.
  template <class Judge>
  void judge(int points, int from, const Demand& demand, const Judge& judge) noexcept {
    const auto likely = [&](int p) { return model_.mean(p) + demand.quantile * model_.sd(p); };
    double least = largest_reading;
    for (int p = from; p < from + points; ++p)
      least = std::min(least, likely(p));
    const double most = std::max(demand.most, least + demand.room);
    for (int p = from; p < from + points; ++p)
      judge(likely(p) - most, model_.mean(p), p);
  }

  void require_usable() const {
    require_in(closed(0.0, 1e12), "cycles_seen", seen_);
    require_in(closed(0.0, seen_), "cycles_failed", failed_);
    require_in(closed(least_anywhere, -least_anywhere), "anywhere", anywhere_);
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("cycles_seen", self.seen_);
    v("cycles_failed", self.failed_);
    v("anywhere", self.anywhere_);
    ProcessModel::visit(self.model_, v, "failing");
  }

 private:
  static constexpr double least_anywhere = -3.0;  // a region that fails is to be taken seriously first
  bool known() const noexcept { return seen_one() && model_.count() >= model_.fewest(); }

  ProcessModel model_;
  InputTable here_;                   // scratch
  double seen_ = 0.0, failed_ = 0.0;  // cycles, fading
  double anywhere_ = least_anywhere;  // logarithm of how much likelier cycles fail anywhere than by their input
};

}  // namespace mgdd::optimize
