#include "mgdd/optimize/laws/gradient_descent.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double own_step = 0.5;             // step size times |J''|
constexpr double step_tolerance = 0.02;      // in scales of the inputs
constexpr double own_rate = 4.0;             // differences per step
constexpr double descent_unseen_bend = 1.0;  // |J''| c^2 over the noise

GradientDescentSettings checked(GradientDescentSettings s) {
  const Eigen::Index n = s.space.size();
  s.space = resolved(std::move(s.space));
  s.step_size = for_each_input(std::move(s.step_size), n);
  const bool own = s.step_size.size() == 0;
  if (!own) validate_entries("step_size", s.step_size, n, 0.0, largest_reading);
  s.difference = or_scaled(std::move(s.difference), 1.0, s.space);
  validate_entries("difference", s.difference, n, 0.0, largest_reading);
  validate_curvature(s.curvature);
  validate(s.space, s.difference);
  if (s.rate.size() == 0) s.rate = own ? Inputs(own_rate * s.difference) : Inputs::Constant(n, unlimited);
  validate_entries("rate", s.rate, n, 0.0);
  s.rate = within_rates(std::move(s.rate), s.space);
  s.tolerance = or_scaled(std::move(s.tolerance), step_tolerance, s.space);
  validate_entries("tolerance", s.tolerance, n, -std::numeric_limits<double>::min(), largest_reading);
  if (s.iterations < 1) throw ParameterError("iterations", s.iterations, "must be >= 1");
  return s;
}

}  // namespace

std::vector<std::string> GradientDescentSettings::advice() const {
  if (!curvature || step_size.size() == 0) return {};
  const double bound = 2.0 / std::abs(*curvature), largest = step_size.maxCoeff();
  if (!(largest >= bound)) return {};
  return {"step_size = " + text(largest) + " is not below " + text(bound) +
          " = 2/|J''|, the bound of convergence; 1/|J''| is fastest"};
}

GradientDescent::GradientDescent(GradientDescentSettings settings)
    : SeekerCore(checked(std::move(settings)),
                 [](const GradientDescentSettings& s) { return 8.0 * static_cast<double>(s.space.size()); }),
      first_(settings_.difference, descent_unseen_bend, settings_.step_size.size() == 0, settings_.curvature),
      gradient_(Inputs::Zero(estimate_.size())),
      metric_(metric_of(settings_.difference)) {}

Inputs GradientDescent::step_size() const noexcept {
  if (settings_.step_size.size() > 0 || first_.open()) return settings_.step_size;
  return first_.even_steps(own_step);
}

const Inputs& GradientDescent::ask() noexcept {
  if (first_.open()) {
    applied_ = first_.ask(estimate_);
    return send();
  }
  applied_ = estimate_;
  applied_[stage_ / 2] += (stage_ % 2 == 0 ? 1.0 : -1.0) * settings_.difference[stage_ / 2];
  return send();
}

void GradientDescent::learn(const Reading& reading, const Inputs& applied) noexcept {
  const double j = objective_of(reading, settings_.maximize) + filter_.shaping(applied, reading.limits);
  if (!clamp_.arrived(applied_, applied, estimate_)) return;
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
    const double asked = 2.0 * settings_.difference[input];
    gradient_[input] = slope_between(above_ - j, asked + (above_missed_ - missed), asked);
  }
  if (++stage_ < 2 * estimate_.size()) return;
  stage_ = 0;
  clamp_.close_window();
  const bool small = move(step_size().cwiseProduct(gradient_));
  ++iteration_;
  if (converged_at_ < 0 && iteration_ <= settings_.iterations && small) {
    converged_at_ = iteration_;
  }
}

// True where every entry of the step that the limits leave is below its tolerance.
bool GradientDescent::move(Inputs step) noexcept {
  const Inputs& reach = settings_.difference;
  step = filter_.project(estimate_, step,
                         {settings_.space, reach, clamp_.reach(reach), settings_.rate, settings_.rate, metric_});
  move_within(estimate_, step, settings_.space, reach, clamp_);
  return (step.array().abs() < settings_.tolerance.array()).all();
}

void GradientDescent::restart() noexcept {
  stage_ = 0;
  iteration_ = 0;
  converged_at_ = -1;
  first_.restart();
  forget();
}

}  // namespace mgdd::optimize
