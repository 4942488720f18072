#include "mgdd/optimize/laws/extremum_seeking.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double limit_memory_windows = 2.0;
constexpr double share_rate = 0.25;          // how fast the amplitude follows its target, per window
constexpr double own_periods = 4.0;          // time constant of the seeker's own gain
constexpr double dither_unseen_bend = 0.17;  // |J''| A^2 over the noise: 0.051 for an amplitude of 1 and noise of 0.3

ExtremumSeekingSettings checked(ExtremumSeekingSettings s) {
  const Eigen::Index n = s.space.size();
  if (n < 1) throw about("start", ShapeError("start is empty: give one number per input"));
  s.space = resolved(std::move(s.space));
  s.dither.amplitude = or_scaled(std::move(s.dither.amplitude), 1.0, s.space);
  validate(s.dither, n);
  validate(s.space, s.dither.amplitude);
  validate(s.components);
  if (s.gain.size() > 0) validate_entries("gain", s.gain, n, 0.0, 1e300);
  if (s.recovery_rate.size() == 0) s.recovery_rate = s.rate.size() == 0 ? s.dither.amplitude : s.rate;
  if (s.rate.size() == 0) {
    s.rate = s.dither.amplitude * ((s.form == MeanRemoval::batch ? 1.0 : 3.0) / s.dither.period);
  }
  validate_entries("rate", s.rate, n, 0.0);
  validate_entries("recovery_rate", s.recovery_rate, n, 0.0);
  s.rate = within_rates(std::move(s.rate), s.space);
  s.recovery_rate = within_rates(std::move(s.recovery_rate), s.space);
  const auto inside = [](std::string_view name, double value, double lower, double upper) {
    if (!(value > lower && value <= upper)) {
      throw ParameterError(name, value, "must be > " + text(lower) + " and <= " + text(upper));
    }
  };
  if (!(s.washout_pole > 0.0 && s.washout_pole < 1.0)) {
    throw ParameterError("washout_pole", s.washout_pole, "must lie between 0 and 1");
  }
  inside("low_pass", s.low_pass, 0.0, 1.0);
  inside("amplitude_floor", s.amplitude_floor, 0.0, 1.0);
  inside("limit_amplitude", s.limit_amplitude, 0.0, 1.0);
  if (!std::isfinite(s.full_gradient) || (s.amplitude_floor < 1.0 && !(s.full_gradient > 0.0))) {
    throw ParameterError(
        "full_gradient", s.full_gradient,
        "must be finite, and > 0 where amplitude_floor is below 1: the slope at which the dither is full");
  }
  if (!s.hold_cycles) s.hold_cycles = s.dither.period;
  if (*s.hold_cycles < 0) {
    throw ParameterError("hold_cycles", *s.hold_cycles, "must be >= 0; leave it out for one window");
  }
  validate_curvature(s.curvature);
  return s;
}

}  // namespace

std::vector<std::string> ExtremumSeekingSettings::advice() const {
  std::vector<std::string> out;
  if (!curvature || *curvature == 0.0) return out;
  const Inputs amplitude = or_scaled(dither.amplitude, 1.0, space);
  const double windows = form == MeanRemoval::batch ? 1.0 : 2.0;  // a batch at tau = M steps straight to the optimum
  for (Eigen::Index i = 0; i < gain.size(); ++i) {
    const double bound = 2.0 / (amplitude[i] * std::abs(*curvature) * windows * dither.period);
    if (!(gain[i] > bound * (1.0 + 1e-12))) continue;
    out.push_back("gain = " + text(gain[i]) + " is above " + text(bound) + ", the bound of averaging: with it tau = " +
                  text(2.0 / (gain[i] * amplitude[i] * std::abs(*curvature))) + " cycles is below " +
                  text(windows * dither.period) + (windows > 1.0 ? " (two periods)" : " (one period)") +
                  "; lower the gain or the period");
  }
  return out;
}

