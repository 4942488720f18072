// How a process finds its numbers: evidence, priors and the trials that follow them.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/belief/process_model.hpp"
#include "mgdd/optimize/belief/row_cholesky.hpp"

namespace mgdd::optimize {
namespace {

// Priors of logarithms.
constexpr double noise_prior = -5.3, noise_prior_sd = 1.5;
constexpr double rest_prior_sd = 1.5;
constexpr double length_prior = -0.7, length_prior_sd = 0.7;
constexpr double expected_sd = 1.0;  // of a bend, by itself or of a guide: two readings alike are no plane
constexpr double settled_sd = 0.4;   // of the bend, once the first readings have shown it
constexpr double bend_search_sd = 1.5;
constexpr double factor_width = 0.5;  // of what the guide counts by: heavy tails
constexpr double useless_factor = -6.0;
constexpr double wander_place = 0.04, wander_level = 1.2;  // in a memory: slopes in bends, the level in noise
constexpr double wander_sd = 1.0;                          // of their logarithms
constexpr double coarse_step = 0.8, fine_step = 0.25;
constexpr double bend_offsets[] = {0.0, -0.7, 0.7, 1.4};  // logarithms; what is learnt first
constexpr double least_rise = 1e-100;                     // of which the square, with its jitter, is still above 0
constexpr double rarity = 10.0;                           // of an outlier, logarithm
constexpr double far_out = 1.0;                           // of the range of all others
constexpr double lowest_log = -12.0, highest_log = 3.0;

double log_prior(double value, double middle, double sd) noexcept {
  const double off = (value - middle) / sd;
  return -0.5 * off * off;
}

}  // namespace

ProcessModel::Scales ProcessModel::scales_of(const Numbers& numbers) const noexcept {
  Scales out;
  out.bend = std::exp(numbers[0]);
  out.guide = kernel_.guided() ? std::exp(numbers[numbers.size() - 1]) : 0.0;
  const double noise = settings_.noise_sd.value_or(std::max(out.bend * std::exp(numbers[1]), std::sqrt(within_))),
               rest = std::exp(numbers[2]);
  out.noise_variance = noise * noise;
  out.rest = rest * rest;
  const double place = std::exp(numbers[3 + settings_.inputs]), level = std::exp(numbers[4 + settings_.inputs]);
  const double walk = settings_.wander * level * wander_level,
               wide = settings_.wander * wander_place * place * kernel_.whole_bend(out);
  out.wander_slope = wide * wide / settings_.memory;
  out.wander_level = walk * walk * out.noise_variance / settings_.memory;
  out.inverse_length = (-numbers.segment(3, settings_.inputs)).array().exp().matrix();
  return out;
}

// The newest half of those that the evidence is taken of, and of the others those farthest away: these show the bend.
void ProcessModel::choose_readings(const Inputs& about) noexcept {
  const auto begin = order_.begin(), end = begin + count_;
  std::iota(begin, end, 0);
  const auto most = std::min<std::int64_t>(count_, evidence_readings);
  if (count_ > most) {
    std::sort(begin, end, [&](int a, int b) { return ages_[a] < ages_[b] || (ages_[a] == ages_[b] && a < b); });
    for (std::int64_t i = 0; i < count_; ++i)
      distance_[i] = squared_distance(i, about);
    std::sort(begin + most / 2, end,
              [&](int a, int b) { return distance_[a] > distance_[b] || (distance_[a] == distance_[b] && a < b); });
  }
  std::copy(begin, begin + most, chosen_.begin());
}

// Logarithm of the likelihood of the chosen readings times the priors; the lengths may be those of the tables.
double ProcessModel::evidence(const Numbers& numbers, bool same_lengths) noexcept {
  const Scales s = scales_of(numbers);
  const auto n = std::min<std::int64_t>(count_, evidence_readings);
  for (std::int64_t a = 0; a < n; ++a) {
    const int one = chosen_[static_cast<std::size_t>(a)];
    small_rest_[a] = values_[one] - level_ - kernel_.mean(&points_(one, 0), s);
    for (std::int64_t b = 0; b <= a; ++b) {
      const int other = chosen_[static_cast<std::size_t>(b)], i = std::max(one, other), j = std::min(one, other);
      const double matern =
          same_lengths ? matern_(i, j) : kernel_.matern(&points_(i, 0), &points_(j, 0), s.inverse_length);
      small_(a, b) = kernel_.join({quadratic_(i, j), guide_(i, j)}, matern, s) +
                     wandered(&points_(i, 0), &points_(j, 0), std::min(ages_[i], ages_[j]), s);
    }
    small_(a, a) += noise_of(one, s) + jitter * s.bend * s.bend;
  }
  cholesky(small_, n);
  solve_lower(small_, n, small_rest_.data());
  double out = -0.5 * dot(small_rest_.data(), small_rest_.data(), n);
  for (std::int64_t a = 0; a < n; ++a)
    out -= std::log(small_(a, a));
  out += log_priors(numbers, s);
  return std::isfinite(out) ? out : -std::numeric_limits<double>::infinity();
}

// The bend integrated out by a few points (Rasmussen and Williams 2006, eq. 5.3): one alone promises too much.
ProcessModel::Correction ProcessModel::over_bends(const Inputs& z) noexcept {
  if (told_ > evidence_readings) return {};  // nothing is open any more
  std::array<double, std::size(bend_offsets)> weight{}, mean{}, variance{};
  const auto n = std::min<std::int64_t>(count_, evidence_readings);
  kernel_.describe(z, &asked_(0, 0));
  const double* const point = &asked_(0, 0);
  double most = 0.0;
  for (std::size_t k = 0; k < weight.size(); ++k) {
    Numbers numbers = numbers_;
    numbers[0] += bend_offsets[k];
    numbers[1] -= bend_offsets[k];  // the noise stays
    weight[k] = evidence(numbers, true);
    const Scales s = scales_of(numbers);
    for (std::int64_t a = 0; a < n; ++a)
      mean_of_[a] = kernel_.covariance(point, &points_(chosen_[static_cast<std::size_t>(a)], 0), s);
    solve_lower(small_, n, mean_of_.data());
    mean[k] = kernel_.mean(point, s) + dot(mean_of_.data(), small_rest_.data(), n);
    variance[k] = kernel_.covariance(point, point, s) - dot(mean_of_.data(), mean_of_.data(), n);
    most = k == 0 ? weight[k] : std::max(most, weight[k]);
  }
  if (!std::isfinite(most)) return {};
  double sum = 0.0;
  for (double& one : weight)
    sum += one = std::exp(one - most);
  Correction out;
  for (std::size_t k = 0; k < weight.size(); ++k)
    out.mean += weight[k] / sum * (mean[k] - mean[0]);
  for (std::size_t k = 0; k < weight.size(); ++k) {
    const double off = mean[k] - mean[0] - out.mean;
    out.variance += weight[k] / sum * (variance[k] - variance[0] + off * off);
  }
  return out;
}

double ProcessModel::log_priors(const Numbers& numbers, const Scales& s) const noexcept {
  const double whole = std::log(kernel_.whole_bend(s));
  double out = log_prior(0.5 * std::log(s.noise_variance) - whole, noise_prior, noise_prior_sd) +
               log_prior(numbers[2], settings_.rest, rest_prior_sd);
  for (Eigen::Index i = 0; i < settings_.inputs; ++i)
    out += log_prior(numbers[3 + i], length_prior, length_prior_sd);
  for (Eigen::Index i = 3 + settings_.inputs; i < 5 + settings_.inputs; ++i)
    out += log_prior(numbers[i], 0.0, settings_.wander_sd);
  if (kernel_.guided()) {
    const double factor = numbers[numbers.size() - 1] / factor_width;
    out += log_prior(numbers[0] - whole, settings_.missed, settings_.missed_sd) - std::log1p(factor * factor);
  }
  if (settings_.bend) {
    out += kernel_.guided() ? log_prior(whole, std::log(kernel_.guide_bend()), expected_sd)
                            : log_prior(numbers[0], std::log(*settings_.bend), expected_sd);
  }
  if (settled_bend_) out += log_prior(numbers[0], *settled_bend_, settled_sd);
  return out;
}

// Under a wrong input the numbers have gone wrong too: those that the readings suggest by themselves are tried beside.
double ProcessModel::likelihood(const InputTable& at, const Eigen::VectorXd& values, const Eigen::VectorXd& ages,
                                int count) noexcept {
  const Inputs wide = at.topRows(count).colwise().maxCoeff() - at.topRows(count).colwise().minCoeff();
  const double rise = values.head(count).maxCoeff() - values.head(count).minCoeff();
  Numbers plain = numbers_;
  plain[0] = std::log(std::max(rise, 1e-300) / (0.3 * std::max(wide.norm(), 1e-6)));
  plain[1] = noise_prior;
  plain[2] = settings_.rest;
  plain.segment(3, settings_.inputs).setConstant(length_prior);
  plain.segment(3 + settings_.inputs, 2).setZero();
  double most = likelihood_by(numbers_, at, values, ages, count);
  for (int more = 0; more < 2; ++more, plain[1] += noise_prior_sd)
    most = std::max(most, likelihood_by(plain, at, values, ages, count));
  return most;
}

double ProcessModel::likelihood_by(const Numbers& numbers, const InputTable& at, const Eigen::VectorXd& values,
                                   const Eigen::VectorXd& ages, int count) noexcept {
  const Scales s = scales_of(numbers);
  const double level = values.head(count).mean();
  for (int a = 0; a < count; ++a) {
    kernel_.describe(at.row(a).transpose(), &asked_(a, 0));
    small_rest_[a] = values[a] - level - kernel_.mean(&asked_(a, 0), s);
    for (int b = 0; b <= a; ++b) {
      small_(a, b) = kernel_.covariance(&asked_(a, 0), &asked_(b, 0), s) +
                     wandered(&asked_(a, 0), &asked_(b, 0), std::min(ages[a], ages[b]), s);
    }
    small_(a, a) += s.noise_variance + jitter * s.bend * s.bend;
  }
  cholesky(small_, count);
  solve_lower(small_, count, small_rest_.data());
  double out = -0.5 * dot(small_rest_.data(), small_rest_.data(), count);
  for (int a = 0; a < count; ++a)
    out -= std::log(small_(a, a));
  return out;
}

// Logarithm of the factor by which the guide fits the readings best, 0 where they do not say.
double ProcessModel::guide_in_readings() const noexcept {
  double middle = 0.0, both = 0.0, squares = 0.0;
  for (std::int64_t i = 0; i < count_; ++i)
    middle += kernel_.guide_at(&points_(i, 0)) / static_cast<double>(count_);
  for (std::int64_t i = 0; i < count_; ++i) {
    const double off = kernel_.guide_at(&points_(i, 0)) - middle;
    both += off * values_[i];
    squares += off * off;
  }
  return both > 0.0 && squares > 0.0 ? std::log(both / squares) : 0.0;
}

// Logarithm of the bend that the spread of the readings suggests.
double ProcessModel::bend_in_readings() const noexcept {
  double low = largest_reading, high = -low, farthest = 1e-6;
  for (std::int64_t i = 0; i < count_; ++i) {
    if (!trusted(i)) continue;
    low = std::min(low, values_[i]);
    high = std::max(high, values_[i]);
    for (std::int64_t j = 0; j < i; ++j) {
      if (!trusted(j)) continue;
      farthest = std::max(farthest, (points_.row(i) - points_.row(j)).head(settings_.inputs).norm());
    }
  }
  const double spread = high - low, highest = std::max(std::abs(low), std::abs(high));
  const double rise = std::max({spread, 1e-9 * highest, settings_.noise_sd.value_or(0.0), least_rise});
  return std::log(rise / (0.3 * farthest));
}

// Of the height of the guide, or of what the readings span.
void ProcessModel::begin_numbers(bool by_guide) noexcept {
  numbers_[0] = bend_in_readings();
  numbers_[1] = noise_prior;
  numbers_[2] = settings_.rest;
  numbers_.segment(3, settings_.inputs).setConstant(length_prior);
  numbers_.segment(3 + settings_.inputs, 2).setZero();
  if (kernel_.guided()) numbers_[numbers_.size() - 1] = 0.0;
  if (by_guide) {
    numbers_[0] = std::log(kernel_.guide_bend()) + settings_.missed;
    numbers_[1] = noise_prior - settings_.missed;
  }
  begun_ = true;
}

// Of the first readings one that is far out of all others sets the scale of everything, although it may be wrong: what
// a fresh start makes of all of them, and of the others alone, is held against the numbers in use.
void ProcessModel::suspect() noexcept {
  std::int64_t high = -1, low = -1, wrong = -1;
  double next_high = -largest_reading, next_low = largest_reading;
  for (std::int64_t i = 0; i < count_; ++i) {
    if (!trusted(i)) continue;
    if (high < 0 || values_[i] > values_[high]) {
      if (high >= 0) next_high = values_[high];
      high = i;
    } else {
      next_high = std::max(next_high, values_[i]);
    }
    if (low < 0 || values_[i] < values_[low]) {
      if (low >= 0) next_low = values_[low];
      low = i;
    } else {
      next_low = std::min(next_low, values_[i]);
    }
  }
  if (high < 0) return;
  if (values_[high] - next_high > far_out * (next_high - values_[low])) wrong = high;
  if (next_low - values_[low] > far_out * (values_[high] - next_low)) wrong = low;
  if (wrong < 0) return;
  const Numbers known = numbers_;
  Numbers best = known;
  double most = evidence(known, true), scatter = 1.0;
  for (const bool left_out : {false, true}) {
    if (left_out) scatter_[wrong] = largest_reading;
    level_ = middle();
    begin_numbers(kernel_.guided());
    numbers_.segment(2, 3 + settings_.inputs) = known.segment(2, 3 + settings_.inputs);
    if (settings_.bend) {
      const double shift = std::log(*settings_.bend) - numbers_[0];
      numbers_[0] += shift;
      numbers_[1] -= shift;
    }
    const double off = values_[wrong] - level_;
    for (int more = 0; more < 3; ++more, numbers_[1] += noise_prior_sd) {
      if (left_out) scatter_[wrong] = std::max(1.0, off * off / scales_of(numbers_).noise_variance);
      const double found = evidence(numbers_, true) - (left_out ? rarity : 0.0);
      if (found <= most) continue;
      most = found;
      best = numbers_;
      scatter = scatter_[wrong];
    }
  }
  numbers_ = best;
  scatter_[wrong] = scatter;
  level_ = middle();
}

// Numbers drawn from the priors: the evidence has more than one top.
ProcessModel::Numbers ProcessModel::anew(std::uint64_t trial) const noexcept {
  const auto normal = [&](std::uint64_t stream) { return random::normal(settings_.seed, stream, trial); };
  Numbers out = numbers_;
  out[0] += bend_search_sd * normal(101);
  out[1] = noise_prior + noise_prior_sd * normal(102);
  out[2] = settings_.rest + rest_prior_sd * normal(103);
  out.segment(3, settings_.inputs).setConstant(length_prior);
  if (kernel_.guided()) {
    const double fitted[] = {guide_in_readings(), 0.0, useless_factor};
    out[out.size() - 1] = fitted[trial / 4 % 3] + factor_width * normal(104);
    // A guide that is too flat by far would have the noise explain what the readings say.
    if (trial / 4 % 3 == 2) out[0] = bend_in_readings() + bend_search_sd * normal(101);
  }
  return out;
}

void ProcessModel::try_numbers(int trials) noexcept {
  const Eigen::Index sizes = numbers_.size();
  double best = evidence(numbers_, true);
  for (std::int64_t t = told_ * trials; t < (told_ + 1) * trials; ++t) {
    const Eigen::Index which = t % sizes;
    const std::int64_t round = t / sizes;
    if (which == 1 && noise_known()) continue;
    const double width = round % 2 == 0 ? coarse_step : fine_step;
    const double step = width * random::normal(settings_.seed, 100, static_cast<std::uint64_t>(t));
    Numbers trial = numbers_;
    const bool jumps = told_ < more_readings && t % 4 == 3;
    if (jumps) {
      trial = anew(static_cast<std::uint64_t>(t));
    } else {
      trial[which] += step;
      if (which == 0 && round % 3 == 0) trial[1] -= step;  // the noise stays
    }
    if (trial[0] < std::log(least_rise)) continue;  // readings all alike: ever smaller is ever likelier
    const auto bounded = trial.segment(1, 2 + settings_.inputs);
    if (bounded.minCoeff() < lowest_log || bounded.maxCoeff() > highest_log) continue;
    const double found = evidence(trial, !jumps && (which < 3 || which >= 3 + settings_.inputs));
    if (found <= best) continue;
    best = found;
    numbers_ = trial;
    know_tables();
  }
}

}  // namespace mgdd::optimize
