#include "mgdd/guide/curve_seeking.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::guide {
namespace {

using optimize::Inputs;
using optimize::Reading;
using optimize::scalar_input;
using optimize::TellStatus;

constexpr double prior_share = 0.25;       // of the bounds
constexpr double amplitude_share = 0.25;   // of prior_sd: the farthest a reading is taken from the estimate
constexpr double limit_reach_share = 0.4;  // of prior_sd: where a limit without a curve may have been reached
constexpr double coarsest_share = 0.1;     // of prior_sd between two places of the filter
constexpr double point_doubt_share = 0.2;  // of prior_sd: how the guide's error may differ from point to point
constexpr double lost_share = 0.5;         // the same where the guide says nothing of the new point

// A doubt: two readings in a row about three standard deviations off, or several somewhat less.
constexpr double surprise_share = 0.2, surprise_cap = 9.0, surprise_limit = 3.2, kept_in_doubt = 0.01;
constexpr double patience = 0.2;  // of a lag: behind it no change is sudden, and more readings are heard before a doubt
constexpr std::int64_t calm_cycles = 10;
constexpr double trying_share = 0.04;  // of prior_sd: steps where every input breaks a limit of unknown slope
// A hand-over: four doubts within about 80 cycles, or readings that scatter far less than the curve fits.
constexpr double doubt_memory_cycles = 80.0, doubt_rate_limit = 3.0;
constexpr double worst_ratio = 0.12, good_ratio = 0.6;  // of the noise seen to what the curve leaves unexplained
constexpr double little_share = 0.1;                    // of the drop at 0.3 prior_sd, squared
constexpr double repeat_memory = 0.98;
constexpr std::int64_t fewest_repeats = 60;
constexpr double least_evidence = 1.0;  // logarithm of how much likelier J answers the input than not

constexpr std::int64_t first_blocks = 4, centre_every = 8;
constexpr double hold_share = 2.0;     // of the sensor's lag: cycles on one side of the estimate
constexpr double modest_share = 0.25;  // of the cheapest amplitude, less than the place is uncertain by

constexpr int most_uncertain = 20;  // cycles of delay

constexpr int plain_period = 10;
constexpr double plain_time_constant = 40.0;  // [cycles], and not below these of periods and of the delay
constexpr double plain_periods = 4.0, plain_delays = 3.0;
constexpr double plain_amplitude_share = 0.1;  // of prior_sd
constexpr double plain_range_share = 0.05;     // of the range: the largest amplitude
constexpr double plain_periods_per_lag = 2.4;  // a shorter dither would be damped away
constexpr double curvature_share = 0.3;        // of prior_sd
constexpr double most_rise = 0.1;  // of a curve's height, as a coarse model ripples: several maxima above it

CurveSeekingSettings checked(CurveSeekingSettings s) {
  if (s.space.size() != 1) {
    throw about("start",
                ShapeError("start has " + std::to_string(s.space.size()) + " entries: a curve guides one input"));
  }
  s.space = resolved(std::move(s.space));
  for (const auto& [name, bound] : {std::pair{"lower", &s.space.lower}, std::pair{"upper", &s.space.upper}}) {
    if (bound->size() == 1 && !std::isfinite((*bound)[0])) {
      throw ParameterError(name, (*bound)[0], "must be finite: the guide's curve is placed between the bounds");
    }
  }
  validate(s.space, scalar_input(0.0));
  if (!s.rate && !s.space.inputs.empty() && std::isfinite(s.space.inputs[0].rate)) s.rate = s.space.inputs[0].rate;
  const double width = s.space.upper[0] - s.space.lower[0];
  if (s.prior_sd == 0.0) s.prior_sd = prior_share * width;
  require_in(above(0.0, 1e12), "prior_sd", s.prior_sd);
  if (width / (CurveFilter::places - 1) > coarsest_share * s.prior_sd) {
    throw ParameterError("prior_sd", s.prior_sd,
                         "must be at least " + text(width / (CurveFilter::places - 1) / coarsest_share) +
                             " between these bounds; narrow the bounds or raise it");
  }
  if (s.amplitude_max == 0.0) s.amplitude_max = amplitude_share * s.prior_sd;
  require_in(above(0.0, 1e12), "amplitude_max", s.amplitude_max);
  if (s.rate && !(*s.rate > 0.0)) throw ParameterError("rate", *s.rate, "must be > 0");
  optimize::validate(std::vector{s.sensor});
  if (!(s.delay_uncertainty >= 0 && s.delay_uncertainty <= most_uncertain)) {
    throw ParameterError("delay_uncertainty", s.delay_uncertainty,
                         "must be in [0, " + std::to_string(most_uncertain) + "] cycles");
  }
  if (s.sensor.delay_cycles > 10000.0) throw ParameterError("delay_cycles", s.sensor.delay_cycles, "must be <= 10000");
  if (!(s.curve.curvature(curvature_share * s.prior_sd) < 0.0)) {
    throw about("curve", ParameterError("curve does not bend down at its best input, " + text(s.curve.best()) +
                                        ": give a guide whose J has a maximum, or a parabola"));
  }
  if (const double again = s.curve.rises_again(s.prior_sd); again > most_rise) {
    throw about(
        "curve",
        ParameterError("curve has several maxima near its best input, it rises again by " + text(100.0 * again) +
                       " % of its height: give a guide with one, or a function as guide of GaussianProcessSeeking"));
  }
  if (!(s.curve.best() >= s.space.lower[0] && s.curve.best() <= s.space.upper[0])) {
    throw about("curve", ParameterError("curve has its best input at " + text(s.curve.best()) + ": must be in [" +
                                        text(s.space.lower[0]) + ", " + text(s.space.upper[0]) +
                                        "], the bounds; widen them or move the curve"));
  }
  return s;
}

double surprise_share_of(const optimize::ComponentLag& sensor) noexcept {
  return surprise_share / (1.0 + patience * sensor.lag_cycles);
}

double step_of(const optimize::SearchSpace& space) noexcept {
  return space.inputs.empty() ? 0.0 : space.inputs[0].step;
}

int shortest_delay(const CurveSeekingSettings& s) noexcept {
  return std::max(0, static_cast<int>(std::lround(s.sensor.delay_cycles)) - s.delay_uncertainty);
}

CurveFilterSettings filter_settings(const CurveSeekingSettings& s) {
  CurveFilterSettings out{s.space.lower[0], s.space.upper[0], s.prior_sd,      s.scale_sd,
                          s.discrepancy,    s.noise_sd,       s.memory_cycles, s.sensor.lag_cycles};
  out.earlier = static_cast<int>(std::lround(s.sensor.delay_cycles)) - shortest_delay(s);
  out.later = s.delay_uncertainty;
  validate(out);
  return out;
}

// In an order without a period, since a delay that is wrong by a few cycles must find no echo of the dither; as often
// up as down in every four, since a level that drifts is known the better.
bool side_of(std::int64_t block) noexcept {
  constexpr std::array<unsigned, 6> halves{0b0011, 0b0101, 0b0110, 0b1001, 0b1010, 0b1100};
  if (block < first_blocks) return block % 2 == 1;
  const auto order = random::bits(1, 1, static_cast<std::uint64_t>(block / 4)) % halves.size();
  return (halves[order] >> (block % 4) & 1U) != 0;
}

// About an origin that is set when it takes over; amplitude and gain follow from the guide's curvature.
optimize::ExtremumSeekingSettings plain_settings(const CurveSeekingSettings& s) {
  const double width = s.space.upper[0] - s.space.lower[0];
  const double amplitude = std::min(plain_amplitude_share * s.prior_sd, plain_range_share * width);
  optimize::ExtremumSeekingSettings out;
  const double late = s.sensor.delay_cycles + s.sensor.lag_cycles;
  const int period = std::max(plain_period, static_cast<int>(std::ceil(plain_periods_per_lag * s.sensor.lag_cycles)));
  const double tau =
      std::max({plain_time_constant, plain_periods * period * (late > 0.0 ? 1.0 : 0.0), plain_delays * late});
  out.space = {scalar_input(0.0), scalar_input(-2.0 * width), scalar_input(2.0 * width)};
  out.dither.amplitude = scalar_input(amplitude);
  out.dither.period = period;
  out.gain = scalar_input(2.0 / (amplitude * std::abs(s.curve.curvature(curvature_share * s.prior_sd)) * tau));
  // Readings are held back to the longest delay: so the same tables serve whichever delay has been found.
  out.components = {{std::round(s.sensor.delay_cycles) + s.delay_uncertainty, s.sensor.lag_cycles}};
  out.maximize = s.maximize;
  return out;
}

}  // namespace

