// The input that caused a reading: what was applied a delay ago, passed through the same first-order lag. One source
// per measured quantity. A stated delay may be wrong: then the reading is held against the inputs of neighbouring
// delays too, and the one whose plane through the last cycles foretells the readings clearly better is taken from then
// on. noexcept and allocation-free after construction.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/belief/local_model.hpp"
#include "mgdd/optimize/laws/dither.hpp"

namespace mgdd::optimize {

/// What stands between an input and a reading, and by how many whole cycles its delay may be off to either side.
struct UncertainLag {
  ComponentLag lag{};
  int delay_uncertainty = 0;  ///< [cycles], >= 0
  double memory = 2.0;        ///< [cycles] that the planes look back which tell the delays from one another
};

class CausingInputs {
 public:
  CausingInputs(const std::vector<UncertainLag>& lags, Eigen::Index inputs);

  /// One cycle: what was applied in it.
  void record(const Inputs& applied) noexcept {
    ++cycles_;
    if (rows_ > 1 || settling() > 0) pass_on(applied);
  }
  /// The reading of source i after `record`; true where another delay is taken for it from now on.
  bool judge(std::size_t i, const Inputs& applied, double value) noexcept;

  /// False until the reading of source i no longer stems from before the first record: delay and twice the lag.
  bool known(std::size_t i) const noexcept { return cycles_ > path(i).wait; }
  /// The input behind the present reading of source i; `applied` is what was recorded last, and outlives the answer.
  const Inputs& of(std::size_t i, const Inputs& applied) const noexcept {
    return path(i).of(applied);  // NOLINT(bugprone-return-const-ref-from-parameter)
  }
  /// The plane through the readings of source i over these inputs; empty where its delay is not uncertain.
  const LocalModel& model(std::size_t i) const noexcept { return path(i).model; }
  /// The delay that is taken for source i [cycles].
  double delay_cycles(std::size_t i) const noexcept { return path(i).delay(); }
  /// True where source i is neither delayed nor lagged.
  bool direct(std::size_t i) const noexcept { return path(i).direct; }
  /// Cycles until a reading of every source belongs to an input that has stayed: to five percent of a step.
  std::int64_t settling() const noexcept;
  /// A new operating point: what was applied is void. The delays belong to the sensors and stay.
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_cycles", self.cycles_, counts_end);
    v(name + "_ring", self.ring_);
    for (std::size_t i = 0; i < self.sources_.size(); ++i) {
      v(name + std::to_string(i) + "_taken", self.sources_[i].taken, self.sources_[i].count);
      v(name + std::to_string(i) + "_judged", self.sources_[i].judged);
    }
    for (std::size_t p = 0; p < self.paths_.size(); ++p) {
      const std::string own = name + "_path" + std::to_string(p);
      v(own, self.paths_[p].input);
      v(own + "_error", self.paths_[p].error);
      LocalModel::visit(self.paths_[p].model, v, own + "_model");
    }
  }

 private:
  struct Path {
    bool direct;
    std::int64_t whole, wait, settling;  // cycles
    double fraction, keep;               // of the delay; of the lag, per cycle
    Inputs input;
    LocalModel model;
    double error = 0.0, off = 0.0;  // mean square of what the plane did not foretell, and of the last reading

    const Inputs& of(const Inputs& applied) const noexcept {
      return direct ? applied : input;  // NOLINT(bugprone-return-const-ref-from-parameter)
    }
    double delay() const noexcept { return static_cast<double>(whole) + fraction; }
  };
  struct Source {
    std::int64_t first = 0, count = 0, taken = 0;  // its paths, one per delay, and which of them is taken
    double judged = 0.0;                           // readings behind `error`
  };
  const Path& path(std::size_t i) const noexcept {
    return paths_[static_cast<std::size_t>(sources_[i].first + sources_[i].taken)];
  }
  void pass_on(const Inputs& applied) noexcept;
  Inputs applied_before(std::int64_t cycles) const noexcept;

  Eigen::Index inputs_;
  std::vector<Source> sources_;
  std::vector<Path> paths_;
  std::vector<double> ring_;  // the last applied inputs, row by row; empty where nothing is delayed
  std::int64_t rows_ = 1, cycles_ = 0;
};

}  // namespace mgdd::optimize
