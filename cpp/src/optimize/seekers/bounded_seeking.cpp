#include "mgdd/optimize/seekers/bounded_seeking.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double own_kappa = 0.051;            // times |J''| a^2: the mean approaches in ten periods
constexpr double bounded_unseen_bend = 0.067;  // |J''| (a omega)^2 over the noise: 0.17 of |J''| a^2 at a period of 10

Inputs omega_of(const DitherSettings& dither, Eigen::Index inputs) {
  Inputs omega(inputs);
  for (Eigen::Index i = 0; i < omega.size(); ++i)
    omega[i] = 2.0 * std::numbers::pi * dither.harmonics[static_cast<std::size_t>(i)] / dither.period;
  return omega;
}

BoundedSeekingSettings checked(BoundedSeekingSettings s) {
  const Eigen::Index n = s.space.size();
  if (n < 1) throw about("start", ShapeError("start is empty: give one number per input"));
  s.space = resolved(std::move(s.space));
  s.dither.amplitude = or_scaled(std::move(s.dither.amplitude), 1.0, s.space);
  validate(s.dither, n, false);
  validate(s.space, Inputs::Zero(n));
  if (s.kappa) require_positive("kappa", *s.kappa);
  validate_curvature(s.curvature);
  return s;
}

}  // namespace

std::vector<std::string> BoundedSeekingSettings::advice() const {
  std::vector<std::string> out;
  if (!curvature || !kappa) return out;
  const Inputs amplitude = or_scaled(dither.amplitude, 1.0, space), omega = omega_of(dither, amplitude.size());
  for (Eigen::Index i = 0; i < amplitude.size(); ++i) {
    const double a = amplitude[i];
    const double bound = 1.0 / (a * a * omega[i] * std::abs(*curvature) * dither.period);  // tau = 2 periods
    if (!(*kappa > bound)) continue;
    out.push_back("kappa = " + text(*kappa) + " is above " + text(bound) +
                  ", the bound of averaging (tau of at least 2 periods); lower kappa or the amplitude");
  }
  return out;
}

BoundedSeeking::BoundedSeeking(BoundedSeekingSettings settings)
    : SeekerCore(checked(std::move(settings)), [](const BoundedSeekingSettings& s) { return 2.0 * s.dither.period; }),
      first_(settings_.dither.amplitude.cwiseProduct(omega_of(settings_.dither, settings_.space.size())),
             bounded_unseen_bend, !settings_.kappa, settings_.curvature),
      omega_(omega_of(settings_.dither, settings_.space.size())),
      metric_(InputMatrix::Identity(applied_.size(), applied_.size())),
      window_(static_cast<std::size_t>(settings_.dither.period * applied_.size()), 0.0) {
  metric_.diagonal() = settings_.dither.amplitude.cwiseAbs2().cwiseProduct(omega_);  // of the mean drift
}

std::optional<double> BoundedSeeking::kappa() const noexcept {
  if (settings_.kappa || first_.open()) return settings_.kappa;
  return own_kappa / first_.bend().cwiseProduct(settings_.dither.amplitude.cwiseAbs2()).maxCoeff();
}

const Inputs& BoundedSeeking::ask() noexcept {
  if (first_.open()) {
    applied_ = first_.ask(estimate_).cwiseMax(settings_.space.lower).cwiseMin(settings_.space.upper);
  }
  return protocol_.ask(applied_);
}

TellStatus BoundedSeeking::tell(const Reading& reading) noexcept {
  const TellStatus status = take(reading, [&](const Reading& read, const Inputs& applied) { learn(read, applied); });
  look_back(*this, true);
  return status;
}

void BoundedSeeking::learn(const Reading& reading, const Inputs& applied) noexcept {
  const double j = objective_of(reading, settings_.maximize) + filter_.shaping(applied, reading.limits);
  if (first_.open()) {
    first_.learn(applied, j);
    applied_ = estimate_;
    return;
  }
  clamp_.record(applied_, applied, applied_);
  const Eigen::Index n = applied_.size();
  const std::int64_t period = settings_.dither.period;
  const std::int64_t phase = seen_ % period;
  for (Eigen::Index i = 0; i < n; ++i)
    window_[static_cast<std::size_t>(phase * n + i)] = applied[i];
  ++seen_;
  if (phase + 1 == period) clamp_.close_window();
  if (seen_ >= period) {
    estimate_.setZero();
    for (std::int64_t k = 0; k < period; ++k) {
      for (Eigen::Index i = 0; i < n; ++i)
        estimate_[i] += window_[static_cast<std::size_t>(k * n + i)];
    }
    estimate_ /= static_cast<double>(period);
  }
  const double phase_per_j = kappa().value_or(0.0);
  const Inputs largest = settings_.dither.amplitude.cwiseProduct(omega_);
  Inputs step(n);
  for (Eigen::Index i = 0; i < n; ++i)
    step[i] = largest[i] * std::cos(omega_[i] * static_cast<double>(phase) - phase_per_j * j);
  const Inputs none = Inputs::Zero(n);
  step = filter_.project(applied_, step, {settings_.space, none, none, largest, largest, metric_});
  move_within(applied_, step, settings_.space, none, clamp_, largest);
}

// The oscillation and the window behind the mean move along.
void BoundedSeeking::shift_estimate(const Inputs& by) noexcept {
  const Inputs none = Inputs::Zero(by.size());
  move_within(estimate_, by, settings_.space, none);
  move_within(applied_, by, settings_.space, none);
  Eigen::Map<Eigen::MatrixXd> window(window_.data(), by.size(), settings_.dither.period);
  window.colwise() += Eigen::VectorXd::Map(by.data(), by.size());
}

}  // namespace mgdd::optimize
