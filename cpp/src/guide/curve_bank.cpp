#include "mgdd/guide/curve_bank.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mgdd::guide {
namespace {

struct ScaleClass {
  double mean, spread, log_prior;  // of S; `spread` over the mean, 0: as the settings say
};
constexpr double other = -6.0;  // a guide in another unit, or far too steep or flat: before any reading
constexpr std::array<ScaleClass, CurveBank::classes> class_table{{{0.01, 0.6, other},
                                                                  {0.0464, 0.6, other},
                                                                  {0.215, 0.6, other},
                                                                  {1.0, 0.0, 0.0},
                                                                  {4.64, 0.6, other},
                                                                  {21.5, 0.6, other},
                                                                  {100.0, 0.6, other}}};
constexpr double flat_log_prior = -6.0;  // J that does not answer, of each class
constexpr double guess_counts = 4.0;     // readings that the first guess of the noise is worth
constexpr double least_scale = 0.1;      // of a class: a curve flatter belongs to another one
constexpr double negligible = 1e-2;      // share of a class that is looked at only now and then
constexpr double negligible_place = 1e-4;
constexpr double most_remembered = -10.0, slowly = 0.0005, class_learnt = 30.0;
constexpr int margin = 4;               // places beyond those that count
constexpr double noise_learnt = 12.0;   // readings that tell the noise better than the curve does
constexpr double least_noise = 0.0025;  // of the guess: what a plant without noise leaves
constexpr std::int64_t now_and_then = 16;
constexpr double per_root_two_pi = 0.5 * std::numbers::inv_sqrtpi * std::numbers::sqrt2;

using Part = Eigen::Array<double, Eigen::Dynamic, 1, 0, CurveBank::places, 1>;

}  // namespace

CurveBank::CurveBank(const Assumed& assumed) noexcept
    : assumed_(assumed), fading_(std::exp(-1.0 / assumed.memory_cycles)) {
  for (Column* column : {&level_, &slope_, &bend_, &cross_, &share_, &own_scale_, &scale_variance_})
    column->setZero();
}

void CurveBank::restart(const Prior& prior) noexcept {
  count_ = count_squared_ = weight_ = rest_ = level_variance_ = level_j_ = slope_j_ = 0.0;
  covariance_ = slope_variance_ = remembered_flat_ = 0.0;
  judged_ = 0;
  phase_ = 0.0;
  remembered_.fill(0.0);
  for (Column* column : {&level_, &slope_, &bend_, &cross_})
    column->setZero();
  for (std::size_t k = 0; k < classes; ++k) {
    const double unit = prior.noise_told ? 1.0 : class_table[k].mean * class_table[k].mean;
    if (!(class_variance_[k] > 0.0)) class_variance_[k] = prior.noise_variance * unit;
  }
  if (!(noise_variance_ > 0.0)) noise_variance_ = prior.noise_variance;
  judge(prior);
}

double CurveBank::own_weight(const Prior& prior, const Column& drops) const noexcept {
  const double error = prior.discrepancy * scale_ * (share_ * drops).sum();
  return noise_variance_ / (noise_variance_ + error * error);
}

// Beyond half a step every place is taken for its neighbour: hypotheses keep their sums, none is interpolated.
void CurveBank::move(const Prior& prior) noexcept {
  phase_ += assumed_.velocity;
  mean_ += assumed_.velocity * prior.step;
  if (!(std::abs(phase_) > 0.5)) return;
  const std::int64_t by = phase_ > 0.0 ? 1 : -1;
  const Eigen::Index to = phase_ > 0.0 ? 1 : 0;
  phase_ -= static_cast<double>(by);
  from_ = std::clamp<std::int64_t>(from_ + by, 0, places - 1);
  to_ = std::clamp<std::int64_t>(to_ + by, from_ + 1, places);
  for (Column* column : {&level_, &slope_, &bend_, &cross_, &share_, &own_scale_, &scale_variance_}) {
    for (std::size_t s = 0; s < shapes; ++s) {
      auto own = column->segment(static_cast<Eigen::Index>(s) * places, places);
      own.segment(to, places - 1) = own.segment(1 - to, places - 1).eval();
    }
  }
}

