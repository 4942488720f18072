#include "mgdd/control/sliding_mode.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "mgdd/common/error.hpp"

namespace mgdd::control {
namespace {

using Sm = SlidingModeSettings;

constexpr Domain sliding_share = closed(0.0, 1.0);

constexpr auto sliding_mode_table = joined(
    std::array{
        field<&Sm::sample_s>({"sample_s", "s", above(0.0, 1.0), "time between samples"}),
    },
    motion_fields<&Sm::plate>(), spring_fields<&Sm::plate>(),
    std::array{
        field<&Sm::plate, &Plate::friction>(
            {"friction", "-", sliding_share, "duty in the direction of the reference's rate"}),
        field<&Sm::friction_rate_deg_per_s>(
            {"friction_rate_deg_per_s", "degree/second", above(0.0, 1e6), "rate at which it is full"}),
        field<&Sm::bandwidth_per_s>(
            {"bandwidth_per_s", "1/second", above(0.0, 1e6), "decay of the error on the surface"}),
        field<&Sm::integral_per_s>(
            {"integral_per_s", "1/second", closed(0.0, 1e6), "weight of the integral in the surface"}),
        field<&Sm::integral_layers>(
            {"integral_layers", "-", closed(0.0, 1e6), "integrates only while |s| is below so many layers"}),
        field<&Sm::reference_pole_per_s>(
            {"reference_pole_per_s", "1/second", above(0.0, 1e6), "double pole of the reference's filter"}),
        field<&Sm::derivative_lag_s>({"derivative_lag_s", "s", closed(0.0, 10.0), "lag of the measured speed"}),
        field<&Sm::switching>({"switching", "-", sliding_share, "duty of the reaching law"}),
        field<&Sm::layer_deg>({"layer_deg", "deg", closed(0.0, 1e3), "error at which that duty is full"}),
        field<&Sm::root_per_root_deg_per_s>({"root_per_root_deg_per_s", "(second/degree)**0.5", closed(0.0, 1e3),
                                             "super-twisting: duty per root of |s|"}),
        field<&Sm::twist_per_s>({"twist_per_s", "1/second", closed(0.0, 1e6), "super-twisting: rate of its integral"}),
    },
    duty_fields<&Sm::duty>());

const SlidingModeSettings& checked(const SlidingModeSettings& settings) {
  validate(settings);
  return settings;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

}  // namespace

std::span<const Field<SlidingModeSettings>> sliding_mode_fields() noexcept {
  return sliding_mode_table;
}

void validate(const SlidingModeSettings& s) {
  require_fields(sliding_mode_table, s);
  validate(s.duty);
  if (s.reaching == ReachingLaw::boundary_layer && !(s.layer_deg > 0.0)) {
    fail(
        ParameterError("layer_deg", s.layer_deg, "must be > 0 for a boundary layer; without one take implicit", "deg"));
  }
}

template <class T>
BasicSlidingMode<T>::BasicSlidingMode(const SlidingModeSettings& settings)
    : settings_(checked(settings)), measurement_(settings.derivative_lag_s, settings.sample_s) {
  const double share_of_lag = dynamics::lag_share(1.0 / settings.reference_pole_per_s, settings.sample_s);
  filter_.first_share = filter_.second_share = static_cast<T>(share_of_lag);
}

template <class T>
T BasicSlidingMode<T>::layer() const noexcept {
  const SlidingModeSettings& set = settings_;
  const double given = set.layer_deg * set.bandwidth_per_s;
  const double carried = set.sample_s * set.plate.gain_deg_per_s2 * set.switching;
  return T(set.reaching == ReachingLaw::implicit ? given + carried : given);
}

// Implicit forms solve for s at the end of the sample, s+ = s + h G u, so that no law carries s across zero.
template <class T>
auto BasicSlidingMode<T>::reach() const noexcept -> Reached {
  const SlidingModeSettings& set = settings_;
  const T s = surface_;
  const T carried = T(set.sample_s * set.plate.gain_deg_per_s2);  // by duty 1 in one sample
  if (set.reaching != ReachingLaw::super_twisting) {
    const T thick = layer();
    return {thick > T(0.0) ? -T(set.switching) * limited_share(s, thick) : T(0.0), twist_};
  }
  // s+ + a sqrt|s+| sgn(s+) = s, solved without cancellation; the integral takes over what disturbs, and its sign is a
  // saturation over four of its own steps: the double pole 1/2 of s near zero.
  const T size = std::abs(s);
  const T a = carried * T(set.root_per_root_deg_per_s);
  const T end = T(2.0) * size / (a + std::sqrt(a * a + T(4.0) * size));  // sqrt|s+|
  const T root = size > T(0.0) ? std::copysign(T(set.root_per_root_deg_per_s) * end, s) : T(0.0);
  const T step = T(set.sample_s * set.twist_per_s);
  const T taken = step > T(0.0) ? step * limited_share(s, T(4.0) * carried * step) : T(0.0);
  return {twist_ - root, twist_ - taken};
}

template <class T>
T BasicSlidingMode<T>::step(T reference_deg, T measurement_deg) noexcept {
  const SlidingModeSettings& set = settings_;
  measurement_.step(measurement_deg);
  if (std::isfinite(reference_deg)) {
    reference_ = reference_deg;
    if (!started_ && measurement_.started()) {
      started_ = true;
      first_ = second_ = measurement_.value();
    }
  }
  if (!started_) return duty_;
  filter_.step(first_, second_, reference_);
  const T pole = T(set.reference_pole_per_s), bandwidth = T(set.bandwidth_per_s), weight = T(set.integral_per_s);
  const T reference_rate = pole * (first_ - second_);
  const T reference_acceleration = pole * (pole * (reference_ - first_) - reference_rate);
  const T error = measurement_.value() - second_;
  const T error_rate = measurement_.rate() - reference_rate;
  surface_ = error_rate + bandwidth * (error + weight * integral_deg_s_);
  const Reached reached = reach();
  const T on_surface =
      (reference_acceleration - bandwidth * (error_rate + weight * error)) / T(set.plate.gain_deg_per_s2) +
      measurement_.rate() / T(set.plate.gain_deg_per_s2 * set.plate.time_constant_s) +
      set.plate.spring.at(measurement_.value()) +
      T(set.plate.friction) * limited_share(reference_rate, T(set.friction_rate_deg_per_s));
  const T wanted = on_surface + reached.duty;
  duty_ = set.duty.clamp(wanted);
  // Neither integral grows while a bound holds the duty back.
  const bool held_back = (wanted > duty_ && error < T(0.0)) || (wanted < duty_ && error > T(0.0));
  if (!held_back && std::abs(surface_) < T(set.integral_layers) * layer()) {
    integral_deg_s_ += T(set.sample_s) * error;
  }
  if (wanted == duty_) twist_ = reached.twist;
  return duty_;
}

template <class T>
void BasicSlidingMode<T>::reset() noexcept {
  measurement_.forget();
  started_ = false;
  reference_ = first_ = second_ = integral_deg_s_ = twist_ = surface_ = duty_ = T(0.0);
}

template <class T>
void BasicSlidingMode<T>::require_usable() const {
  require_usable_duty(duty_, settings_.duty);
}

template class BasicSlidingMode<double>;
template class BasicSlidingMode<float>;

}  // namespace mgdd::control
