// Two redundant position sensors of a throttle plate with opposite slopes, their faults, and the check between them.
// V1 = closed_v + span_v angle/travel, V2 = supply - V1; then fault, anti-alias filter, noise, limits and converter.
// Volts and degrees. `step` is noexcept and allocation-free; equal seeds give equal noise in any order of calls.
// Thresholds: sum within 0.2 V and range 0.2 to 4.8 V (Bosch Motorsport, MS 6 manual); 200 ms of debouncing is common.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"

namespace mgdd::throttle {

struct SensorPair {
  double closed_v = 0.5;  ///< first sensor at 0 deg; 0 with span 5 is the ideal form of catalogues
  double span_v = 4.0;    ///< over the travel
  double travel_deg = 90.0;
  double supply_v = 5.0;
  double noise_v = 0.002;  ///< rms at the converter, each sensor its own
  double lag_s = 3e-4;     ///< anti-alias filter, first order
  int adc_bits = 12;
  double sum_tolerance_v = 0.2;
  double low_v = 0.2;  ///< range of a healthy sensor
  double high_v = 4.8;
  double debounce_s = 0.2;  ///< so long a check must fail; a sample that passes takes back half of one

  bool operator==(const SensorPair&) const = default;

  [[nodiscard]] double lsb_v() const noexcept { return supply_v / static_cast<double>(1LL << adc_bits); }
  /// What each sensor alone says of the angle.
  [[nodiscard]] std::array<double, 2> angles_deg(const std::array<double, 2>& volts) const noexcept {
    const auto scaled = [this](double first_v) { return (first_v - closed_v) / span_v * travel_deg; };
    return {scaled(volts[0]), scaled(supply_v - volts[1])};
  }
};

constexpr auto fields_of(const SensorPair&) {
  using P = SensorPair;
  return std::tuple{
      field<&P::closed_v>({"closed_v", "V", {}, "first sensor at 0 deg"}),
      field<&P::span_v>({"span_v", "V", above(0.0), "change of voltage over the travel"}),
      field<&P::travel_deg>({"travel_deg", "deg", closed(1.0, 360.0), "travel behind that change"}),
      field<&P::supply_v>({"supply_v", "V", closed(0.1, 100.0), "supply of both sensors"}),
      field<&P::noise_v>({"noise_v", "V", {}, "noise of each sensor, rms"}),
      field<&P::lag_s>({"lag_s", "s", closed(0.0, 1.0), "time constant of the input filter"}),
      field<&P::adc_bits>({"adc_bits", "-", closed(4.0, 24.0), "bits of the converter"}),
      field<&P::sum_tolerance_v>({"sum_tolerance_v", "V", {}, "tolerance of the sum"}),
      field<&P::low_v>({"low_v", "V", {}, "lowest healthy voltage"}),
      field<&P::high_v>({"high_v", "V", {}, "highest healthy voltage"}),
      field<&P::debounce_s>({"debounce_s", "s", closed(0.0, 60.0), "time a fault must last"}),
  };
}

enum class SensorFaultKind {
  none,
  open_wire,        ///< the input's resistor pulls it to 0 V
  short_to_ground,  ///< 0 V
  short_to_supply,
  offset,  ///< size [V] is added
  gain,    ///< the voltage grows by the share `size` [-]
  stuck,   ///< holds the voltage of its onset
};
struct SensorFault {
  SensorFaultKind kind = SensorFaultKind::none;
  double from_s = 0.0;
  double size = 0.0;
  std::optional<double> until_s{};  ///< none: it stays
};

/// Everything that changes from sample to sample.
struct SensorState {
  std::array<double, 2> filtered_v{};
  std::array<std::optional<double>, 2> stuck_v{};
  std::int64_t sample = 0;
  double failing = 0.0;  ///< samples with a failing check, less half of those that passed since
  bool fault = false;    ///< latched
};

struct SensorReading {
  std::array<double, 2> volts{};  ///< as converted
  double angle_deg = 0.0;         ///< of the first sensor, of the second where only the first is out of range
  double sum_error_v = 0.0;       ///< V1 + V2 - supply
  std::array<bool, 2> range_fault{};
  bool sum_fault = false;
  bool fault = false;  ///< a check has failed for the debounce time: open the bridge
};

/// ParameterError naming field, value and bound.
void validate(const SensorPair& pair);
void validate(const SensorFault& fault);

class SensorSampler {
 public:
  /// ParameterError for bad settings, a fault of bad size, or a sample time outside [1e-5, 1] s.
  SensorSampler(const SensorPair& pair, double sample_s, std::uint64_t seed, const std::array<SensorFault, 2>& faults);

  /// Takes the next sample of the true angle.
  SensorReading step(double angle_deg) noexcept;

  const SensorState& state() const noexcept { return state_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    auto& s = self.state_;
    v("sensor_sample", s.sample, counts_end);
    v("sensor_failing", s.failing);
    v("sensor_fault", s.fault);
    for (std::size_t i = 0; i < s.filtered_v.size(); ++i) {
      const std::string which = i == 0 ? "first" : "second";
      v(which + "_filtered_v", s.filtered_v[i]);
      bool stuck = s.stuck_v[i].has_value();     // NOLINT(misc-const-correctness): a reader writes both
      double held = s.stuck_v[i].value_or(0.0);  // NOLINT(misc-const-correctness)
      v(which + "_is_stuck", stuck);
      v(which + "_stuck_v", held);
      if constexpr (!std::is_const_v<Self>) s.stuck_v[i] = stuck ? std::optional<double>(held) : std::nullopt;
    }
  }

 private:
  double faulty(std::size_t which, double volts, double time_s) noexcept;

  SensorPair pair_;
  double sample_s_, filter_, lsb_v_, highest_v_;
  std::uint64_t seed_;
  std::array<SensorFault, 2> faults_;
  double debounce_;
  SensorState state_;
};

}  // namespace mgdd::throttle