// These drops of the places where they are now; `room` serves where they have moved.
const CurveBank::Column& CurveBank::moved(const Column& drops, Column& room) const noexcept {
  if (phase_ == 0.0) return drops;  // NOLINT(bugprone-return-const-ref-from-parameter): of the caller
  const Eigen::Index to = phase_ > 0.0 ? 0 : 1;
  room = drops;
  for (std::size_t s = 0; s < shapes; ++s) {
    const auto at = static_cast<Eigen::Index>(s) * places;
    room.segment(at + to, places - 1) +=
        std::abs(phase_) * (drops.segment(at + 1 - to, places - 1) - drops.segment(at + to, places - 1));
  }
  return room;
}

void CurveBank::add(const Prior& prior, const Column& unmoved, double j, double heard) noexcept {
  Column room;
  const Column& drops = moved(unmoved, room);
  const double own = heard * own_weight(prior, drops);
  if (count_ > 0.0) {
    advance();
    const double total = level_variance_ + 1.0 / own, per = 1.0 / total;
    const double gain = level_variance_ * per, slope_gain = covariance_ * per;
    const Column away = drops - level_;
    const double y = j - level_j_;
    bend_ = fading_ * bend_ + per * away.square();
    cross_ = fading_ * cross_ + (per * y) * away;
    rest_ = fading_ * rest_ + per * y * y;
    level_ += gain * away;
    level_j_ += gain * y;
    if (assumed_.slope > 0.0) {
      slope_ += slope_gain * away;
      slope_j_ += slope_gain * y;
      slope_variance_ -= slope_gain * covariance_;
      covariance_ *= 1.0 - gain;
    }
    level_variance_ *= 1.0 - gain;
  } else {
    level_ = drops;
    level_j_ = j;
    level_variance_ = 1.0 / own;
    slope_.setZero();
    slope_j_ = covariance_ = 0.0;
    slope_variance_ = assumed_.slope * assumed_.slope;
  }
  count_ = fading_ * count_ + 1.0;
  count_squared_ = fading_ * fading_ * count_squared_ + 1.0;
  weight_ = fading_ * weight_ + own;
}

// One cycle on: the level follows its slope, and less is known of both.
void CurveBank::advance() noexcept {
  if (assumed_.slope > 0.0) {
    level_ += slope_;
    level_j_ += slope_j_;
  }
  level_variance_ = (level_variance_ + 2.0 * covariance_ + slope_variance_) / fading_ + assumed_.drift;
  covariance_ = (covariance_ + slope_variance_) / fading_;
  slope_variance_ = slope_variance_ / fading_;
  const double most = assumed_.slope * assumed_.slope;
  if (slope_variance_ > most) {
    covariance_ *= most / slope_variance_;
    slope_variance_ = most;
  }
}

double CurveBank::level_variance() const noexcept {
  return (level_variance_ + 2.0 * covariance_ + slope_variance_) / fading_ + assumed_.drift;
}

CurveBank::Foretold CurveBank::foretell(const Prior& prior, const Column& unmoved, double j) const noexcept {
  Column room;
  const Column& drops = moved(unmoved, room);
  const double base = noise_variance_ * (level_variance() + 1.0);
  const double known = level_j_ + slope_j_, off = j - known;
  double seen = 0.0, likely = 0.0, mean = 0.0, square = 0.0;
  for (std::size_t s = 0; s < shapes; ++s) {
    const auto at = static_cast<Eigen::Index>(s) * places + from_, size = static_cast<Eigen::Index>(to_ - from_);
    const Part away = drops.segment(at, size) - level_.segment(at, size) - slope_.segment(at, size);
    // What a wrong curve errs by is alike at like inputs, and the level has taken it: what is left goes by `away`.
    const Part variance =
        base + (scale_variance_.segment(at, size) + (prior.discrepancy * own_scale_.segment(at, size)).square()) *
                   away.square();
    const Part means = own_scale_.segment(at, size) * away;
    const auto share = share_.segment(at, size);
    likely += (share * (-0.5 * (off - means).square() / variance).exp() / variance.sqrt()).sum();
    seen += share.sum();
    mean += (share * means).sum();
    square += (share * (variance + means.square())).sum();
  }
  const double per = 1.0 / std::max(seen, 1e-300);
  mean *= per;
  return {{known + mean, std::max(base, square * per - mean * mean)}, per_root_two_pi * likely * per};
}

void CurveBank::fade(double kept) noexcept {
  for (double* sum : {&count_, &weight_, &rest_})
    *sum *= kept;
  count_squared_ *= kept * kept;
  bend_ *= kept;
  cross_ *= kept;
  level_variance_ /= kept;
  covariance_ = 0.0;
  slope_variance_ = assumed_.slope * assumed_.slope;
  remembered_.fill(0.0);
  remembered_flat_ = 0.0;
}

