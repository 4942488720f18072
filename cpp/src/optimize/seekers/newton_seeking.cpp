#include "mgdd/optimize/seekers/newton_seeking.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double newton_unseen_bend = 0.68;  // |J''| A^2 over the noise: 0.051 for an amplitude of 2 and noise of 0.3
constexpr double own_amplitude = 2.0;        // in scales of the inputs
constexpr double own_reach = 5.0;            // bound of |Gamma| over the first one

NewtonSeekingSettings checked(NewtonSeekingSettings s) {
  const Eigen::Index n = s.space.size();
  if (n < 1) throw about("start", ShapeError("start is empty: give one number per input"));
  s.space = resolved(std::move(s.space));
  s.dither.amplitude = or_scaled(std::move(s.dither.amplitude), own_amplitude, s.space);
  validate(s.dither, n, true);
  validate(s.space, s.dither.amplitude);
  validate(s.components);
  if (s.rate.size() == 0) s.rate = s.dither.amplitude * (3.0 / s.dither.period);
  validate_entries("rate", s.rate, n, 0.0);
  s.rate = within_rates(std::move(s.rate), s.space);
  for (const auto& [name, value, upper] :
       {std::tuple{"time_constant_cycles", s.time_constant_cycles, 1e9},
        std::tuple{"hessian_rate", s.hessian_rate, 1.0}, std::tuple{"riccati_rate", s.riccati_rate, 1.0},
        std::tuple{"largest_inverse", s.largest_inverse.value_or(1.0), 1e300},
        std::tuple{"limit_amplitude", s.limit_amplitude, 1.0}}) {
    if (!(value > 0.0 && value <= upper)) {
      throw ParameterError(name, value, "must be > 0 and <= " + text(upper));
    }
  }
  for (const auto& [name, values] :
       {std::pair{"initial_hessian", &s.initial_hessian}, std::pair{"initial_inverse", &s.initial_inverse}}) {
    if (values->size() != n && values->size() > 0) {
      throw about(name, ShapeError(std::string(name) + " has " + std::to_string(values->size()) +
                                   " entries: must have " + std::to_string(n) + ", one per entry of start"));
    }
    for (const double value : *values) {
      if (!(value < 0.0 && std::isfinite(value))) {
        throw ParameterError(name, value, "must be < 0, as at a maximum");
      }
    }
  }
  if (s.initial_hessian.size() == 0 && s.initial_inverse.size() > 0) {
    s.initial_hessian = s.initial_inverse.cwiseInverse();
  }
  if (s.initial_inverse.size() == 0 && s.initial_hessian.size() > 0) {
    s.initial_inverse = s.initial_hessian.cwiseInverse();
  }
  if (!s.largest_inverse && s.initial_inverse.size() > 0) {
    s.largest_inverse = own_reach * s.initial_inverse.cwiseAbs().maxCoeff();
  }
  if (s.hold_cycles < s.dither.period) {
    throw ParameterError("hold_cycles", s.hold_cycles,
                         "must be at least one period = " + std::to_string(s.dither.period));
  }
  return s;
}

}  // namespace

std::vector<std::string> NewtonSeekingSettings::advice() const {
  if (time_constant_cycles >= 2.0 * dither.period) return {};
  return {"time_constant_cycles = " + text(time_constant_cycles) + " is below " + text(2.0 * dither.period) +
          " (2 periods), the bound of averaging"};
}

NewtonSeeking::NewtonSeeking(NewtonSeekingSettings settings)
    : SeekerCore(checked(std::move(settings)), [](const NewtonSeekingSettings& s) { return 2.0 * s.dither.period; }),
      dither_(settings_.dither, settings_.components, true),
      first_(settings_.dither.amplitude, newton_unseen_bend, settings_.initial_hessian.size() == 0, {},
             settings_.components),
      last_(settings_.components, limit_count()),
      gradient_(Inputs::Zero(estimate_.size())),
      slow_(gradient_),
      hessian_(InputMatrix::Zero(estimate_.size(), estimate_.size())),
      inverse_(hessian_),
      held_(settings_.hold_cycles),
      window_(component_count() * static_cast<std::size_t>(settings_.dither.period), 0.0) {
  if (first_.open()) return;
  hessian_.diagonal() = settings_.initial_hessian;
  inverse_.diagonal() = settings_.initial_inverse;
}

const Inputs& NewtonSeeking::ask() noexcept {
  if (first_.open()) {
    applied_ = first_.ask(estimate_);
    return send();
  }
  for (Eigen::Index i = 0; i < estimate_.size(); ++i) {
    applied_[i] =
        estimate_[i] + share_ * settings_.dither.amplitude[i] * dither_.perturbation(static_cast<int>(phase_), i);
  }
  return send();
}

TellStatus NewtonSeeking::tell(const Reading& reading) noexcept {
  const TellStatus status =
      take_late(reading, first_, last_, [&](const Reading& read, const Inputs& applied) { learn(read, applied); });
  look_back(*this, first_.open());
  return status;
}