ExtremumSeeking::ExtremumSeeking(ExtremumSeekingSettings settings)
    : SeekerCore(checked(std::move(settings)),
                 [](const ExtremumSeekingSettings& s) { return limit_memory_windows * s.dither.period; }),
      dither_(settings_.dither, settings_.components),
      first_(settings_.dither.amplitude, dither_unseen_bend, settings_.gain.size() == 0, settings_.curvature,
             settings_.components),
      last_(settings_.components, limit_count()),
      gradient_(Inputs::Zero(estimate_.size())),
      held_(settings_.hold_cycles.value_or(0)),
      mean_(component_count(), 0.0),
      sum_(gradient_),
      smooth_(gradient_),
      slow_(gradient_),
      origin_(component_count(), 0.0) {
  if (settings_.form == MeanRemoval::moving_average) {
    window_.assign(component_count() * static_cast<std::size_t>(settings_.dither.period), 0.0);
  }
}

Inputs ExtremumSeeking::gain() const noexcept {
  if (settings_.gain.size() > 0) return settings_.gain;
  if (first_.open()) return {};
  const double tau = own_periods * settings_.dither.period;
  return (2.0 / tau) * settings_.dither.amplitude.cwiseProduct(first_.bend()).cwiseInverse();
}

const Inputs& ExtremumSeeking::ask() noexcept {
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

// Fills gradient_ (smoothed) with this cycle's demodulated reading; false until the mean of a period is known.
bool ExtremumSeeking::remove_mean(const Reading& reading, const Inputs& applied) noexcept {
  const auto period = static_cast<std::size_t>(dither_.period());
  const double shaped = filter_.shaping(applied, reading.limits);
  Inputs product = Inputs::Zero(estimate_.size());
  for (std::size_t c = 0; c < component_count(); ++c) {
    const double j = sign() * reading.components[c] + (c == 0 ? shaped : 0.0);
    double e = 0.0;
    if (settings_.form == MeanRemoval::moving_average) {
      double* const ring = &window_[c * period];
      ring[static_cast<std::size_t>(seen_) % period] = j;
      double sum = 0.0;  // afresh every cycle: a running sum would drift
      for (std::size_t k = 0; k < period; ++k)
        sum += ring[k];
      e = j - sum / static_cast<double>(period);
    } else {
      if (seen_ == 0) mean_[c] = j;
      e = j - mean_[c];
      mean_[c] += (1.0 - settings_.washout_pole) * e;
    }
    for (Eigen::Index i = 0; i < product.size(); ++i)
      product[i] += e * dither_.demodulation(static_cast<int>(phase_), c, i);
  }
  if (settings_.form == MeanRemoval::moving_average && seen_ + 1 < dither_.period()) return false;
  smooth_ += settings_.low_pass * (product - smooth_);
  slow_ += (smooth_ - slow_) / static_cast<double>(period);
  return true;
}

void ExtremumSeeking::move(Inputs step, const Inputs& rate) noexcept {
  const Inputs& a = settings_.dither.amplitude;
  const Inputs metric = first_.open() ? Inputs(a.cwiseAbs2()) : Inputs(gain().cwiseProduct(a));  // of slopes to steps
  step = filter_.project(
      estimate_, step,
      {settings_.space, a, clamp_.reach(a * share_), rate, settings_.recovery_rate, InputMatrix(metric.asDiagonal())});
  if (filter_.active()) ++limited_cycles_;
  move_within(estimate_, step, settings_.space, settings_.dither.amplitude, clamp_);
}

void ExtremumSeeking::learn_from(const Reading& reading, const Inputs& applied) noexcept {
  if (first_.open()) {
    double j = filter_.shaping(applied, reading.limits);
    for (const double c : reading.components)
      j += sign() * c;
    first_.learn(applied, j);
    if (filter_.alarmed()) move(Inputs::Zero(applied.size()), settings_.recovery_rate);
    return;
  }
  clamp_.record(applied_, applied, estimate_);
  const Inputs& a = settings_.dither.amplitude;
  const double period = dither_.period();
  const Inputs no_step = Inputs::Zero(estimate_.size());
  if (held_ > 0) --held_;
  const bool holding = held_ > 0;  // in the next cycle: after the last held one the estimate may move
  bool moved_by_alarm = false;

  if (settings_.form == MeanRemoval::batch) {
    if (phase_ == 0) {
      sum_.setZero();
      std::copy(reading.components.begin(), reading.components.end(), origin_.begin());
    }
    const double shaped = filter_.shaping(applied, reading.limits);
    for (std::size_t c = 0; c < component_count(); ++c) {
      const double j = sign() * (reading.components[c] - origin_[c]) + (c == 0 ? shaped : 0.0);
      for (Eigen::Index i = 0; i < sum_.size(); ++i)
        sum_[i] += j * dither_.demodulation(static_cast<int>(phase_), c, i);
    }
  } else if (remove_mean(reading, applied)) {
    gradient_ = (smooth_.cwiseQuotient(a) * (2.0 / share_)).cwiseProduct(clamp_.slope_factor());
    if (!holding) {
      // A limit passes what points inwards and turns the rest: of a ripple that would leave a bias.
      const Inputs& seen = filter_.active() ? slow_ : smooth_;
      move(gain().cwiseProduct(seen).cwiseProduct(clamp_.step_factor()) * share_, settings_.rate);
      moved_by_alarm = true;
    }
  }
  if (!moved_by_alarm && filter_.alarmed()) {
    const Inputs before = estimate_;
    move(no_step, settings_.recovery_rate);
    if (settings_.form == MeanRemoval::batch && (estimate_ - before).squaredNorm() > 0.0) {
      phase_ = 0;  // the window has lost its held estimate: begin it anew
      ++seen_;
      return;
    }
  }
  ++seen_;
  if (++phase_ < dither_.period()) return;
  phase_ = 0;
  // The steps take the slope against what is asked, which fades where the plant does not follow; `gradient` tells it
  // against what is applied: the regression on the part of the dither that arrives.
  clamp_.close_window(a.cwiseAbs2() * (0.5 * period * share_ * share_));
  if (settings_.form == MeanRemoval::batch) {
    gradient_ = (sum_ * (2.0 / (period * share_))).cwiseQuotient(a);
    if (!holding) {  // the mean rate of the continuous form: M g_r A/2 times the slope, smaller with a smaller dither
      const Inputs slope = gradient_.cwiseProduct(clamp_.step_factor());
      move(gain().cwiseProduct(a).cwiseProduct(slope) * (0.5 * period * share_ * share_), settings_.rate * period);
    }
    gradient_ = gradient_.cwiseProduct(clamp_.slope_factor());
  }
  end_of_window();
}

void ExtremumSeeking::end_of_window() noexcept {
  double target = 1.0;
  if (settings_.amplitude_floor < 1.0) {
    target = std::clamp(gradient_.cwiseAbs().maxCoeff() / settings_.full_gradient, settings_.amplitude_floor, 1.0);
  }
  const auto decisions = settings_.form == MeanRemoval::batch ? std::int64_t{1} : dither_.period() / 2;
  if (limited_cycles_ >= decisions) target = std::min(target, settings_.limit_amplitude);
  limited_cycles_ = 0;
  share_ += share_rate * (target - share_);
}

void ExtremumSeeking::restart() noexcept {
  seen_ = 0;
  phase_ = 0;
  held_ = settings_.hold_cycles.value_or(0);
  share_ = 1.0;
  smooth_.setZero();
  slow_.setZero();
  sum_.setZero();
  limited_cycles_ = 0;
  first_.restart();
  last_.forget();
  forget();
}

}  // namespace mgdd::optimize
