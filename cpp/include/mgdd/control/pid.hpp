// PID controller of a throttle plate with what practice adds to it: gains per side of limp-home, a filtered derivative
// of the measurement, conditional integration (anti-windup), spring and friction feed-forward, a friction kick and a
// dead band. Angles in deg, duty -1..1, time in s. `step` is noexcept and allocation-free, on double and float.
// Laws: Åström and Hägglund 2006 (filter of the derivative, conditional integration, weight of the reference rate);
// friction compensation: Armstrong-Helouvry et al. 1994. Defaults fit the throttle P1.
#pragma once

#include <cstddef>
#include <span>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/control/duty_range.hpp"
#include "mgdd/control/filtered_rate.hpp"
#include "mgdd/control/plate.hpp"

namespace mgdd::control {

struct PidGains {
  double proportional_per_deg = 0.12778;
  double integral_per_deg_s = 1.3;
  double derivative_s_per_deg = 1.4667e-3;

  bool operator==(const PidGains&) const = default;
};

struct PidSettings {
  double sample_s = 1e-3;
  PidGains above{}, below{};  ///< of limp-home, blended over the ramp of the springs by the measured angle
  double derivative_lag_s = 3e-3;
  Plate plate{.friction = 0.0603};  ///< springs fed forward at the reference, friction in the direction of its rate

  double kick = 0.1205;  ///< [-] added towards the reference, in full where the error exceeds `kick_width_deg`
  double kick_width_deg = 0.019;
  double dead_band_deg = 0.1;  ///< smaller errors count as zero

  double integral_window_deg = 2.0;  ///< only smaller errors are integrated
  double integral_limit = 0.3;       ///< [-]

  double rate_s_per_deg = 3.46e-4;        ///< fed forward per rate of the reference
  double friction_rate_deg_per_s = 17.2;  ///< at which the friction is full
  ReferenceRate reference{};

  DutyRange duty{};

  bool operator==(const PidSettings&) const = default;
};

/// All numbers of the settings, in the order in which Python shows them.
std::span<const Field<PidSettings>> pid_fields() noexcept;
inline auto fields_of(const PidSettings&) {
  return pid_fields();
}

/// ParameterError naming field, value and bound.
void validate(const PidSettings& settings);

template <class T>
class BasicPid {
 public:
  explicit BasicPid(const PidSettings& settings);

  /// Duty of this sample. Inputs that are not finite repeat the last ones; before the first ones it is 0.
  T step(T reference_deg, T measurement_deg) noexcept;

  /// As made: no integral, no rates.
  void reset() noexcept;
  /// Takes over from a duty without a bump: at rest, the integral set so that a step at these angles gives this duty,
  /// as far as its limit allows and but for one sample of integration. Ignored if a number is not finite.
  void reset(T reference_deg, T measurement_deg, T duty) noexcept;

  const PidSettings& settings() const noexcept { return settings_; }
  T integral() const noexcept { return integral_; }
  T duty() const noexcept { return duty_; }

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    FilteredRate<T>::visit(self.reference_, Prefixed<V>{v, "reference_"});
    FilteredRate<T>::visit(self.measurement_, Prefixed<V>{v, "measurement_"});
    visit_number(v, "integral", self.integral_);
    visit_number(v, "duty", self.duty_);
  }

 private:
  struct Share {
    T duty;      // all terms but the integral
    T error;     // behind the dead band
    T integral;  // gain of the integral
  };
  Share without_integral() const noexcept;

  PidSettings settings_;
  FilteredRate<T> reference_, measurement_;
  T integral_{0.0};
  T duty_{0.0};
};

using Pid = BasicPid<double>;
extern template class BasicPid<double>;
extern template class BasicPid<float>;

}  // namespace mgdd::control
