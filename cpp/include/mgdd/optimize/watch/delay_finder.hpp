// The whole cycles between an input and its reading, told about right: from time to time the newest readings are held
// against the inputs of every delay near the one told, and the one under which a Gaussian process finds them clearly
// more likely is taken from then on. noexcept and free of allocation after construction.
#pragma once

#include <cstdint>
#include <string>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/belief/process_model.hpp"

namespace mgdd::optimize {

class DelayFinder {
 public:
  /// `told` is rounded to whole cycles; 0 as `uncertainty` takes it as told.
  DelayFinder(double told, int uncertainty, Eigen::Index inputs);

  /// One cycle: what was applied, in ranges; and what was read in it, if anything.
  void record(const Inputs& z) noexcept;
  void read(double value) noexcept;
  /// Whether what is read now stems from an input that was recorded, and from which.
  bool known() const noexcept { return cycles_ > delay(); }
  Inputs cause() const noexcept { return before(delay()); }
  /// What was applied that many cycles before the last one.
  Inputs before(std::int64_t back) const noexcept { return applied_.row(row_of(cycles_ - 1 - back)).transpose(); }
  /// Cycles whose readings have not come yet.
  std::int64_t on_their_way() const noexcept { return std::min(delay(), cycles_); }
  std::int64_t delay() const noexcept { return told_ + off_; }
  /// True where another delay is taken from now on; the process then knows the newest readings alone, by it.
  bool judge(ProcessModel& process, const Inputs& about) noexcept;
  /// A new operating point: what was applied is void, the delay stays.
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_cycles", self.cycles_, counts_end);
    v(name + "_applied", self.applied_);
    v(name + "_values", self.values_);
    v(name + "_later", self.later_, self.told_ + self.uncertainty_ + 1);
    v(name + "_wanted", self.wanted_later_, self.told_ + self.uncertainty_ + 1);
    if constexpr (!std::is_const_v<Self>) {
      self.off_ = self.later_ - self.told_;
      self.wanted_ = self.wanted_later_ - self.told_;
    }
  }

 private:
  Eigen::Index row_of(std::int64_t cycle) const noexcept { return cycle % applied_.rows(); }
  int gather() noexcept;
  void cause_of(int count, std::int64_t off) noexcept;

  std::int64_t told_, uncertainty_;
  std::int64_t cycles_ = 0, off_ = 0, wanted_ = 0;
  std::int64_t later_, wanted_later_;  // delays in place of their differences, as a state is written
  InputTable applied_;                 // a ring of cycles
  Eigen::VectorXd values_;             // `unread` where nothing was read
  // Scratch: the newest readings, and the inputs that caused them under one delay.
  Eigen::VectorXd newest_, ages_;
  InputTable causes_;
};

}  // namespace mgdd::optimize
