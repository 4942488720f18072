#include "mgdd/identify/online/recursive_window.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Dense>

#include "mgdd/common/bounds.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/identify/online/pw_r_factors.hpp"

namespace mgdd::identify {

void WindowPwRSettings::validate() const {
  model.validate();
  require_within("every", every, 1.0, 100.0, "samples");
  require_positive("noise_deg", noise_deg, "deg");
  require_positive("prior_spread", prior_spread);
}

WindowPwR::WindowPwR(const WindowPwRSettings& settings) : settings_(settings) {
  settings_.validate();
}

bool WindowPwR::update(double duty, double angle_deg) noexcept {
  // A dropped sample keeps its place in time: its duty is taken as the last one, its angle weighs nothing.
  const bool has_angle = std::isfinite(angle_deg);
  if (std::isfinite(duty)) last_duty_ = duty;
  const bool adds = count_ % settings_.every == 0;
  if (adds) {
    const auto point = count_ / settings_.every;
    angle_[point % points] = has_angle ? angle_deg : angle_[(point + points - 1) % points];
    known_[point % points] = has_angle ? 1.0 : 0.0;
    if (point > 0) duty_[(point - 1) % points] = duty_sum_ / settings_.every;
    duty_sum_ = 0.0;
  }
  duty_sum_ += line_.pass(last_duty_, settings_.model.frame.delay());
  ++count_;
  return adds && has_angle;
}

template <class T>
throttle::BasicPwR<T> WindowPwR::seeded(const Column& z) const noexcept {
  auto p = with_factors<T>(settings_.model, z);
  p.frame.delay_samples = 0.0;  // the window holds the duty that acts
  p.frame.sample_s *= settings_.every;
  p.frame.substeps *= settings_.every;
  return p;
}

double WindowPwR::evaluate(const Column& z, Square* normal, Column* gradient) const noexcept {
  using D = Dual<unknowns>;
  const auto model = throttle::model_of(seeded<D>(z), throttle::unchecked);
  auto state = model.at_rest(D(settings_.model.limp_home_deg + z[5]), D(0.0));
  state.position_deg.grad[5] = 1.0;
  state.speed_deg_per_s = D::seeded(z[6], 6);
  const std::int64_t last = (count_ - 1) / settings_.every;  // newest point
  const double over_sigma = 1.0 / settings_.noise_deg;
  double cost = 0.0;
  if (normal != nullptr) {
    normal->setZero();
    gradient->setZero();
  }
  const auto at = [&](std::size_t i) { return (last + 1 + static_cast<std::int64_t>(i)) % points; };
  dynamics::run(
      model, state, points, [&](std::size_t i) { return D(duty_[at(i)]); },
      [&](std::size_t i, const D& y) {
        if (!(known_[at(i)] > 0.0)) return true;
        const double r = (y.value - angle_[at(i)]) * over_sigma;
        cost += r * r;
        if (normal != nullptr) {
          const Eigen::Map<const Column> slope(y.grad.data());
          *normal += slope * slope.transpose() * (over_sigma * over_sigma);
          *gradient += slope * (r * over_sigma);
        }
        return true;
      });
  const double weight = 1.0 / (settings_.prior_spread * settings_.prior_spread);
  for (int i = 0; i < 5; ++i) {
    cost += weight * z[i] * z[i];
    if (normal != nullptr) {
      (*normal)(i, i) += weight;
      (*gradient)[i] += weight * z[i];
    }
  }
  return cost;
}

bool WindowPwR::iterate() noexcept {
  if (count_ < static_cast<std::int64_t>(points) * settings_.every) return false;
  if (known_.sum() < 0.5 * points) return false;
  const std::int64_t first = ((count_ - 1) / settings_.every + 1) % points;
  Column z;
  z.head<5>() = factors_;
  z[5] = angle_[first] - settings_.model.limp_home_deg;
  z[6] = (angle_[(first + 1) % points] - angle_[first]) / (settings_.every * settings_.model.frame.sample_s);
  Square normal;
  Column gradient;
  const double now = evaluate(z, &normal, &gradient);
  for (int i = 0; i < 5; ++i) {
    if (settings_.free[static_cast<std::size_t>(i)]) continue;
    normal.row(i).setZero();
    normal.col(i).setZero();
    normal(i, i) = 1.0;
    gradient[i] = 0.0;
  }
  for (int i = 0; i < unknowns; ++i)
    normal(i, i) *= 1.0 + damping_;
  const Column step = normal.ldlt().solve(-gradient);
  Column trial = z + step.cwiseMax(-5e3).cwiseMin(5e3);
  trial.head<5>() = trial.head<5>()
                        .cwiseMax(factors_.array().matrix() - Eigen::Matrix<double, 5, 1>::Constant(0.5))
                        .cwiseMin(factors_ + Eigen::Matrix<double, 5, 1>::Constant(0.5));
  const double next = evaluate(trial, nullptr, nullptr);
  cost_ = now;
  if (!(std::isfinite(next) && next < now)) {
    damping_ = std::min(damping_ * 11.0, 1e8);
    return false;
  }
  damping_ = std::max(damping_ / 9.0, 1e-6);
  factors_ = trial.head<5>();
  cost_ = next;
  return true;
}

throttle::PwR WindowPwR::model() const noexcept {
  return bounded(with_factors<double>(settings_.model, factors_));
}

throttle::PwR bounded(throttle::PwR parameters) noexcept {
  const auto rows = throttle::fields(throttle::PseudoWienerKind::pw_r);
  const auto places = throttle::numbers(parameters);
  for (std::size_t i = 0; i < rows.size(); ++i)
    *places[i] = rows[i].domain.clamped(*places[i]);
  return parameters;
}

}  // namespace mgdd::identify
