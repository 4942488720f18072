// The input that caused a reading: what was applied a delay ago, passed through the same first-order lag. One path per
// measured quantity. noexcept and allocation-free after construction.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mgdd/optimize/seekers/dither.hpp"

namespace mgdd::optimize {

class CausingInputs {
 public:
  CausingInputs(const std::vector<ComponentLag>& lags, Eigen::Index inputs);

  /// One cycle: what was applied in it. Costs next to nothing where every path is direct.
  void record(const Inputs& applied) noexcept {
    ++cycles_;
    if (settling_ > 0) pass_on(applied);
  }
  /// False until the reading of path i no longer stems from before the first record: delay and twice the lag.
  bool known(std::size_t i) const noexcept { return cycles_ > paths_[i].wait; }
  /// The input behind the present reading of path i; `applied` is what was recorded last, and outlives the answer.
  const Inputs& of(std::size_t i, const Inputs& applied) const noexcept {
    return paths_[i].direct ? applied : paths_[i].input;  // NOLINT(bugprone-return-const-ref-from-parameter)
  }
  /// True where path i is neither delayed nor lagged.
  bool direct(std::size_t i) const noexcept { return paths_[i].direct; }
  /// Cycles until a reading of every path belongs to an input that has stayed: to five percent of a step.
  std::int64_t settling() const noexcept { return settling_; }
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_cycles", self.cycles_, std::int64_t{1} << 53);
    v(name + "_ring", self.ring_);
    for (std::size_t i = 0; i < self.paths_.size(); ++i)
      v(name + std::to_string(i), self.paths_[i].input);
  }

 private:
  struct Path {
    bool direct = true;
    std::int64_t whole = 0, wait = 0;   // cycles
    double fraction = 0.0, keep = 0.0;  // of the delay; of the lag, per cycle
    Inputs input;
  };
  void pass_on(const Inputs& applied) noexcept;
  Inputs applied_before(std::int64_t cycles) const noexcept;

  Eigen::Index inputs_;
  std::vector<Path> paths_;
  std::vector<double> ring_;  // the last applied inputs, row by row; empty where nothing is delayed
  std::int64_t rows_ = 1, settling_ = 0, cycles_ = 0;
};

}  // namespace mgdd::optimize