void CurveBank::take_over(const CurveBank& other) noexcept {
  const Assumed own = assumed_;
  const double fading = fading_;
  *this = other;
  assumed_ = own;
  fading_ = fading;
}

double CurveBank::noise_guess(const Prior& prior, std::size_t k) const noexcept {
  const double unit = prior.noise_told ? 1.0 : class_table[k].mean * class_table[k].mean;
  if (prior.noise_told || count_ < noise_learnt) return prior.noise_variance * unit;
  return std::max(noise_variance_, least_noise * prior.noise_variance * scale_ * scale_);
}

// Between two looks at everything only the places that may count are looked at.
void CurveBank::find_places(double total) noexcept {
  const auto counts = [&](std::int64_t i) {
    return share_[i] + share_[i + places] + share_[i + std::int64_t{2} * places] > negligible_place * total;
  };
  from_ = 0;
  to_ = places;
  while (from_ < to_ && !counts(from_))
    ++from_;
  while (to_ > from_ && !counts(to_ - 1))
    --to_;
  from_ = std::max<std::int64_t>(0, from_ - margin);
  to_ = std::min<std::int64_t>(places, to_ + margin);
}

// The unit of a guide does not change as the place of its optimum does: what once spoke against a class fades slowly.
void CurveBank::remember() noexcept {
  const auto evidence = [&](std::size_t k) {
    return std::log(std::max(class_share_[k], 1e-30)) - class_table[k].log_prior - remembered_[k];
  };
  const auto best =
      static_cast<std::size_t>(std::max_element(class_share_.begin(), class_share_.end()) - class_share_.begin());
  const double highest = evidence(best);
  for (std::size_t k = 0; k < classes; ++k) {
    if (!(class_share_[k] > 0.0)) continue;
    const double against = std::clamp(evidence(k) - highest, most_remembered, 0.0);
    remembered_[k] += (against < remembered_[k] ? 1.0 : slowly) * (against - remembered_[k]);
  }
  const double flat = std::log(std::max(flat_share_, 1e-30) / std::max(1.0 - flat_share_, 1e-30));
  const double against = std::clamp(flat - flat_log_prior - remembered_flat_, most_remembered, 0.0);
  remembered_flat_ += (against < remembered_flat_ ? 1.0 : slowly) * (against - remembered_flat_);
}

