#include "mgdd/control/pid.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "mgdd/common/error.hpp"

namespace mgdd::control {
namespace {

using Pi = PidSettings;

constexpr Domain pid_gain = closed(0.0, 1e3);
constexpr Domain pid_share = closed(0.0, 1.0);
constexpr Domain pid_angle = above(0.0, 1e3);

constexpr auto pid_table = joined(
    std::array{
        field<&Pi::sample_s>({"sample_s", "s", above(0.0, 1.0), "time between samples"}),
        field<&Pi::above, &PidGains::proportional_per_deg>(
            {"proportional_above_per_deg", "1/degree", pid_gain, "duty per error above limp-home"}),
        field<&Pi::above, &PidGains::integral_per_deg_s>(
            {"integral_above_per_deg_s", "1/(degree*second)", pid_gain, "integral gain above limp-home"}),
        field<&Pi::above, &PidGains::derivative_s_per_deg>(
            {"derivative_above_s_per_deg", "second/degree", pid_gain, "duty against speed above limp-home"}),
        field<&Pi::below, &PidGains::proportional_per_deg>(
            {"proportional_below_per_deg", "1/degree", pid_gain, "duty per error below limp-home"}),
        field<&Pi::below, &PidGains::integral_per_deg_s>(
            {"integral_below_per_deg_s", "1/(degree*second)", pid_gain, "integral gain below limp-home"}),
        field<&Pi::below, &PidGains::derivative_s_per_deg>(
            {"derivative_below_s_per_deg", "second/degree", pid_gain, "duty against speed below limp-home"}),
        field<&Pi::derivative_lag_s>({"derivative_lag_s", "s", closed(0.0, 10.0), "lag of the measured speed"}),
    },
    spring_fields<&Pi::plate>("half width over which preload and gains change sides"),
    std::array{
        field<&Pi::kick>({"kick", "-", pid_share, "duty towards the reference against stiction"}),
        field<&Pi::kick_width_deg>({"kick_width_deg", "deg", pid_angle, "error at which the kick is full"}),
        field<&Pi::dead_band_deg>({"dead_band_deg", "deg", closed(0.0, 1e3), "smaller errors count as zero"}),
        field<&Pi::integral_window_deg>(
            {"integral_window_deg", "deg", pid_angle, "only smaller errors are integrated"}),
        field<&Pi::integral_limit>({"integral_limit", "-", pid_share, "bound of the integral"}),
        field<&Pi::rate_s_per_deg>({"rate_s_per_deg", "second/degree", pid_gain, "duty per rate of the reference"}),
        field<&Pi::plate, &Plate::friction>(
            {"friction", "-", pid_share, "duty in the direction of that rate against dry friction"}),
        field<&Pi::friction_rate_deg_per_s>(
            {"friction_rate_deg_per_s", "degree/second", above(0.0, 1e6), "rate at which it is full"}),
    },
    reference_fields<&Pi::reference>(), duty_fields<&Pi::duty>());

const PidSettings& checked(const PidSettings& settings) {
  validate(settings);
  return settings;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

}  // namespace

std::span<const Field<PidSettings>> pid_fields() noexcept {
  return pid_table;
}

void validate(const PidSettings& s) {
  require_fields(pid_table, s);
  validate(s.duty);
}

template <class T>
BasicPid<T>::BasicPid(const PidSettings& settings)
    : settings_(checked(settings)),
      reference_(settings.reference.lag_s, settings.sample_s, settings.reference.jump_deg_per_s),
      measurement_(settings.derivative_lag_s, settings.sample_s) {}

template <class T>
auto BasicPid<T>::without_integral() const noexcept -> Share {
  const PidSettings& s = settings_;
  const T distance = measurement_.value() - T(s.plate.spring.limp_home_deg);
  const T upper_share = T(0.5) + T(0.5) * limited_share(distance, T(s.plate.spring.ramp_deg));
  const auto scheduled = [&](double PidGains::* gain_of) {
    return upper_share * T(s.above.*gain_of) + (T(1.0) - upper_share) * T(s.below.*gain_of);
  };
  const T error = reference_.value() - measurement_.value();
  const T counted = std::abs(error) > T(s.dead_band_deg) ? error : T(0.0);
  const T duty = s.plate.spring.at(reference_.value()) + scheduled(&PidGains::proportional_per_deg) * counted -
                 scheduled(&PidGains::derivative_s_per_deg) * measurement_.rate() +
                 T(s.kick) * limited_share(counted, T(s.kick_width_deg)) + T(s.rate_s_per_deg) * reference_.rate() +
                 T(s.plate.friction) * limited_share(reference_.rate(), T(s.friction_rate_deg_per_s));
  return {duty, counted, scheduled(&PidGains::integral_per_deg_s)};
}

template <class T>
T BasicPid<T>::step(T reference_deg, T measurement_deg) noexcept {
  reference_.step(reference_deg);
  measurement_.step(measurement_deg);
  if (!reference_.started() || !measurement_.started()) return duty_;
  const Share now = without_integral();
  const T lower = T(settings_.duty.lower), upper = T(settings_.duty.upper), limit = T(settings_.integral_limit);
  // Conditional integration: not while a bound holds the duty back in the direction of the error.
  const T wanted = now.duty + integral_;
  const bool held_back = (wanted >= upper && now.error > T(0.0)) || (wanted <= lower && now.error < T(0.0));
  if (!held_back && std::abs(now.error) < T(settings_.integral_window_deg)) {
    integral_ = std::clamp(integral_ + now.integral * T(settings_.sample_s) * now.error, -limit, limit);
  }
  duty_ = std::clamp(now.duty + integral_, lower, upper);
  return duty_;
}

template <class T>
void BasicPid<T>::reset() noexcept {
  reference_.forget();
  measurement_.forget();
  integral_ = T(0.0);
  duty_ = T(0.0);
}

template <class T>
void BasicPid<T>::reset(T reference_deg, T measurement_deg, T duty) noexcept {
  if (!std::isfinite(reference_deg) || !std::isfinite(measurement_deg) || !std::isfinite(duty)) return;
  reference_.start(reference_deg);
  measurement_.start(measurement_deg);
  const T limit = T(settings_.integral_limit);
  duty_ = settings_.duty.clamp(duty);
  integral_ = std::clamp(duty_ - without_integral().duty, -limit, limit);
}

template <class T>
void BasicPid<T>::require_usable() const {
  const T limit = T(settings_.integral_limit);
  require_within("state column 'integral'", static_cast<double>(integral_), static_cast<double>(-limit),
                 static_cast<double>(limit));
  require_usable_duty(duty_, settings_.duty);
}

template class BasicPid<double>;
template class BasicPid<float>;

}  // namespace mgdd::control