CurveSeeking::CurveSeeking(CurveSeekingSettings settings)
    : settings_(checked(std::move(settings))),
      filter_(filter_settings(settings_), settings_.curve),
      limits_(settings_.limits, settings_.limit_curves, settings_.space.lower[0], settings_.space.upper[0],
              limit_reach_share * settings_.prior_sd, settings_.memory_cycles, step_of(settings_.space)),
      plain_(plain_settings(settings_)),
      protocol_(settings_.space, 1 + settings_.limits.size()),
      estimate_(settings_.space.start),
      applied_(estimate_),
      delay_(std::lround(settings_.sensor.delay_cycles)),
      hold_(std::max(1L, std::lround(hold_share * settings_.sensor.lag_cycles))),
      sent_(static_cast<std::size_t>(shortest_delay(settings_)) + 1, 0.0),
      held_back_(static_cast<std::size_t>(filter_.settings().earlier + filter_.settings().later) + 1, 0.0) {}

// As far as the place is uncertain; once it is known, as far as learning its moves costs least: the dither costs
// |J''| A^2/4 a cycle, the error that it leaves |J''| s^2/2 with s = sigma/(A |J''| sqrt(N)).
double CurveSeeking::amplitude() const noexcept {
  const double faded = std::exp(-1.0 / settings_.memory_cycles);
  const double readings = (1.0 + faded) / (1.0 - faded);
  const double bend = filter_.curvature();
  // Beyond a limit that holds the estimate back nothing is gained by knowing the place.
  const double held_back =
      limits_.size() > 0 && filter_.readings() > 0.0 ? std::abs(filter_.mean() - estimate_[0]) : 0.0;
  const double cheapest = std::sqrt(filter_.noise_sd() / (std::abs(bend) * std::sqrt(readings)));
  const double active = std::sqrt(static_cast<double>(centre_every) / static_cast<double>(centre_every - 1));
  return std::min(active * std::max(filter_.search_sd() - held_back - modest_share * cheapest, cheapest),
                  settings_.amplitude_max);
}

