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
constexpr std::array<Shape, CurveFilter::shapes> shape_table{{{1.0, 1.0, 0.0}, {steep, 1.0, rare}, {1.0, steep, rare}}};

constexpr double curvature_reach = 0.3;  // of the prior's sd: second differences and the guess of the noise
constexpr double guess_counts = 4.0;     // readings that the first guess of the noise is worth
constexpr double least_scale = 0.1;      // a curve flatter than this, or upside down, is hardly believed
constexpr double scale_penalty = 1500.0;
// Of the variance that fading leaves: closed loops read more than their dither does. Makes the stated 95 % hold.
constexpr double calibrated = 0.5;

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

CurveFilter::CurveFilter(const CurveFilterSettings& settings, const Curve& curve) noexcept
    : settings_(settings),
      per_lag_(settings.lag_cycles > 0.0 ? -std::expm1(-1.0 / settings.lag_cycles) : 1.0),
      fading_(std::exp(-1.0 / settings.memory_cycles)) {
  for (Column& sum : sums_)
    sum.setZero();
  for (Column& drops : recent_drops_)
    drops.setZero();
  restart(curve, curve.best(), settings.prior_sd);
}

void CurveFilter::expect(const Curve& curve, double mean, double sd) noexcept {
  curve_ = curve;
  bend_ = curve.curvature(curvature_reach * settings_.prior_sd);
  prior_mean_ = mean;
  prior_extra_ = std::max(0.0, 1.0 / (sd * sd) - 1.0 / (settings_.prior_sd * settings_.prior_sd));
}

double CurveFilter::prior_precision() const noexcept {
  return 1.0 / (settings_.prior_sd * settings_.prior_sd) + prior_extra_;
}

void CurveFilter::restart(const Curve& curve, double mean, double sd) noexcept {
  expect(curve, mean, sd);
  count_ = count_squared_ = weight_ = y_ = yy_ = 0.0;
  recent_count_ = 0;
  started_ = false;
  for (const Sum sum : {c, cc, cy})
    sums_[sum].setZero();
  if (!(variance_ > 0.0)) variance_ = guessed_variance();  // what was learnt of the noise stays
  judge();
}

void CurveFilter::believe(const Curve& curve, double sd) noexcept {
  expect(curve, curve.best(), sd);
  judge();
}

double CurveFilter::guessed_variance() const noexcept {
  if (settings_.noise_sd) return *settings_.noise_sd * *settings_.noise_sd;
  const double drop = 0.5 * bend_ * std::pow(curvature_reach * settings_.prior_sd, 2);
  return drop * drop;
}

void CurveFilter::fill_drops(double input, Column& drops) const noexcept {
  const double step = (settings_.upper - settings_.lower) / (places - 1);
  const double best = curve_.best(), top = curve_.top();
  for (std::size_t s = 0; s < shape_table.size(); ++s) {
    const double per_below = 1.0 / shape_table[s].below, per_above = 1.0 / shape_table[s].above;
    for (int i = 0; i < places; ++i) {
      const double away = input - (settings_.lower + step * i);
      drops[static_cast<Eigen::Index>(s) * places + i] =
          curve_(best + away * (away < 0.0 ? per_below : per_above)) - top;
    }
  }
}

void CurveFilter::pass(double input) noexcept {
  Column drops;
  fill_drops(input, drops);
  sums_[lagged] += (started_ ? per_lag_ : 1.0) * (drops - sums_[lagged]);  // settled before the first cycle
  started_ = true;
}

void CurveFilter::learn(double input, double j) noexcept {
  pass(input);
  if (!(count_ > 0.0)) origin_ = j;
  prior_extra_ *= fading_ * fading_;  // sooner than the readings, or a guide that is wrong would draw the end to itself
  add(sums_[lagged], j);
  const auto at = static_cast<std::size_t>(recent_count_++) % recent;
  recent_drops_[at] = sums_[lagged];
  recent_j_[at] = j;
  judge();
}

void CurveFilter::add(const Column& drops, double j) noexcept {
  const double value = j - origin_;
  const double error = settings_.discrepancy * (sums_[share] * drops).sum();
  const double own = variance_ / (variance_ + error * error);
  count_ = fading_ * count_ + 1.0;
  count_squared_ = fading_ * fading_ * count_squared_ + 1.0;
  weight_ = fading_ * weight_ + own;
  y_ = fading_ * y_ + own * value;
  yy_ = fading_ * yy_ + own * (value * value);
  sums_[c] = fading_ * sums_[c] + own * drops;
  sums_[cc] = fading_ * sums_[cc] + own * drops.square();
  sums_[cy] = fading_ * sums_[cy] + (own * value) * drops;
}