// Posterior of every hypothesis from its sums, the noise an inverse gamma.
void CurveBank::judge(const Prior& prior) noexcept {
  const double counts = guess_counts + std::max(0.0, weight_ - 1.0);
  const bool all = count_ < static_cast<double>(now_and_then) || judged_ % now_and_then == 0;
  ++judged_;
  if (all) {
    from_ = 0;
    to_ = places;
  }
  const auto size = static_cast<Eigen::Index>(to_ - from_);
  struct Looked {
    std::array<Part, shapes> log_of, scale, left, precision;
    double flat = 0.0, guess = 0.0;
    bool seen = false;
  };
  std::array<Looked, classes> looked;
  double highest = -1e300;
  for (std::size_t k = 0; k < classes; ++k) {
    Looked& l = looked[k];
    l.seen = all || class_share_[k] > negligible;
    if (!l.seen) continue;
    const auto [m, relative, log_prior] = class_table[k];
    const double sd = relative > 0.0 ? relative * m : prior.scale_sd;
    l.guess = guess_counts * noise_guess(prior, k);
    const double per_scale = class_variance_[k] / (sd * sd), per = 1.0 / per_scale;
    const double guessed = 0.5 * guess_counts * std::log(l.guess) + log_prior + remembered_[k];
    for (std::size_t s = 0; s < shapes; ++s) {
      const auto at = static_cast<Eigen::Index>(s) * places + from_;
      const auto bend = bend_.segment(at, size), cross = cross_.segment(at, size);
      l.precision[s] = per_scale + bend;
      const Part pull = (cross - m * bend) / l.precision[s];
      // A curve upside down has its worst at its place: the readings are held against the flattest that is none.
      l.scale[s] = (m + pull).max(least_scale * m);
      const Part held = l.scale[s] - m - pull;
      l.left[s] = l.guess + (rest_ - 2.0 * m * cross + m * m * bend - pull.square() * l.precision[s]).max(0.0) +
                  held.square() * l.precision[s];
      l.log_of[s] = prior.log_of.segment(at, size) + guessed - 0.5 * (l.precision[s] * per).log() -
                    0.5 * counts * l.left[s].log();
      highest = std::max(highest, l.log_of[s].maxCoeff());
    }
    l.flat = guessed + flat_log_prior + remembered_flat_ - 0.5 * counts * std::log(l.guess + rest_);
    highest = std::max(highest, l.flat);
  }
  share_.setZero();
  Column scale = Column::Zero(), square = Column::Zero();
  std::array<double, classes> class_mean{}, class_square{};
  double flat_sum = 0.0, total = 0.0, left_sum = 0.0, variance_sum = 0.0;
  for (std::size_t k = 0; k < classes; ++k) {
    const Looked& l = looked[k];
    if (!l.seen) continue;
    const double flat = std::exp(l.flat - highest) * prior.mass;
    double sum = 0.0, left = 0.0, first = 0.0, second = 0.0;
    for (std::size_t s = 0; s < shapes; ++s) {
      const auto at = static_cast<Eigen::Index>(s) * places + from_;
      const Part likely = (l.log_of[s] - highest).exp();
      share_.segment(at, size) += likely;
      scale.segment(at, size) += likely * l.scale[s];
      square.segment(at, size) += likely * (l.left[s] / (counts * l.precision[s]) + l.scale[s].square());
      sum += likely.sum();
      const Part weighted = likely * prior.place.segment(from_, size);
      first += weighted.sum();
      second += (weighted * prior.place.segment(from_, size)).sum();
      left += (likely * l.left[s]).sum();
    }
    left += flat * (l.guess + rest_);
    class_mean[k] = first / std::max(sum, 1e-300);
    class_square[k] = second / std::max(sum, 1e-300);
    class_share_[k] = sum + flat;
    class_variance_[k] = left / (counts * std::max(class_share_[k], 1e-300));
    variance_sum += left / counts;
    left_sum += left - class_share_[k] * l.guess;
    flat_sum += flat;
    total += class_share_[k];
  }
  for (std::size_t k = 0; k < classes; ++k)
    class_share_[k] = looked[k].seen ? class_share_[k] / total : 0.0;
  flat_share_ = flat_sum / total;
  if (count_ > class_learnt) remember();
  find_places(total);
  const Column per = 1.0 / share_.max(1e-300);
  own_scale_ = scale * per;
  scale_variance_ = (square * per - own_scale_.square()).max(0.0);
  scale_ = scale.sum() / total;
  share_ = (share_ + (flat_sum / prior.mass) * prior.mass_of) / total;
  own_scale_ *= 1.0 - flat_share_;
  noise_variance_ = variance_sum / total;
  unexplained_ = count_ > 1.0 ? std::max(0.0, left_sum / total) / weight_ : 0.0;
  double mean = 0.0, spread = 0.0;
  for (int i = 0; i < places; ++i) {
    const double here = share_[i] + share_[i + places] + share_[i + 2 * places], place = prior.place[i];
    mean += here * place;
    spread += here * place * place;
  }
  mean_ = prior.first + mean + phase_ * prior.step;
  spread_ = std::sqrt(std::max(0.0, spread - mean * mean));
  double usual = 0.0;
  for (std::size_t k = 0; k < classes; ++k) {
    const double about = class_square[k] - mean * (2.0 * class_mean[k] - mean);
    if (class_share_[k] > 0.0) usual += class_share_[k] * std::log(std::max(about, 1e-12 * prior.step * prior.step));
  }
  usual_spread_ = std::exp(0.5 * usual);
}

CurveBank::Prediction CurveBank::predict(const Prior& prior, const Column& unmoved) const noexcept {
  Column room;
  const Column& drops = moved(unmoved, room);
  const double level = level_variance();
  const Column away = drops - level_ - slope_;
  const Column means = own_scale_ * away;
  const Column variances = noise_variance_ * (1.0 + level) + scale_variance_ * away.square() +
                           (prior.discrepancy * own_scale_ * drops).square();
  const double mean = (share_ * means).sum();
  return {level_j_ + slope_j_ + mean, (share_ * (variances + (means - mean).square())).sum()};
}

double CurveBank::faded_sd(const Prior& prior, double spread) const noexcept {
  const double of_prior = std::min(1.0, spread * spread * prior.precision);
  const double left = count_ > 1.0 ? count_squared_ / count_ : 1.0;  // sum of w^2 over sum of w: Liang and Zeger 1986
  return spread * std::sqrt(of_prior + (1.0 - of_prior) * left);
}

}  // namespace mgdd::guide
