#include "mgdd/control/guided_predictive.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mgdd/control/slow_trim.hpp"
#include "mgdd/dynamics/lag.hpp"

namespace mgdd::control {
namespace {

constexpr double dead_band_deg = 0.3;         // of the measured side of limp-home
constexpr double end_deg = 0.5;               // a stop holds the plate there: nothing is learnt
constexpr double slow_deg_per_s = 6.0;        // below it the plate may stick
constexpr double slow_deviations = 2.5;       // or below so many standard deviations of what noise does to the speed
constexpr double hold_rate_deg_per_s = 2.0;   // a faster reference is followed, not waited for
constexpr double hold_from_deviations = 2.0;  // of the noise: a smaller error is left as it is
constexpr double hold_to_deviations = 4.3;    // until its mean is larger
constexpr int rest_samples = 3;               // slow in a row: the plate is stuck
constexpr std::int64_t mean_samples = 8;      // behind that mean
constexpr double breakaway_margin = 0.015;    // duty beyond the friction level
constexpr double hold_share = 0.3;            // of the friction band that a held duty may use
constexpr double hold_duty_per_s = 2.0;       // how fast it goes there
constexpr double release_duty_per_s = 20.0;   // and at a stop, where it only heats the motor
constexpr double lead_s = 0.01;               // of the reference in the wanted direction
constexpr double feed_forward_deg = 0.25;     // error at which a linear prediction feeds all friction forward
constexpr double largest_bias = 0.4;          // of the form without learning

PlateFriction friction_form(const GuidedPredictiveSettings& s) noexcept {
  if (s.prediction == Prediction::linear) return PlateFriction::none;
  return s.friction_learning ? PlateFriction::set_valued : PlateFriction::creeping;
}

const GuidedPredictiveSettings& checked(const GuidedPredictiveSettings& settings) {
  validate(settings);
  return settings;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

template <class T>
PlateBelief<double> widened(const PlateBelief<T>& b) noexcept {
  const auto band = [](const FrictionBand<T>& from) {
    return FrictionBand<double>{static_cast<double>(from.bias), static_cast<double>(from.friction)};
  };
  return {band(b.above), band(b.below), static_cast<double>(b.gain_factor), static_cast<double>(b.damping_factor)};
}

// The errors of angle and speed die as those of s^2 + a s + b = 0 at any sample time: poles z = exp(s T), of which
// 1 - z1 z2 is the share of the angle and (1 - z1)(1 - z2) / T the gain of the speed (Åström and Wittenmark 1997, 4.4).
double speed_gain_of(const GuidedPredictiveSettings& s) noexcept {
  const double half = 0.5 * s.observer_angle_per_s * s.sample_s;
  const double apart = half * half - s.observer_speed_per_s2 * s.sample_s * s.sample_s;
  const double shape =
      apart > 0.0 ? std::cosh(std::sqrt(apart)) : std::cos(std::min(std::sqrt(-apart), std::numbers::pi));
  return (1.0 - 2.0 * std::exp(-half) * shape + std::exp(-2.0 * half)) / s.sample_s;
}

// A bank only where the members learn: beliefs that stand still do not tell delays apart.
int delays_of(const GuidedPredictiveSettings& s) noexcept {
  return s.friction_learning ? 1 + std::min(s.delay_search_samples, longest_control_delay - s.delay_samples) : 1;
}

template <class T>
std::array<PlateObserver<T>, most_delays> alike(const PlateObserver<T>& one) noexcept {
  return {one, one, one, one, one, one, one};
}

}  // namespace

template <class T>
BasicGuidedPredictive<T>::BasicGuidedPredictive(const GuidedPredictiveSettings& s)
    : settings_(checked(s)),
      observed_(s.plate, s.sample_s, PlateFriction::set_valued),
      predicted_(s.plate, s.prediction_step_s, friction_form(s)),
      proven_(observed_),
      gains_{static_cast<T>(1.0 - std::exp(-s.observer_angle_per_s * s.sample_s)), static_cast<T>(speed_gain_of(s)),
             T(s.plate.closed_deg), T(s.plate.open_deg)},
      slow_(static_cast<T>(std::max(slow_deg_per_s, slow_deviations * speed_gain_of(s) * s.noise_deg))),
      bank_(delays_of(s), s.sample_s, s.noise_deg),
      members_(alike(PlateObserver<T>{.belief = observed_.belief(),
                                      .learner = FrictionLearner<T>(s.learner, s.plate, s.sample_s, s.noise_deg,
                                                                    gains_.angle_share, gains_.speed_gain)})),
      review_(s.review, s.sample_s, s.noise_deg),
      reference_(s.reference.lag_s, s.sample_s, s.reference.jump_deg_per_s) {}

template <class T>
void BasicGuidedPredictive<T>::start(T angle_deg, T duty) noexcept {
  started_ = true;
  prepared_ = true;  // nothing acted before this sample
  holds_ = false;
  still_ = 0;
  above_ = !(angle_deg < T(settings_.plate.spring.limp_home_deg));
  proven_state_ = observed_.at_rest(angle_deg, duty);
  for (PlateObserver<T>& member : members_)
    member.start(proven_state_);
  bank_.restart();
  duty_ = duty;
  sent_.fill(duty);
  moves_.fill(duty);
  mean_error_ = trim_ = T(0.0);
  review_.restart();
}

template <class T>
void BasicGuidedPredictive<T>::prepare() noexcept {
  if (!started_ || prepared_) return;
  auto delay = static_cast<std::size_t>(settings_.delay_samples);
  for (PlateObserver<T>& member : members())
    member.predict(observed_, sent_.before[delay++]);
  if (settings_.friction_learning) proven_.step(proven_state_, sent_.before[static_cast<std::size_t>(delay_samples())]);
  prepared_ = true;
}

// Whether what was learnt was given up for the certified belief, whose innovation this is.
template <class T>
bool BasicGuidedPredictive<T>::review(T innovation, bool slides) noexcept {
  if (!slides) return false;
  const Verdict verdict = review_.judge(now().innovation, innovation);
  if (verdict == Verdict::keep) return false;
  review_.restart();
  if (verdict == Verdict::certify) {
    proven_.believe(now().belief);
    proven_state_ = now().state;
    return false;
  }
  now().belief = proven_.belief();
  now().state = proven_state_;
  now().innovation = innovation;
  now().learner.reset();
  ++rollbacks_;
  return true;
}

template <class T>
void BasicGuidedPredictive<T>::correct(T measurement_deg) noexcept {
  const GuidedPredictiveSettings& s = settings_;
  std::array<T, most_delays> innovations{};
  std::size_t j = 0;
  for (PlateObserver<T>& member : members()) {
    member.correct(gains_, measurement_deg);
    innovations[j++] = member.innovation;
  }
  if (!s.friction_learning) {
    const T step = T(s.bias_rate_per_deg_s * s.sample_s) * now().innovation;
    for (FrictionBand<T>* band : {&now().belief.above, &now().belief.below})
      band->bias = std::clamp(band->bias - step, T(-largest_bias), T(largest_bias));
    return;
  }
  const bool slides = now().predicted.speed_deg_per_s != T(0.0) || proven_state_.speed_deg_per_s != T(0.0);
  const T proven_innovation = gains_.correct(proven_state_, measurement_deg);
  const auto stopped = [&](T angle) {
    return angle < T(s.plate.closed_deg + end_deg) || angle > T(s.plate.open_deg - end_deg);
  };
  const bool rolled_back = !stopped(now().predicted.angle_deg) && review(proven_innovation, slides);
  for (PlateObserver<T>& member : members()) {
    if (!(rolled_back && &member == &now())) member.learn(observed_, stopped(member.predicted.angle_deg));
  }
  if (!bank_.judge(innovations)) return;
  // What the wrong delay taught is not gone back to.
  proven_.believe(now().belief);
  proven_state_ = now().state;
  review_.restart();
}

template <class T>
void BasicGuidedPredictive<T>::look_ahead(T measurement_deg, std::span<const T> preview_deg) noexcept {
  const GuidedPredictiveSettings& s = settings_;
  observed_.believe(now().belief);
  horizon_.ahead = now().state;
  for (int i = delay_samples() - 1; i >= 0; --i)
    observed_.step(horizon_.ahead, sent_.before[static_cast<std::size_t>(i)]);
  const T room = T(s.duty_rate_per_s * s.sample_s);
  horizon_.before = sent_.before[0];
  horizon_.acting = duty_;
  horizon_.lowest = std::max(T(s.duty.lower), sent_.before[0] - room);
  horizon_.highest = std::min(T(s.duty.upper), sent_.before[0] + room);
  const T per_step = T(s.prediction_step_s / s.sample_s);
  const T dead = T(s.sample_s) * T(delay_samples() - 1);  // the angle of the next sample belongs to this reference
  T last = reference_.value();
  std::size_t read = 0;
  for (int k = 0; k < settings_.n_steps(); ++k) {
    T target = reference_.value() + reference_.rate() * (dead + T(s.prediction_step_s) * T(k + 1));
    if (!preview_deg.empty()) {
      const auto wanted = static_cast<std::size_t>(T(delay_samples()) + per_step * T(k + 1));
      for (; read < std::min(wanted, preview_deg.size()) && std::isfinite(preview_deg[read]); ++read)
        last = preview_deg[read];
      target = last;
    }
    horizon_.target[static_cast<std::size_t>(k)] = target;
  }
  // Where the plate should be soon: it leaves rest for that, and breaks away towards it.
  const auto soon =
      static_cast<std::size_t>(std::min(settings_.n_steps(), static_cast<int>(lead_s / s.prediction_step_s)));
  horizon_.aim = preview_deg.empty() || soon == 0 ? reference_.value() : horizon_.target[soon - 1];
  horizon_.wanted = horizon_.aim - horizon_.ahead.angle_deg;
  if (preview_deg.empty()) horizon_.wanted += T(lead_s) * reference_.rate();
  if (!std::isfinite(measurement_deg)) return;
  const T away = measurement_deg - T(s.plate.spring.limp_home_deg);
  if (std::abs(away) > T(dead_band_deg)) above_ = away > T(0.0);
}

// Whether the plate is stuck near enough to the reference to be left there; moves the duty inside the friction band.
template <class T>
bool BasicGuidedPredictive<T>::hold_still() noexcept {
  const GuidedPredictiveSettings& s = settings_;
  const T error = horizon_.aim - horizon_.ahead.angle_deg, rate = reference_.rate();
  const bool slow = std::abs(horizon_.ahead.speed_deg_per_s) < slow_;
  still_ = slow ? still_ + 1 : 0;
  const bool rests = still_ >= rest_samples;
  mean_error_ = still_ <= 1 ? error : mean_error_ + (error - mean_error_) / T(std::min(still_, mean_samples));
  if (std::abs(rate) >= T(hold_rate_deg_per_s)) {
    holds_ = false;
  } else if (holds_) {
    holds_ = rests && std::abs(mean_error_) <= T(hold_to_deviations * s.noise_deg);
  } else {
    holds_ = rests && std::abs(error) < T(hold_from_deviations * s.noise_deg);
  }
  if (!holds_) return false;
  const T angle = horizon_.ahead.angle_deg;
  const FrictionBand<T>& band = observed_.band_at(angle);
  const T middle = observed_.holding(angle) + band.bias, half = T(hold_share) * band.friction;
  const bool stopped = angle < T(s.plate.closed_deg + end_deg) || angle > T(s.plate.open_deg - end_deg);
  const T most = T((stopped ? release_duty_per_s : hold_duty_per_s) * s.sample_s);
  const T wanted = std::clamp(sent_.before[0], middle - half, middle + half);
  moves_.fill(std::clamp(std::clamp(wanted, sent_.before[0] - most, sent_.before[0] + most), horizon_.lowest,
                         horizon_.highest));
  return true;
}

// A stuck plate has no slope: the first duty is at least the one that frees it.
template <class T>
void BasicGuidedPredictive<T>::break_away() noexcept {
  if (!settings_.friction_learning || !(std::abs(horizon_.ahead.speed_deg_per_s) < slow_)) return;
  const auto duty = observed_.breakaway(horizon_.ahead);
  if (horizon_.wanted > T(0.0)) moves_[0] = std::max(moves_[0], duty.up + T(breakaway_margin));
  if (horizon_.wanted < T(0.0)) moves_[0] = std::min(moves_[0], duty.down - T(breakaway_margin));
  moves_[0] = std::clamp(moves_[0], horizon_.lowest, horizon_.highest);
}

template <class T>
T BasicGuidedPredictive<T>::step(T reference_deg, T measurement_deg, std::span<const T> preview_deg) noexcept {
  prepare();
  return feedback(reference_deg, measurement_deg, preview_deg);
}

template <class T>
T BasicGuidedPredictive<T>::feedback(T reference_deg, T measurement_deg, std::span<const T> preview_deg) noexcept {
  const GuidedPredictiveSettings& s = settings_;
  reference_.step(reference_deg);
  if (!started_) {
    if (!std::isfinite(measurement_deg) || !reference_.started()) return duty_;
    const T room = T(s.duty_rate_per_s * s.sample_s);
    start(measurement_deg, std::clamp(observed_.holding(measurement_deg), std::max(T(s.duty.lower), -room),
                                      std::min(T(s.duty.upper), room)));
    prepared_ = false;
    return duty_;
  }
  prepare();
  prepared_ = false;
  if (std::isfinite(measurement_deg)) correct(measurement_deg);
  look_ahead(measurement_deg, preview_deg);
  if (!(s.friction_learning && hold_still())) {
    PlateBelief<T> belief = now().belief;
    if (s.prediction == Prediction::linear) {
      const T share = limited_share(horizon_.wanted, T(feed_forward_deg));
      belief.above.bias += share * belief.above.friction;
      belief.below.bias += share * belief.below.friction;
    }
    if (s.prediction == Prediction::linear || s.switching == SideSwitching::measured) predicted_.freeze_side(above_);
    predicted_.believe(belief);
    break_away();
    for (int i = 0; i < s.gauss_newton_steps; ++i) {
      if (!gauss_newton()) break;
    }
    break_away();
  }
  sent_.push(sent_.before[0]);  // the place of this sample's duty
  if (!s.friction_learning) {
    trim_ = trimmed(trim_, reference_.value() - measurement_deg, s.trim_rate_per_deg_s, s.sample_s);
  }
  return send();
}

template <class T>
T BasicGuidedPredictive<T>::refine() noexcept {
  if (!started_ || holds_) return duty_;
  gauss_newton();
  break_away();
  return send();
}

// The trim stays out of the model: told, the model takes it for a disturbance, and sines are followed 5 to 20 % worse.
template <class T>
T BasicGuidedPredictive<T>::send() noexcept {
  sent_.before[0] = moves_[0];
  const T room = T(settings_.duty_rate_per_s * settings_.sample_s);
  duty_ = std::clamp(settings_.duty.clamp(moves_[0] + trim_), horizon_.acting - room, horizon_.acting + room);
  return duty_;
}

template <class T>
void BasicGuidedPredictive<T>::set_sent(T duty) noexcept {
  if (started_) correct_sent(sent_, duty_, settings_.duty, duty);
}

template <class T>
void BasicGuidedPredictive<T>::reset() noexcept {
  started_ = prepared_ = holds_ = false;
  above_ = true;
  still_ = 0;
  bank_.reset();
  PlateObserver<T>& first = members_[0];
  first.start({});
  first.belief.above = first.belief.below = {T(0.0), T(settings_.plate.friction)};
  first.belief.gain_factor = first.belief.damping_factor = T(1.0);
  first.learner.reset();
  members_ = alike(first);
  proven_.believe(first.belief);
  proven_state_ = {};
  rollbacks_ = 0;
  review_.restart();
  reference_.forget();
  sent_.fill(T(0.0));
  moves_.fill(T(0.0));
  mean_error_ = trim_ = duty_ = T(0.0);
  horizon_ = {};
}

template <class T>
void BasicGuidedPredictive<T>::take_over(T measurement_deg, T duty) noexcept {
  if (!std::isfinite(measurement_deg) || !std::isfinite(duty)) return;
  reference_.start(measurement_deg);
  start(measurement_deg, settings_.duty.clamp(duty));
}

template <class T>
void BasicGuidedPredictive<T>::set_belief(const PlateBelief<T>& belief) {
  require_usable_belief(widened(belief), settings_);
  for (PlateObserver<T>& member : members_) {
    member.belief = belief;
    member.learner.reset();
  }
  proven_.believe(belief);
  review_.restart();
}

template <class T>
void BasicGuidedPredictive<T>::require_usable() const {
  require_usable_duty(duty_, settings_.duty);
  for (const PlateObserver<T>& member : members_)
    require_usable_belief(widened(member.belief), settings_);
  require_usable_belief(widened(proven_.belief()), settings_, "certified_");
  if (!std::ranges::all_of(members_, [](const auto& member) { return member.learner.is_usable(); })) {
    fail(ParameterError("state column 'slope_level_variance'", "a covariance outside what these settings can reach",
                        "must be the saved state of a controller with the same settings"));
  }
}

template class BasicGuidedPredictive<double>;
template class BasicGuidedPredictive<float>;

}  // namespace mgdd::control