void CurveFilter::forget(double kept) noexcept {
  for (double* sum : {&count_, &weight_, &y_, &yy_})
    *sum *= kept;
  count_squared_ *= kept * kept;
  for (const Sum sum : {c, cc, cy})
    sums_[sum] *= kept;
  const auto known = std::min<std::int64_t>(recent_count_, recent);
  for (std::int64_t i = recent_count_ - known; i < recent_count_; ++i) {
    const auto at = static_cast<std::size_t>(i) % recent;
    add(recent_drops_[at], recent_j_[at]);
  }
  judge();
}

// Posterior of every hypothesis from its sums: S is normal about 1, o flat, the noise an inverse gamma.
void CurveFilter::judge() noexcept {
  const double guess = guessed_variance();
  const double counts = guess_counts + std::max(0.0, weight_ - 1.0);
  const double per_scale = variance_ / (settings_.scale_sd * settings_.scale_sd);
  const double step = (settings_.upper - settings_.lower) / (places - 1);
  Column residual = Column::Constant(guess_counts * guess), log_of = Column::Zero();
  sums_[own_scale].setOnes();
  if (count_ > 0.0) {
    const double per = 1.0 / weight_;
    const Column bend = (sums_[cc] - per * sums_[c].square()).max(0.0);
    const Column cross = sums_[cy] - (per * y_) * sums_[c];
    const double rest = yy_ - per * y_ * y_;
    const Column precision = per_scale + bend;
    sums_[own_scale] += (cross - bend) / precision;
    residual += (rest - 2.0 * cross + bend - (cross - bend).square() / precision).max(0.0);
    log_of = -0.5 * (precision * (1.0 / per_scale)).log();
  }
  log_of -= 0.5 * counts * residual.log();
  const Column flat = (least_scale - sums_[own_scale]).max(0.0);
  log_of -= scale_penalty * flat.square();
  for (std::size_t s = 0; s < shape_table.size(); ++s) {
    for (int i = 0; i < places; ++i) {
      const double away = settings_.lower + step * i - prior_mean_;
      log_of[static_cast<Eigen::Index>(s) * places + i] +=
          shape_table[s].log_prior - 0.5 * away * away * prior_precision();
    }
  }
  sums_[share] = (log_of - log_of.maxCoeff()).exp();
  sums_[share] /= sums_[share].sum();
  double mean = 0.0, square = 0.0;
  for (int k = 0; k < hypotheses; ++k) {
    const double place = step * (k % places);
    mean += sums_[share][k] * place;
    square += sums_[share][k] * place * place;
  }
  mean_ = settings_.lower + mean;
  spread_ = std::sqrt(std::max(0.0, square - mean * mean));
  scale_ = (sums_[share] * sums_[own_scale]).sum();
  const double left = (sums_[share] * residual).sum();
  variance_ = left / counts;
  unexplained_ = count_ > 1.0 ? std::max(0.0, left - guess_counts * guess) / weight_ : 0.0;
}

CurveFilter::Prediction CurveFilter::predict(double input) const noexcept {
  Column drops;
  fill_drops(input, drops);
  if (per_lag_ < 1.0) drops = (sums_[lagged] + per_lag_ * (drops - sums_[lagged])).eval();
  if (!(count_ > 0.0)) return {0.0, std::numeric_limits<double>::infinity()};
  const double per = 1.0 / weight_;
  const Column away = drops - per * sums_[c];
  const Column means = per * y_ + sums_[own_scale] * away;
  const double per_scale = variance_ / (settings_.scale_sd * settings_.scale_sd);
  const Column bend = (sums_[cc] - per * sums_[c].square()).max(0.0);
  const Column variances =
      variance_ * (1.0 + per + away.square() / (per_scale + bend)) + (settings_.discrepancy * drops).square();
  const double mean = (sums_[share] * means).sum();
  const double variance = (sums_[share] * (variances + (means - mean).square())).sum();
  return {origin_ + mean, variance};
}

double CurveFilter::faded_sd(double factor) const noexcept {
  const double of_prior = std::min(1.0, spread_ * spread_ * prior_precision());
  const double left = count_ > 1.0 ? count_squared_ / count_ : 1.0;  // sum of w^2 over sum of w: Liang and Zeger 1986
  return spread_ * std::sqrt(of_prior + (1.0 - of_prior) * left * factor);
}

double CurveFilter::stated_sd() const noexcept {
  return faded_sd(calibrated);
}
double CurveFilter::noise_sd() const noexcept {
  return std::sqrt(variance_);
}
double CurveFilter::curvature() const noexcept {
  return bend_ * std::max(scale_, 2.0 * least_scale);
}

}  // namespace mgdd::guide
