#include "mgdd/guide/curve_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mgdd/common/bounds.hpp"

namespace mgdd::guide {
namespace {

struct Shape {
  double below, above;  // width of the curve on either side of T, over that of the guide's
  double log_prior;
};
constexpr double steep = 0.35, rare = -3.0;  // a cliff on one side: one chance in twenty before any reading
constexpr std::array<Shape, CurveBank::shapes> shape_table{{{1.0, 1.0, 0.0}, {steep, 1.0, rare}, {1.0, steep, rare}}};

constexpr double curvature_reach = 0.3;  // of the prior's sd: second differences and the guess of the noise

constexpr double slow_level = 0.2;  // of a lag: behind a slow sensor a level moves no faster than what it shows

// The first two are those of every delay: under one alone the delay whose level errs the least would be believed. The
// next are of short memory, and stand for a place that moves somehow; the last for one that moves steadily. By its
// velocity, in `prior_sd` per cycle, and their memory they follow a place that moves half to twice as fast.
struct Assumption {
  double memory_share, drift, slope, prior, velocity;
};
constexpr std::array<Assumption, 6> assumptions{{{1.0, 2e-4, 0.03, 0.75, 0.0},
                                                 {1.0, 0.5, 0.0, 0.06, 0.0},
                                                 {0.25, 0.01, 0.1, 0.1, 0.0},
                                                 {0.1, 0.05, 0.0, 0.04, 0.0},
                                                 {0.3, 0.003, 0.1, 0.025, 0.007},
                                                 {0.3, 0.003, 0.1, 0.025, -0.007}}};
constexpr std::size_t steady = 4;                // the first of these
constexpr double steady_in_doubt = 0.1;          // of its weight: a sudden change is not a steady one
constexpr double shortest_memory = 8.0;          // below it a parabola has hardly more readings than unknowns
constexpr double refuted = 0.9, steadier = 0.2;  // weight of short memory at which a long one is given up
// Banks and delays of less weight than these follow the readings in turn: together they move the estimate by little.
constexpr double little = 0.02, hardly = 0.005;
constexpr std::int64_t in_turn = 10;
constexpr double told_prior = 0.8;                          // probability that the delay is as told
constexpr double change = 2e-4, assumption_change = 0.005;  // ... that another one is right from one cycle to the next
constexpr double most_said = 1.0;                           // by one reading for or against a delay, a logarithm
// A reading may be an outlier: as likely anywhere within twenty standard deviations, under every assumption.
constexpr double outliers = 0.02, outlier_reach = 20.0;
// Squared distance at which it is as likely one as not, 2 ln((1 - outliers) reach / (outliers sqrt(2 pi))).
constexpr double heard_whole = 11.9;

}  // namespace

void validate(const CurveFilterSettings& s) {
  if (!(s.lower < s.upper)) throw ParameterError("lower", s.lower, "must be < upper = " + text(s.upper));
  require_in(closed(-1e12, 1e12), "lower", s.lower);
  require_in(closed(-1e12, 1e12), "upper", s.upper);
  require_in(above(0.0, 1e12), "prior_sd", s.prior_sd);
  require_in(above(0.0, 10.0), "scale_sd", s.scale_sd);
  require_in(closed(0.0, 10.0), "discrepancy", s.discrepancy);
  if (s.noise_sd) require_in(above(0.0, 1e15), "noise_sd", *s.noise_sd);
  require_in(closed(5.0, 1e9), "memory_cycles", s.memory_cycles);
  require_in(closed(0.0, 1e6), "lag_cycles", s.lag_cycles);
}

CurveFilter::CurveFilter(const CurveFilterSettings& settings, const Curve& curve)
    : settings_(settings),
      per_lag_(settings.lag_cycles > 0.0 ? -std::expm1(-1.0 / settings.lag_cycles) : 1.0),
      fading_(std::exp(-1.0 / settings.memory_cycles)),
      delays_(static_cast<std::size_t>(settings.earlier + settings.later) + 1),
      ring_(delays_, Column::Zero()),
      delay_weights_(delays_),
      assumption_weights_(assumptions.size()),
      leader_(settings.earlier) {
  lagged_.setZero();
  prior_.first = settings.lower;
  prior_.step = (settings.upper - settings.lower) / (places - 1);
  for (std::size_t d = 0; d < delays_; ++d)
    delay_weights_[d] = delay_prior(d);
  const double slowly = 1.0 / (1.0 + slow_level * settings.lag_cycles);
  for (std::size_t i = 0; i < shared() + assumptions.size() - common; ++i) {
    const Assumption& a = assumptions[assumption_of(i)];
    const double memory =
        std::max(a.memory_share * settings.memory_cycles, std::min(shortest_memory, settings.memory_cycles));
    banks_.emplace_back(CurveBank::Assumed{memory, slowly * slowly * a.drift, slowly * a.slope,
                                           std::clamp(a.velocity * settings.prior_sd / prior_.step, -0.5, 0.5)});
  }
  foretold_.resize(banks_.size());
  for (int i = 0; i < places; ++i)
    prior_.place[i] = prior_.step * i;
  prior_.scale_sd = settings.scale_sd;
  prior_.discrepancy = settings.discrepancy;
  prior_.noise_told = settings.noise_sd.has_value();
  restart(curve, curve.best(), settings.prior_sd);
}

void CurveFilter::expect(const Curve& curve, double mean, double sd) noexcept {
  curve_ = curve;
  bend_ = curve.curvature(curvature_reach * settings_.prior_sd);
  prior_mean_ = mean;
  prior_extra_ = std::max(0.0, 1.0 / (sd * sd) - 1.0 / (settings_.prior_sd * settings_.prior_sd));
  place_prior();
}

void CurveFilter::place_prior() noexcept {
  prior_.noise_variance = guessed_variance();
  prior_.precision = 1.0 / (settings_.prior_sd * settings_.prior_sd) + prior_extra_;
  for (std::size_t s = 0; s < shape_table.size(); ++s) {
    for (int i = 0; i < places; ++i) {
      const double away = prior_.first + prior_.step * i - prior_mean_;
      prior_.log_of[static_cast<Eigen::Index>(s) * places + i] =
          shape_table[s].log_prior - 0.5 * away * away * prior_.precision;
    }
  }
  prior_.mass_of = prior_.log_of.exp();
  prior_.mass = prior_.mass_of.sum();
}

void CurveFilter::restart(const Curve& curve, double mean, double sd) noexcept {
  expect(curve, mean, sd);
  cycles_ = 0;
  started_ = false;
  for (std::size_t a = 0; a < assumptions.size(); ++a)
    assumption_weights_[a] = assumptions[a].prior;
  for (CurveBank& bank : banks_)
    bank.restart(prior_);
  mix();
}

void CurveFilter::believe(const Curve& curve, double sd) noexcept {
  expect(curve, curve.best(), sd);
  for (CurveBank& bank : banks_)
    bank.judge(prior_);
  mix();
}

double CurveFilter::guessed_variance() const noexcept {
  if (settings_.noise_sd) return *settings_.noise_sd * *settings_.noise_sd;
  const double drop = 0.5 * bend_ * std::pow(curvature_reach * settings_.prior_sd, 2);
  return drop * drop;
}

void CurveFilter::fill_drops(double input, Column& drops) const noexcept {
  const double best = curve_.best(), top = curve_.top();
  for (std::size_t s = 0; s < shape_table.size(); ++s) {
    const double per_below = 1.0 / shape_table[s].below, per_above = 1.0 / shape_table[s].above;
    for (int i = 0; i < places; ++i) {
      const double away = input - (prior_.first + prior_.step * i);
      drops[static_cast<Eigen::Index>(s) * places + i] =
          curve_(best + away * (away < 0.0 ? per_below : per_above)) - top;
    }
  }
}

void CurveFilter::pass(double input) noexcept {
  Column drops;
  fill_drops(input, drops);
  lagged_ += (started_ ? per_lag_ : 1.0) * (drops - lagged_);  // settled before the first cycle
  if (!started_) std::fill(ring_.begin(), ring_.end(), lagged_);
  for (std::size_t b = shared() + steady - common; b < banks_.size(); ++b)
    banks_[b].move(prior_);
  started_ = true;
  ring_[static_cast<std::size_t>(cycles_) % ring_.size()] = lagged_;
  ++cycles_;
}

// Behind `delay` the input of this cycle was that of as many cycles ago, or the first one.
const CurveFilter::Column& CurveFilter::drops_at(std::int64_t cycle, std::size_t delay) const noexcept {
  const auto size = static_cast<std::int64_t>(ring_.size());
  return ring_[static_cast<std::size_t>((cycle - static_cast<std::int64_t>(delay) + size) % size)];
}

double CurveFilter::learn(double input, double j) noexcept {
  pass(input);
  prior_extra_ *= fading_ * fading_;  // sooner than the readings, or a guide that is wrong would draw the end to itself
  place_prior();
  double surprise = std::numeric_limits<double>::quiet_NaN(), heard = 1.0;
  if (readings() > 0.0) {
    for (std::size_t i = 0; i < banks_.size(); ++i)
      if (compared(delay_of(i))) foretold_[i] = banks_[i].foretell(prior_, drops_at(cycles_ - 1, delay_of(i)), j);
    const Prediction whole = expected();
    surprise = (j - whole.mean) * (j - whole.mean) / whole.variance;
    heard = std::min(1.0, heard_whole / surprise);
  }
  for (std::size_t i = 0; i < banks_.size(); ++i) {
    banks_[i].add(prior_, drops_at(cycles_ - 1, delay_of(i)), j, heard);
    if (weight_of(i) > little || is_turn_of(i)) banks_[i].judge(prior_);
  }
  if (std::isfinite(surprise)) weigh();
  give_up_the_refuted();
  mix();
  return surprise;
}

// Where short memory foretells the readings better by far, all go on from what the best of its banks knows.
void CurveFilter::give_up_the_refuted() noexcept {
  const double standing = assumption_weights_[0] + assumption_weights_[1];
  double anew = 0.0;
  std::size_t best = common;
  for (std::size_t a = common; a < steady; ++a) {
    anew += assumption_weights_[a];
    if (assumption_weights_[a] >= assumption_weights_[best]) best = a;
  }
  if (anew < refuted * (standing + anew) || anew < steadier * (1.0 - standing - anew)) return;
  const CurveBank& known = banks_[shared() + best - common];
  for (CurveBank& bank : banks_)
    if (&bank != &known) bank.take_over(known);
  for (std::size_t a = 0; a < assumptions.size(); ++a)
    assumption_weights_[a] = assumptions[a].prior;
}

// Of the leader's by all assumptions, of another delay's by those that it has.
double CurveFilter::weight_of(std::size_t bank) const noexcept {
  const double own = delay_weights_[delay_of(bank)] * assumption_weights_[assumption_of(bank)];
  return delay_of(bank) == leader() ? own : own / (assumption_weights_[0] + assumption_weights_[1]);
}

bool CurveFilter::is_turn_of(std::size_t i) const noexcept {
  return (cycles_ + static_cast<std::int64_t>(i)) % in_turn == 0;
}

// A delay that is hardly believed is held against every few readings only.
bool CurveFilter::compared(std::size_t delay) const noexcept {
  return delay == leader() || offset_of(delay) == 0 || delay_weights_[delay] > hardly || is_turn_of(delay);
}

double CurveFilter::delay_prior(std::size_t delay) const noexcept {
  if (delays_ == 1) return 1.0;
  return offset_of(delay) == 0 ? told_prior : (1.0 - told_prior) / static_cast<double>(delays_ - 1);
}

CurveFilter::Prediction CurveFilter::expected() const noexcept {
  const double about = foretold_[leader() * common].reading.mean;  // or the squares would lose all digits
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (std::size_t i = 0; i < banks_.size(); ++i) {
    if (!compared(delay_of(i))) continue;
    const auto& [own, variance] = foretold_[i].reading;
    const double weight = weight_of(i);
    sum += weight;
    mean += weight * (own - about);
    square += weight * (variance + (own - about) * (own - about));
  }
  mean /= sum;
  return {about + mean, square / sum - mean * mean};
}

void CurveFilter::weigh() noexcept {
  const double anywhere = outliers / (outlier_reach * noise_sd());
  const auto likely = [&](std::size_t bank) { return (1.0 - outliers) * foretold_[bank].density + anywhere; };
  // As far as neither of the common assumptions holds, a reading says nothing of the delay.
  const double held = assumption_weights_[0] + assumption_weights_[1], slow = assumption_weights_[0] / held;
  const auto evidence = [&](std::size_t d) {
    return std::log(slow * likely(d * common) + (1.0 - slow) * likely(d * common + 1));
  };
  double sum = 0.0;
  std::array<double, assumptions.size()> own{};
  for (std::size_t a = 0; a < own.size(); ++a) {
    const std::size_t bank = a < common ? leader() * common + a : shared() + a - common;
    own[a] = assumption_weights_[a] + assumption_change * (assumptions[a].prior - assumption_weights_[a]);
    sum += own[a] *= likely(bank);
  }
  const double of_told = evidence(static_cast<std::size_t>(settings_.earlier));
  double total = 0.0;
  for (std::size_t d = 0; d < delays_; ++d) {
    const double said = compared(d) ? held * std::clamp(evidence(d) - of_told, -most_said, most_said) : 0.0;
    delay_weights_[d] += change * (delay_prior(d) - delay_weights_[d]);
    total += delay_weights_[d] *= std::exp(said);
  }
  for (double& weight : delay_weights_)
    weight /= total;
  for (std::size_t a = 0; a < own.size(); ++a)
    assumption_weights_[a] = own[a] / sum;
  const auto best = std::max_element(delay_weights_.begin(), delay_weights_.end()) - delay_weights_.begin();
  if (best == leader_) return;
  leader_ = best;
  for (std::size_t i = shared(); i < banks_.size(); ++i)
    banks_[i].take_over(banks_[leader() * common]);
}

void CurveFilter::mix() noexcept {
  mean_ = variance_ = scale_ = unexplained_ = 0.0;
  for (std::size_t i = 0; i < banks_.size(); ++i) {
    const double weight = weight_of(i);
    mean_ += weight * banks_[i].mean();
    variance_ += weight * banks_[i].variance();
    scale_ += weight * banks_[i].scale();
    unexplained_ += weight * banks_[i].unexplained();
  }
  double spread = 0.0, search = 0.0, stated = 0.0;
  for (std::size_t i = 0; i < banks_.size(); ++i) {
    const CurveBank& bank = banks_[i];
    const double weight = weight_of(i), off = (bank.mean() - mean_) * (bank.mean() - mean_);
    spread += weight * (bank.spread() * bank.spread() + off);
    search += weight * std::log(std::pow(bank.search_sd(prior_), 2) + off);
    stated += weight * (std::pow(bank.stated_sd(prior_), 2) + off);
  }
  spread_ = std::sqrt(spread);
  search_sd_ = std::exp(0.5 * search);
  stated_sd_ = std::sqrt(stated);
}

// What is known stays: the banks of short memory begin anew with half of all weight, and the readings to come decide.
void CurveFilter::doubt(double kept) noexcept {
  double anew = 0.0;
  for (std::size_t a = common; a < steady; ++a)
    anew += assumptions[a].prior;
  double sum = 0.0;
  for (std::size_t a = 0; a < assumptions.size(); ++a) {
    double& weight = assumption_weights_[a];
    weight *= a < steady ? 1.0 : steady_in_doubt;
    if (a >= common && a < steady) weight += assumptions[a].prior / anew;
    sum += weight;
  }
  for (double& weight : assumption_weights_)
    weight /= sum;
  for (std::size_t b = shared(); b < shared() + steady - common; ++b) {
    banks_[b].fade(kept);
    banks_[b].judge(prior_);
  }
  mix();
}

CurveFilter::Prediction CurveFilter::predict(double input) const noexcept {
  if (!(readings() > 0.0)) return {0.0, std::numeric_limits<double>::infinity()};
  Column drops;
  fill_drops(input, drops);
  if (per_lag_ < 1.0) drops = (lagged_ + per_lag_ * (drops - lagged_)).eval();
  double mean = 0.0, square = 0.0;
  const double about = banks_[leader() * common].predict(prior_, drops).mean;
  for (std::size_t i = 0; i < banks_.size(); ++i) {
    const std::size_t delay = delay_of(i);
    const Prediction own = banks_[i].predict(prior_, delay == 0 ? drops : drops_at(cycles_, delay));
    const double weight = weight_of(i), off = own.mean - about;
    mean += weight * off;
    square += weight * (own.variance + off * off);
  }
  return {about + mean, square - mean * mean};
}

double CurveFilter::noise_sd() const noexcept {
  return std::sqrt(variance_);
}

double CurveFilter::curvature() const noexcept {
  return bend_ * std::max(scale_, 1e-3);
}

}  // namespace mgdd::guide
