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

// The first is that of every delay.
struct Assumption {
  double memory_share, drift, slope, prior;
};
constexpr std::array<Assumption, 4> assumptions{
    {{1.0, 2e-4, 0.03, 0.8}, {1.0, 0.05, 0.0, 0.05}, {0.25, 0.01, 0.1, 0.1}, {0.1, 0.05, 0.0, 0.05}}};
constexpr double shortest_memory = 8.0;
constexpr double little = 0.03;  // weight of a bank whose posterior follows its readings only now and then
constexpr std::int64_t early = 40, seldom = 8;
constexpr double told_prior = 0.5;  // probability that the delay is as told
constexpr double change = 0.0001;   // ... that another one is right from one cycle to the next
constexpr double assumption_change = 0.01;

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
      ring_(delays_ + recent, Column::Zero()),
      delay_weights_(delays_),
      assumption_weights_(assumptions.size()),
      leader_(settings.earlier) {
  lagged_.setZero();
  for (std::size_t d = 0; d < delays_; ++d) {
    banks_.emplace_back(CurveBank::Assumed{settings.memory_cycles, assumptions[0].drift, assumptions[0].slope});
    delay_weights_[d] = delays_ == 1 ? 1.0 : (1.0 - told_prior) / static_cast<double>(delays_ - 1);
  }
  if (delays_ > 1) delay_weights_[leader()] = told_prior;
  for (std::size_t i = 1; i < assumptions.size(); ++i) {
    const double memory = std::max(shortest_memory, assumptions[i].memory_share * settings.memory_cycles);
    banks_.emplace_back(CurveBank::Assumed{memory, assumptions[i].drift, assumptions[i].slope});
  }
  prior_.first = settings.lower;
  prior_.step = (settings.upper - settings.lower) / (places - 1);
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
  recent_count_ = 0;
  cycles_ = 0;
  started_ = false;
  for (std::size_t i = 0; i < assumptions.size(); ++i)
    assumption_weights_[i] = assumptions[i].prior;
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
  started_ = true;
  ring_[static_cast<std::size_t>(cycles_) % ring_.size()] = lagged_;
  ++cycles_;
}

// Behind `delay` the input of this cycle was that of as many cycles ago, or the first one.
const CurveFilter::Column& CurveFilter::drops_at(std::int64_t cycle, std::size_t delay) const noexcept {
  const auto size = static_cast<std::int64_t>(ring_.size());
  return ring_[static_cast<std::size_t>((cycle - static_cast<std::int64_t>(delay) + size) % size)];
}

void CurveFilter::learn(double input, double j) noexcept {
  pass(input);
  prior_extra_ *= fading_ * fading_;  // sooner than the readings, or a guide that is wrong would draw the end to itself
  place_prior();
  std::array<double, 64> log_likely{};
  for (std::size_t i = 0; i < banks_.size(); ++i) {
    const bool turn = recent_count_ < early || (cycles_ + static_cast<std::int64_t>(i)) % seldom == 0;
    log_likely[i] = banks_[i].learn(prior_, drops_at(cycles_ - 1, delay_of(i)), j, turn || weight_of(i) > little);
  }
  const auto at = static_cast<std::size_t>(recent_count_++) % recent;
  recent_at_[at] = cycles_ - 1;
  recent_j_[at] = j;
  weigh(log_likely.data());
  mix();
}

void CurveFilter::weigh(const double* log_likely) noexcept {
  const auto update = [](std::vector<double>& weights, const auto& log_of, double chance, const auto& prior_of) {
    double highest = log_of(0), sum = 0.0;
    for (std::size_t i = 1; i < weights.size(); ++i)
      highest = std::max(highest, log_of(i));
    for (std::size_t i = 0; i < weights.size(); ++i)
      sum += weights[i] *= std::exp(log_of(i) - highest);
    for (std::size_t i = 0; i < weights.size(); ++i)
      weights[i] = (1.0 - chance) * weights[i] / sum + chance * prior_of(i);
  };
  const auto told = static_cast<std::size_t>(settings_.earlier);
  update(
      delay_weights_, [&](std::size_t d) { return log_likely[d]; }, change,
      [&](std::size_t d) {
        return delays_ == 1 ? 1.0 : d == told ? told_prior : (1.0 - told_prior) / static_cast<double>(delays_ - 1);
      });
  update(
      assumption_weights_, [&](std::size_t i) { return log_likely[i == 0 ? leader() : delays_ + i - 1]; },
      assumption_change, [&](std::size_t i) { return assumptions[i].prior; });
  const auto best = std::max_element(delay_weights_.begin(), delay_weights_.end()) - delay_weights_.begin();
  if (best == leader_) return;
  leader_ = best;
  for (std::size_t i = delays_; i < banks_.size(); ++i)
    banks_[i].take_over(banks_[leader()]);
}

double CurveFilter::weight_of(std::size_t bank) const noexcept {
  const double delay = delay_weights_[delay_of(bank)];
  if (bank < delays_ && bank != leader()) return delay;
  return delay * assumption_weights_[bank < delays_ ? 0 : bank - delays_ + 1];
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

void CurveFilter::forget(double kept) noexcept {
  const auto known = std::min<std::int64_t>(recent_count_, recent);
  for (std::size_t b = 0; b < banks_.size(); ++b) {
    banks_[b].fade(kept);
    for (std::int64_t i = recent_count_ - known; i < recent_count_; ++i) {
      const auto at = static_cast<std::size_t>(i) % recent;
      const std::int64_t cycle = recent_at_[at];
      if (cycles_ - cycle <= static_cast<std::int64_t>(recent)) {
        banks_[b].add(prior_, drops_at(cycle, delay_of(b)), recent_j_[at]);
      }
    }
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
  const double about = banks_[leader()].predict(prior_, drops).mean;
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