const Inputs& CurveSeeking::ask() noexcept {
  if (protocol_.asked) return applied();
  const double last = applied()[0];
  if (plain_at_work_) {
    applied_[0] = taken_over_at_ + plain_.ask()[0];
  } else if (sent_count_ == 0) {
    applied_[0] = estimate_[0];
  } else {
    const std::int64_t block = sent_count_ / hold_;
    const bool centre = block > first_blocks && block % centre_every == 0;  // tells a curve from a level
    applied_[0] = estimate_[0] + (centre ? 0.0 : upwards_ ? amplitude() : -amplitude());
  }
  if (sent_count_ > 0) applied_[0] = within_limits(applied_[0]);
  if (protocol_.cycle > 0 && settings_.rate) {
    applied_[0] = std::clamp(applied_[0], last - *settings_.rate, last + *settings_.rate);
  }
  applied_[0] = std::clamp(applied_[0], settings_.space.lower[0], settings_.space.upper[0]);
  return protocol_.ask(applied_, [this](const Inputs& at) { return excess(at); });
}

// An input that a limit forbids is taken back: to the other side of the estimate, or to the edge and inside of it.
double CurveSeeking::within_limits(double wanted) noexcept {
  if (limits_.size() == 0) return wanted;
  const double allowed = limits_.nearest(wanted);
  if (settings_.limit_curves.empty() && limits_.excess(allowed) > 0.0) {
    const double try_by = std::max(trying_share * settings_.prior_sd, step_of(settings_.space));
    return allowed + (upwards_ ? try_by : -try_by);
  }
  if (allowed == wanted || plain_at_work_) return allowed;
  const double reach = std::min(std::abs(wanted - estimate_[0]), 0.5 * amplitude());
  const double inside = allowed + std::copysign(reach, allowed - wanted);
  return upwards_ == (allowed > wanted) && limits_.excess(inside) <= 0.0 ? inside : allowed;
}

