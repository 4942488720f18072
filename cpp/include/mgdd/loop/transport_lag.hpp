// Transport delay and first-order lag of a gas sensor, per engine cycle: y_k += g (x_{k-D} - y_k), g = 1 - exp(-1/tau).
// Delay D and lag tau in cycles, given so or in seconds at a speed. `step` is noexcept and allocation-free; the delay
// line is sized once. Time constants of gas analysers and how to state them: 40 CFR 1065.308.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"

namespace mgdd::loop {

/// A sensor as its data sheet states it. Cycles, where given, win over seconds and do not follow the speed.
struct SensorDynamics {
  double delay_s = 0.0;                        ///< sample line, in [0, 60]
  double lag_s = 0.0;                          ///< time constant, in [0, 60]; t10-90 is 2.2 times it
  double noise_fraction = 0.0;                 ///< [-] standard deviation of the reading over the reading, in [0, 0.2]
  std::optional<std::int64_t> delay_cycles{};  ///< in [0, 100000]
  std::optional<double> lag_cycles{};          ///< in [0, 100000]

  /// D = round(delay N / 120 s) for N in rev/min.
  std::size_t delay_at(double speed_rpm) const noexcept;
  /// g = 1 - exp(-1/tau); 1 without lag.
  double gain_at(double speed_rpm) const noexcept;

  bool operator==(const SensorDynamics&) const = default;
};

constexpr auto fields_of(const SensorDynamics&) {
  using D = SensorDynamics;
  constexpr Domain cycles = closed(0.0, 100000.0);
  return std::tuple{
      field<&D::delay_s>({"delay_s", "s", closed(0.0, 60.0), "delay of the sample line"}),
      field<&D::lag_s>({"lag_s", "s", closed(0.0, 60.0), "time constant"}),
      field<&D::noise_fraction>({"noise_fraction", "-", closed(0.0, 0.2), "noise over reading"}),
      field<&D::delay_cycles>({"delay_cycles", "-", cycles, "delay in engine cycles instead"}),
      field<&D::lag_cycles>({"lag_cycles", "-", cycles, "time constant in engine cycles instead"}),
  };
}

/// ParameterError names `sensor`.field, value and bound.
void validate(std::string_view sensor, const SensorDynamics& dynamics);

class TransportLag {
 public:
  explicit TransportLag(std::size_t longest_delay = 0) : line_(longest_delay + 1, 0.0) {}

  /// As if `steady` had stood at the inlet for ever.
  void fill(double steady) noexcept;
  /// One cycle; `delay` at most the longest. A delay that changes jumps to another place of the line.
  double step(double x, std::size_t delay, double gain) noexcept;
  double level() const noexcept { return level_; }

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_level", self.level_);
    v(name + "_at", self.at_, static_cast<std::int64_t>(self.line_.size()));
    v(name + "_line", self.line_);
  }

 private:
  std::vector<double> line_;
  std::int64_t at_ = 0;
  double level_ = 0.0;
};

}  // namespace mgdd::loop
