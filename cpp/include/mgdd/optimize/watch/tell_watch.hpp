// What a seeker is told that cannot be true of a plant that answers: a channel that reads the same to the last bit at
// different inputs, and an input of whose moves little is applied. It changes nothing that a seeker does.
// noexcept and allocation-free after construction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"

namespace mgdd::optimize {

class TellWatch {
 public:
  /// `channels`: components of J, then limits.
  TellWatch(Eigen::Index inputs, std::size_t channels)
      : last_(channels, 0.0),
        alike_(channels, 0.0),
        most_alike_(channels, 0.0),
        before_(Inputs::Zero(inputs)),
        mean_asked_(before_),
        mean_applied_(before_),
        asked_(before_),
        applied_(before_) {}

  /// A reading at an input that is `applied` as far as is known.
  void read(std::span<const double> components, std::span<const double> limits, const Inputs& applied) noexcept;
  /// What the plant says that it applied; looked at from the first time on that it is not what was asked.
  void follow(const Inputs& asked, const Inputs& applied) noexcept;

  /// Most readings in a row, per channel, that were alike to the last bit while the input was not. Of a limit those up
  /// to now: what stands at a floor of the plant, as the pressure of compression, moves again.
  const std::vector<double>& alike() const noexcept { return most_alike_; }
  /// Standard deviation of what was applied of late over that of what was asked, per input; 1 before that is known.
  Inputs applied_share() const noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("told_last", self.last_);
    v("told_alike", self.alike_);
    v("told_most_alike", self.most_alike_);
    v("told_before", self.before_);
    v("told_count", self.count_);
    v("told_mean_asked", self.mean_asked_);
    v("told_mean_applied", self.mean_applied_);
    v("told_asked", self.asked_);
    v("told_applied", self.applied_);
  }

 private:
  std::vector<double> last_, alike_, most_alike_;
  Inputs before_;                                       // applied at the last reading
  double count_ = 0.0;                                  // cycles of late that said what was applied
  Inputs mean_asked_, mean_applied_, asked_, applied_;  // means and variances over these
};

}  // namespace mgdd::optimize