double NewtonSeeking::largest_inverse() const noexcept {
  return settings_.largest_inverse ? *settings_.largest_inverse : own_reach / first_.bend().minCoeff();
}

// Gamma stays negative definite and bounded: an update that would leave that set is not made.
void NewtonSeeking::update_inverse() noexcept {
  const double largest = largest_inverse();
  InputMatrix next = inverse_ + settings_.riccati_rate * (inverse_ - inverse_ * hessian_ * inverse_);
  if (next.size() == 1) {
    inverse_(0, 0) = std::clamp(next(0, 0), -largest, -largest * 1e-6);
    return;
  }
  next = (0.5 * (next + next.transpose())).eval();
  const Eigen::LLT<InputMatrix> factor(-next);
  if (factor.info() == Eigen::Success && next.norm() <= largest) inverse_ = next;
}

void NewtonSeeking::learn(const Reading& reading, const Inputs& applied) noexcept {
  if (first_.open()) {
    first_.learn(applied, objective_of(reading, settings_.maximize) + filter_.shaping(applied, reading.limits));
    if (!first_.open()) {
      hessian_.diagonal() = -first_.bend();
      inverse_.diagonal() = -first_.bend().cwiseInverse();
    }
    return;
  }
  clamp_.record(applied_, applied, estimate_);
  const auto period = static_cast<std::size_t>(dither_.period());
  const Eigen::Index n = estimate_.size();
  const Inputs a = settings_.dither.amplitude * share_;
  const double shaped = filter_.shaping(applied, reading.limits);
  Inputs gradient = Inputs::Zero(n);
  InputMatrix sample = InputMatrix::Zero(n, n);
  for (std::size_t c = 0; c < component_count(); ++c) {
    const double j = (settings_.maximize ? 1.0 : -1.0) * reading.components[c] + (c == 0 ? shaped : 0.0);
    double* const ring = &window_[c * period];
    ring[static_cast<std::size_t>(seen_) % period] = j;
    double sum = 0.0;
    for (std::size_t k = 0; k < period; ++k)
      sum += ring[k];
    const double e = j - sum / static_cast<double>(period);
    for (Eigen::Index i = 0; i < n; ++i) {
      gradient[i] += 2.0 / a[i] * e * dither_.demodulation(static_cast<int>(phase_), c, i);
      for (Eigen::Index k = 0; k < n; ++k)
        sample(i, k) += e / (a[i] * a[k]) * dither_.curvature_demodulation(static_cast<int>(phase_), c, i, k);
    }
  }
  const bool full = seen_ + 1 >= dither_.period();
  if (held_ > 0) --held_;
  const bool holding = held_ > 0;  // in the next cycle: after the last held one the estimate may move
  Inputs step = Inputs::Zero(n);
  if (full) {
    gradient_ = gradient;
    slow_ += (gradient - slow_) / static_cast<double>(period);
    if (!clamp_.distorted()) {  // a dither that does not arrive bends whatever it measures
      hessian_ += settings_.hessian_rate * (sample - hessian_);
      update_inverse();
    }
    // A limit passes what points inwards and turns the rest: of a ripple that would leave a bias.
    if (!holding) {
      const Inputs slope = (filter_.active() ? slow_ : gradient).cwiseProduct(clamp_.step_factor());
      step = inverse_ * slope * (-1.0 / settings_.time_constant_cycles);
    }
  }
  if ((full && !holding) || filter_.alarmed()) {
    const Inputs& margin = settings_.dither.amplitude;
    const Inputs reach = clamp_.reach(a);
    step =
        filter_.project(estimate_, step, {settings_.space, margin, reach, settings_.rate, settings_.rate, -inverse_});
    if (filter_.active()) ++limited_cycles_;
    move_within(estimate_, step, settings_.space, settings_.dither.amplitude, clamp_, Inputs::Zero(step.size()));
  }
  ++seen_;
  if (++phase_ < dither_.period()) return;
  phase_ = 0;
  clamp_.close_window(a.cwiseAbs2() * (0.5 * dither_.period()));
  const double target = limited_cycles_ >= dither_.period() / 2 ? settings_.limit_amplitude : 1.0;
  share_ += 0.25 * (target - share_);
  limited_cycles_ = 0;
}

// Of first readings one of which bent the Hessian.
void NewtonSeeking::begin_anew() noexcept {
  restart();
  held_ = settings_.hold_cycles;
  hessian_.setZero();
  inverse_.setZero();
  hessian_.diagonal() = settings_.initial_hessian;
  inverse_.diagonal() = settings_.initial_inverse;
}

void NewtonSeeking::restart() noexcept {
  seen_ = 0;
  phase_ = 0;
  held_ = dither_.period();
  share_ = 1.0;
  limited_cycles_ = 0;
  slow_.setZero();
  first_.restart();
  last_.forget();
  forget();
}

}  // namespace mgdd::optimize