TellStatus CurveSeeking::tell(const Reading& reading) noexcept {
  const TellStatus status = protocol_.check(reading, component_count(), limit_count(), 1);
  protocol_.count(status, reading);
  if (status != TellStatus::accepted && status != TellStatus::misfire) return status;
  Inputs told;
  const double applied = protocol_.applied(reading, applied_, told)[0];
  if ((sent_count_ + 1) % hold_ == 0) upwards_ = side_of((sent_count_ + 1) / hold_);
  if (status == TellStatus::accepted) limits_.record(applied, reading.limits);
  const auto ring = static_cast<std::int64_t>(sent_.size());
  sent_[static_cast<std::size_t>(sent_count_ % ring)] = applied;
  ++sent_count_;
  if (plain_at_work_) {
    // After a misfire it is asked again, or elsewhere as the protocol says; where J is late its dither goes on.
    if (status == TellStatus::accepted) {
      tell_plain(reading.components[0], applied);
    } else if (settings_.sensor != optimize::ComponentLag{} && held_count_ > 0) {
      tell_plain(last_held() * taken_over_scale_, applied);
    }
    return status;
  }
  if (sent_count_ < ring) {
    // Standing still until the first reading comes would teach nothing: it says no more of the place than the guide.
    estimate_[0] = allowed_mean();
    return status;
  }
  const double cause = sent_[static_cast<std::size_t>(sent_count_ % ring)];
  if (status == TellStatus::misfire || sent_count_ <= delay_) {
    filter_.pass(cause);  // what is read now was caused before the first cycle
    if (!(filter_.readings() > 0.0)) estimate_[0] = allowed_mean();
  } else {
    learn(cause, objective_of(reading, settings_.maximize));
  }
  return status;
}

double CurveSeeking::last_held() const noexcept {
  return held_back_[static_cast<std::size_t>((held_count_ - 1) % static_cast<std::int64_t>(held_back_.size()))];
}

void CurveSeeking::tell_plain(double j, double applied) noexcept {
  const auto size = static_cast<std::int64_t>(held_back_.size());
  const auto at = [&](std::int64_t k) -> double& { return held_back_[static_cast<std::size_t>(k % size)]; };
  at(held_count_) = j / taken_over_scale_;
  const double held = at(std::max<std::int64_t>(0, held_count_ - (settings_.delay_uncertainty - delay_error_)));
  const double moved = applied - taken_over_at_;
  ++held_count_;
  plain_.tell({{&held, 1}, {}, false, {&moved, 1}});
  estimate_[0] = std::clamp(taken_over_at_ + plain_.estimate()[0], settings_.space.lower[0], settings_.space.upper[0]);
}

void CurveSeeking::learn(double cause, double j) noexcept {
  watch_repeats(cause, j);
  judge_surprise(filter_.learn(cause, j));
  ++since_doubt_;
  doubt_rate_ *= std::exp(-1.0 / doubt_memory_cycles);
  const double usual = std::sqrt(surprise_share_of(settings_.sensor) / surprise_share);  // scatter of a longer mean
  if (surprise_ > 1.0 + (surprise_limit - 1.0) * usual && since_doubt_ > calm_cycles) {
    filter_.doubt(kept_in_doubt);
    surprise_ = 1.0;
    since_doubt_ = 0;
    doubt_rate_ += 1.0;
    repeats_ = 0;  // what the curve leaves is counted anew, and so is the noise it is held against
    ++doubts_;
  }
  estimate_[0] = allowed_mean();
  const bool misfit = repeats_ >= fewest_repeats && !(explained() > 0.0);
  if (settings_.hand_over && (doubt_rate_ > doubt_rate_limit || misfit)) take_over();
}

double CurveSeeking::allowed_mean() noexcept {
  const double mean = limits_.size() > 0 ? limits_.nearest(filter_.mean()) : filter_.mean();
  return protocol_.failures.keep(scalar_input(mean))[0];
}

void CurveSeeking::judge_surprise(double surprise) noexcept {
  if (!std::isfinite(surprise)) return;
  surprise_ += surprise_share_of(settings_.sensor) * (std::min(surprise, surprise_cap) - surprise_);
}

