#include "mgdd/identify/online/recursive_pw_r.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::identify {
namespace {

using Core = RecursivePwR::Core;

// Scaled so that every entry of the estimate starts near one: theta = (p1, G, G beta, G kappa, G delta)/scale.
Core::Column numbers_of(const throttle::PwRSide& s, double t) noexcept {
  const double g = s.gain_deg_per_s2_per_duty;
  Core::Column c;
  c << 1.0 - std::exp(-t / s.tau_s), g, g * s.preload_duty, g * s.spring_duty_per_deg, g * s.coulomb_duty;
  return c;
}

Core make_core(const RecursivePwRSettings& s, const throttle::PwRSide& side, std::size_t first_field) {
  const auto rows = throttle::fields(throttle::PseudoWienerKind::pw_r);
  const double t = s.every * s.model.frame.sample_s;
  const Domain& tau = rows[first_field].domain;
  const Domain& gain = rows[first_field + 1].domain;
  Core::Settings c;
  c.start = numbers_of(side, t);
  c.lower << 1.0 - std::exp(-t / tau.upper), gain.lower, 0.0, 0.0, 0.0;
  c.upper << 1.0 - std::exp(-t / tau.lower), gain.upper, gain.upper * rows[first_field + 2].domain.upper,
      gain.upper * rows[first_field + 3].domain.upper, gain.upper * rows[first_field + 4].domain.upper;
  // Half the gain and a preload or friction of 0.1 duty are plausible surprises; over the variance of the equation.
  const double g = side.gain_deg_per_s2_per_duty;
  const double noise = 6.0 * s.noise_deg * s.noise_deg;
  c.start_variance << 0.01, 0.25 * g * g, 0.01 * g * g, 1e-6 * g * g, 0.01 * g * g;
  c.start_variance /= noise;
  for (int i = 0; i < 5; ++i) {
    if (!s.free[static_cast<std::size_t>(i)]) c.start_variance[i] = 0.0;
  }
  c.forgetting = s.forgetting;
  c.trace_cap = s.trace_cap;
  return Core(c);
}

RecursivePwRSettings checked(const RecursivePwRSettings& s) {
  s.validate();
  return s;
}

}  // namespace

void RecursivePwRSettings::validate() const {
  model.validate();
  require_within("every", every, 1.0, 100.0, "samples");
  require_within("least_speed_deg_per_s", least_speed_deg_per_s, 0.0, 1e3, "deg/s");
  require_within("stop_band_deg", stop_band_deg, 0.0, 20.0, "deg");
  require_within("limp_home_band_deg", limp_home_band_deg, 0.0, 20.0, "deg");
  require_positive("noise_deg", noise_deg, "deg");
  require_within("error_gate", error_gate, 0.0, 100.0);
  if (std::ranges::none_of(free, [](bool f) { return f; })) {
    throw about("free", ParameterError("free holds no true: name at least one of tau, G, beta, kappa, delta"));
  }
}

RecursivePwR::RecursivePwR(const RecursivePwRSettings& settings)
    : settings_(checked(settings)),
      above_(make_core(settings_, settings_.model.above, 0)),
      below_(make_core(settings_, settings_.model.below, 7)) {}

UpdateGate RecursivePwR::update(double duty, double angle_deg) noexcept {
  const bool has_duty = std::isfinite(duty);
  const bool has_angle = std::isfinite(angle_deg);
  const dynamics::Delay delay = settings_.model.frame.delay();
  UpdateGate gate = has_duty && has_angle ? UpdateGate::filling : UpdateGate::not_finite;
  if (count_ % settings_.every == 0) {
    const double now = has_angle ? angle_deg - settings_.model.limp_home_deg : position_[2];
    position_ = Eigen::Vector3d(position_[1], position_[2], now);
    duty_mean_ = Eigen::Vector2d(duty_mean_[1], duty_sum_ / settings_.every);
    duty_sum_ = 0.0;
    if (!has_angle) clean_from_ = std::max(clean_from_, count_ + 1);
    if (gate == UpdateGate::filling && count_ >= clean_from_ + std::int64_t{2} * settings_.every) gate = learn();
  }
  // A dropped sample keeps its place in time: a clock that stood still would turn the gap into a jump of the plate.
  if (!has_duty) clean_from_ = std::max(clean_from_, count_ + delay.reach + 1);
  duty_sum_ += line_.pass(has_duty ? duty : 0.0, delay);
  ++count_;
  return gate;
}

