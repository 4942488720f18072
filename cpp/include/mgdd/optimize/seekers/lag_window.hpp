// A first-order lag taken out of readings: what a quantity was while an input was held, of the readings and what they
// had come from. noexcept.
#pragma once

#include <cstdint>
#include <string>

#include "mgdd/optimize/seekers/delay_finder.hpp"
#include "mgdd/optimize/seekers/inputs.hpp"

namespace mgdd::optimize {

class LagWindow {
 public:
  LagWindow(double lag_cycles, Eigen::Index inputs) noexcept;

  /// True where `value` becomes one reading, of `hold` cycles if there is a lag, and `z` the input that it belongs to.
  bool take(double& value, Inputs& z, std::int64_t hold) noexcept;
  bool lagged() const noexcept { return keep_ > 0.0; }
  /// A cycle without a reading.
  void skip() noexcept { last_ = unread; }
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    if (!self.lagged()) return;
    v(name + "_last", self.last_);
    v(name + "_sum", self.sum_);
    v(name + "_count", self.count_);
    v(name + "_idle", self.idle_);
    v(name + "_inputs", self.inputs_);
    v(name + "_held", self.held_);
  }

 private:
  double keep_;  // of a reading in the next; 0: no lag
  double last_ = unread;
  double sum_ = 0.0;
  std::int64_t count_ = 0, idle_ = 0;  // cycles in it; since one was read
  Inputs inputs_, held_;               // their sum; the first
};

}  // namespace mgdd::optimize