// Two readings of one side in a row that lie close together differ by noise alone: half their squared difference.
void CurveSeeking::watch_repeats(double input, double j) noexcept {
  const auto side = static_cast<std::size_t>(upwards_);
  if (repeat_known_[side] > 0.0 && std::abs(input - repeat_input_[side]) < 0.25 * amplitude()) {
    const double half = 0.5 * (j - repeat_j_[side]) * (j - repeat_j_[side]);
    ++repeats_;
    const double share = std::max(1.0 - repeat_memory, 1.0 / static_cast<double>(repeats_));
    repeat_variance_ += share * (half - repeat_variance_);
  }
  repeat_input_[side] = input;
  repeat_j_[side] = j;
  repeat_known_[side] = 1.0;
}

void CurveSeeking::take_over() noexcept {
  plain_at_work_ = true;
  taken_over_at_ = estimate_[0];
  taken_over_scale_ = filter_.curvature() / filter_.curve().curvature(curvature_share * settings_.prior_sd);
  delay_error_ = filter_.delay_error();
  held_count_ = 0;
  plain_.restart();
}

// The filter begins anew with T about `mean`, and so does all that watches it.
void CurveSeeking::begin_at(const Curve& curve, double mean, double sd) noexcept {
  estimate_[0] = std::clamp(mean, settings_.space.lower[0], settings_.space.upper[0]);
  filter_.restart(curve, mean, std::min(sd, settings_.prior_sd));
  sent_count_ = 0;
  surprise_ = 1.0;
  since_doubt_ = 0;
  doubt_rate_ = 0.0;
  repeats_ = 0;
  repeat_known_.fill(0.0);
  plain_at_work_ = false;
}

bool CurveSeeking::usable(const Curve& curve) const noexcept {
  return curve.curvature(curvature_share * settings_.prior_sd) < 0.0 &&
         curve.rises_again(settings_.prior_sd) <= most_rise && curve.best() >= settings_.space.lower[0] &&
         curve.best() <= settings_.space.upper[0];
}

bool CurveSeeking::believe(const Curve& curve, double sd) noexcept {
  if (!usable(curve) || !(sd > 0.0)) return false;
  filter_.believe(curve, std::min(sd, settings_.prior_sd));
  if (!plain_at_work_ && (filter_.readings() > 0.0 || protocol_.cycle == 0)) estimate_[0] = allowed_mean();
  return true;
}

bool CurveSeeking::guide(const Curve& curve, std::span<const Curve> limit_curves) noexcept {
  if (!usable(curve)) {
    restart();
    return false;
  }
  const bool learnt = filter_.readings() > 0.0 || plain_at_work_;
  const double error = learnt ? estimate_[0] - filter_.curve().best() : 0.0;
  const double sd = learnt ? filter_.spread() : settings_.prior_sd;
  limits_.restart(limit_curves);
  protocol_.failures.forget();
  begin_at(curve, curve.best() + error, std::hypot(sd, point_doubt_share * settings_.prior_sd));
  return true;
}

void CurveSeeking::restart() noexcept {
  limits_.restart({});
  protocol_.failures.forget();
  begin_at(filter_.curve(), estimate_[0], std::hypot(filter_.spread(), lost_share * settings_.prior_sd));
}

void CurveSeeking::shift_estimate(const Inputs& by) noexcept {
  begin_at(filter_.curve(), estimate_[0] + by[0], std::hypot(filter_.spread(), point_doubt_share * settings_.prior_sd));
}

bool CurveSeeking::answered() const noexcept {
  return !plain_at_work_ && (filter_.readings() < fewest_repeats || filter_.answer_evidence() > least_evidence);
}

double CurveSeeking::trust() const noexcept {
  const double scale = filter_.scale();
  return plain_at_work_ ? 0.0 : explained() * std::min(scale, 1.0 / scale);
}

double CurveSeeking::explained() const noexcept {
  if (repeats_ < fewest_repeats / 2) return 1.0;
  const double little = little_share * filter_.small_variance();  // what a noise-free plant leaves is not a misfit
  const double ratio = (repeat_variance_ + little) / (filter_.unexplained_variance() + little);
  return std::clamp((ratio - worst_ratio) / (good_ratio - worst_ratio), 0.0, 1.0);
}

double CurveSeeking::estimate_sd() const noexcept {
  return plain_at_work_ ? std::numeric_limits<double>::quiet_NaN() : filter_.stated_sd();
}

}  // namespace mgdd::guide
