#include "mgdd/optimize/seekers/gradient_descent.hpp"

#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double least_difference = 0.5;     // of the difference: inputs applied nearer to each other show no slope
constexpr double own_step = 0.5;             // step size times |J''|
constexpr double own_rate = 4.0;             // differences per step
constexpr double descent_unseen_bend = 1.0;  // |J''| c^2 over the noise

GradientDescentSettings checked(GradientDescentSettings s) {
  const Eigen::Index n = s.space.size();
  if (s.step_size) require_positive("step_size", *s.step_size);
  require_positive("difference", s.difference);
  validate_curvature(s.curvature);
  validate(s.space, Inputs::Constant(n, s.difference));
  if (s.rate.size() == 0) s.rate = Inputs::Constant(n, s.step_size ? unlimited : own_rate * s.difference);
  validate_entries("rate", s.rate, n, 0.0);
  if (!(s.tolerance >= 0.0 && std::isfinite(s.tolerance))) {
    throw ParameterError("tolerance", s.tolerance, "must be >= 0 and finite");
  }
  if (s.iterations < 1) throw ParameterError("iterations", s.iterations, "must be >= 1");
  return s;
}

}  // namespace

std::vector<std::string> GradientDescentSettings::advice() const {
  if (!curvature || !step_size) return {};
  const double bound = 2.0 / std::abs(*curvature);
  if (!(*step_size >= bound)) return {};
  return {"step_size = " + text(*step_size) + " is not below " + text(bound) +
          " = 2/|J''|, the bound of convergence; 1/|J''| is fastest"};
}

GradientDescent::GradientDescent(GradientDescentSettings settings)
    : SeekerCore(checked(std::move(settings)),
                 [](const GradientDescentSettings& s) { return 8.0 * static_cast<double>(s.space.size()); }),
      first_(Inputs::Constant(settings_.space.size(), settings_.difference), descent_unseen_bend, !settings_.step_size,
             settings_.curvature),
      gradient_(Inputs::Zero(estimate_.size())),
      metric_(InputMatrix::Identity(estimate_.size(), estimate_.size())) {}

std::optional<double> GradientDescent::step_size() const noexcept {
  if (settings_.step_size || first_.open()) return settings_.step_size;
  return own_step / first_.largest_bend();
}

const Inputs& GradientDescent::ask() noexcept {
  if (first_.open()) return protocol_.ask(applied_ = first_.ask(estimate_));
  applied_ = estimate_;
  applied_[stage_ / 2] += stage_ % 2 == 0 ? settings_.difference : -settings_.difference;
  return protocol_.ask(applied_);
}

TellStatus GradientDescent::tell(const Reading& reading) noexcept {
  return take(reading, [&](const Inputs& applied) { learn(reading, applied); });
}

void GradientDescent::learn(const Reading& reading, const Inputs& applied) noexcept {
  filter_.record(applied, reading.limits);
  const double j = objective_of(reading, settings_.maximize) + filter_.shaping(applied, reading.limits);
  if (first_.open()) {
    first_.learn(applied, j);
    if (filter_.alarmed()) move(Inputs::Zero(applied.size()));
    return;
  }
  clamp_.record(applied_, applied, estimate_);
  const Eigen::Index input = stage_ / 2;
  const double missed = applied[input] - applied_[input];
  if (stage_ % 2 == 0) {
    above_ = j;
    above_missed_ = missed;
  } else {
    const double distance = 2.0 * settings_.difference + (above_missed_ - missed);  // between the applied inputs
    const bool moved = distance > least_difference * settings_.difference;
    gradient_[input] = moved ? (above_ - j) / distance : 0.0;
  }
  if (++stage_ < 2 * estimate_.size()) return;
  stage_ = 0;
  clamp_.close_window();
  const double moved = move(step_size().value_or(0.0) * gradient_);
  ++iteration_;
  if (converged_at_ < 0 && iteration_ <= settings_.iterations && moved < settings_.tolerance) {
    converged_at_ = iteration_;
  }
}

// Gives the largest entry of the step that the limits leave.
double GradientDescent::move(Inputs step) noexcept {
  const Inputs reach = Inputs::Constant(step.size(), settings_.difference);
  step = filter_.project(estimate_, step, {settings_.space, reach, reach, settings_.rate, settings_.rate, metric_});
  move_within(estimate_, step, settings_.space, reach, clamp_, Inputs::Zero(step.size()));
  return step.cwiseAbs().maxCoeff();
}

void GradientDescent::restart() noexcept {
  stage_ = 0;
  iteration_ = 0;
  converged_at_ = -1;
  first_.restart();
  forget();
}

}  // namespace mgdd::optimize
