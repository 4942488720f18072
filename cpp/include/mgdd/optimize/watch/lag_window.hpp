// A first-order lag taken out of readings: what a quantity was while an input was held. A Kalman filter (Kalman 1960)
// follows the sensor, known from window to window, and the quantity, which every window begins to learn anew. noexcept.
#pragma once

#include <cstdint>
#include <string>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"

namespace mgdd::optimize {

class LagWindow {
 public:
  LagWindow(double lag_cycles, Eigen::Index inputs) noexcept;

  /// True where `value` becomes one reading, of `hold` cycles if there is a lag, and `z` the input that it belongs to.
  bool take(double& value, Inputs& z, std::int64_t hold) noexcept;
  bool lagged() const noexcept { return keep_ > 0.0; }
  /// A cycle without a reading.
  void skip() noexcept { sensor_ = unread; }
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    if (!self.lagged()) return;
    v(name + "_sensor", self.sensor_);
    v(name + "_quantity", self.quantity_);
    v(name + "_sensor_variance", self.sensor_variance_);
    v(name + "_quantity_variance", self.quantity_variance_);
    v(name + "_covariance", self.covariance_);
    v(name + "_count", self.count_, counts_end);
    v(name + "_idle", self.idle_, counts_end);
    v(name + "_inputs", self.inputs_);
    v(name + "_held", self.held_);
  }

 private:
  void learn(double reading) noexcept;

  double keep_;  // of the sensor in the next cycle; 0: no lag
  double sensor_ = unread, quantity_ = 0.0;
  double sensor_variance_ = 1.0, quantity_variance_ = 0.0, covariance_ = 0.0;  // over that of a reading's noise
  std::int64_t count_ = 0, idle_ = 0;                                          // cycles in it; since one was read
  Inputs inputs_, held_;                                                       // their sum; the first
};

}  // namespace mgdd::optimize