UpdateGate RecursivePwR::learn() noexcept {
  const throttle::PwR& m = settings_.model;
  const double t = settings_.every * m.frame.sample_s;
  const double before = position_[1] - position_[0];
  const double now = position_[2] - position_[1];
  const double slowest = settings_.least_speed_deg_per_s * t;
  if (!(before * now > 0.0 && std::min(std::abs(before), std::abs(now)) > slowest)) return UpdateGate::slow;
  const double low = position_.minCoeff();
  const double high = position_.maxCoeff();
  if (high + m.limp_home_deg > m.frame.open_deg - settings_.stop_band_deg ||
      low + m.limp_home_deg < m.frame.closed_deg + settings_.stop_band_deg) {
    return UpdateGate::at_stop;
  }
  const bool up = low > settings_.limp_home_band_deg;
  if (!up && !(high < -settings_.limp_home_band_deg)) return UpdateGate::limp_home;

  Core& core = up ? above_ : below_;
  const throttle::PwRSide& held = up ? m.above : m.below;
  const auto& free = settings_.free;
  const double a = free[0] ? std::clamp(1.0 - core.estimate()[0], 1e-6, 1.0 - 1e-6) : std::exp(-t / held.tau_s);
  const double tau = free[0] ? -t / std::log(a) : held.tau_s;
  const double c_now = tau * (t - tau * (1.0 - a));
  const double c_before = tau * (tau * (1.0 - a) - a * t);
  const double side = up ? 1.0 : -1.0;
  const double whole = c_now + c_before;
  Core::Column phi;
  phi << -before, c_now * duty_mean_[1] + c_before * duty_mean_[0], -whole * side,
      -(c_now * 0.5 * (position_[1] + position_[2]) + c_before * 0.5 * (position_[0] + position_[1])),
      -whole * (now > 0.0 ? 1.0 : -1.0);
  double y = now - before;
  if (!free[0]) y += (1.0 - a) * before;
  for (int i = 1; i < 5; ++i) {
    if (free[static_cast<std::size_t>(i)]) continue;
    y -= core.settings().start[i] * phi[i];
    phi[i] = 0.0;
  }
  if (!free[0]) phi[0] = 0.0;
  const double error = y - core.predict(phi);
  if (!(std::abs(error) > settings_.error_gate * settings_.noise_deg)) return UpdateGate::small;
  return core.update(phi, y) ? UpdateGate::updated : UpdateGate::not_finite;
}

throttle::PwR RecursivePwR::model() const noexcept {
  throttle::PwR out = settings_.model;
  const auto rows = throttle::fields(throttle::PseudoWienerKind::pw_r);
  const double t = settings_.every * out.frame.sample_s;
  const auto take = [&](const Core& core, throttle::PwRSide& s) {
    if (core.updates() == 0) return;
    const auto& p = core.estimate();
    const auto& free = settings_.free;
    const auto bounded = [&](std::size_t i, double value) { return rows[i].domain.clamped(value); };
    if (free[0]) s.tau_s = bounded(0, -t / std::log(std::clamp(1.0 - p[0], 1e-6, 1.0 - 1e-6)));
    if (free[1]) s.gain_deg_per_s2_per_duty = bounded(1, p[1]);
    const double g = s.gain_deg_per_s2_per_duty;
    if (free[2] || free[1]) s.preload_duty = bounded(2, p[2] / g);
    if (free[3] || free[1]) s.spring_duty_per_deg = bounded(3, p[3] / g);
    if (free[4] || free[1]) s.coulomb_duty = bounded(4, p[4] / g);
  };
  take(above_, out.above);
  take(below_, out.below);
  return out;
}

}  // namespace mgdd::identify
