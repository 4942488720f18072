// The readings that a process keeps: which are averaged, which make room, and which are not believed.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/belief/process_model.hpp"
#include "mgdd/optimize/belief/row_cholesky.hpp"
#include "mgdd/optimize/watch/outliers.hpp"

namespace mgdd::optimize {
namespace {

constexpr double crowd = 0.75;  // share of the readings, those nearest to the estimate, of which the oldest goes
constexpr int fewest_weighed = 4;
constexpr int waking_readings = 3;
constexpr double waking_rise = 1e3;          // of what all earlier readings span
constexpr Eigen::Index guided_readings = 3;  // from which on those of a guide may be odd
constexpr double least_noise = 1e-12;        // of a reading
constexpr double young = 0.1;                // memories, in which little has wandered

}  // namespace

double ProcessModel::squared_distance(Eigen::Index reading, const Inputs& from) const noexcept {
  return (points_.row(reading).head(from.size()).transpose() - from).squaredNorm();
}

// Of the readings nearest to `about` the oldest one.
int ProcessModel::crowded_reading(const Inputs& about) noexcept {
  for (std::int64_t i = 0; i < count_; ++i)
    distance_[i] = squared_distance(i, about);
  if (settings_.labels) {
    const bool above_is_rarer = 2 * count_above(0.0) < count_;
    for (std::int64_t i = 0; i < count_; ++i) {
      if ((values_[i] > 0.0) == above_is_rarer) distance_[i] = std::numeric_limits<double>::infinity();
    }
  }
  const auto begin = order_.begin(), end = begin + count_;
  std::iota(begin, end, 0);
  const auto near = begin + static_cast<std::ptrdiff_t>(crowd * static_cast<double>(count_));
  std::nth_element(begin, near, end, [&](int a, int b) {
    return distance_[a] < distance_[b] || (distance_[a] == distance_[b] && a < b);
  });
  return *std::max_element(begin, near, [&](int a, int b) { return ages_[a] < ages_[b]; });
}

// One that the process follows, of about the same time, and of an input so near that what lies between them is lost in
// the noise of their mean; -1 where there is none.
int ProcessModel::alike_reading(const Inputs& z, double readings) noexcept {
  if (settings_.alike < 0.0 || !begun_) return -1;
  refresh();
  for (std::int64_t i = 0; i < count_; ++i) {
    if (!trusted(i) || (settings_.repeated && weighed_[i] > 1.0) || ages_[i] > young * settings_.memory) continue;
    if (between(z, i) * (averaged_[i] + readings) <= now_.noise_variance) return static_cast<int>(i);
  }
  return -1;
}

// Variance of what lies between a reading and an input; none is that far where they are not alike.
double ProcessModel::between(const Inputs& z, std::int64_t reading) noexcept {
  const double off = (points_.row(reading).head(z.size()).transpose() - z).cwiseAbs().maxCoeff();
  if (off > settings_.alike) return std::numeric_limits<double>::infinity();
  double* const point = &asked_(0, 0);
  kernel_.describe(z, point);
  const double* const own = &points_(reading, 0);
  return kernel_.covariance(point, point, now_) + kernel_.covariance(own, own, now_) -
         2.0 * kernel_.covariance(point, own, now_);
}

// Where the newest reading was odd and this one was taken of the same input, the square of what they differ by, in
// standard deviations; infinite elsewhere. Where they agree both are right.
double ProcessModel::agreement(const Inputs& z, double value, double readings) noexcept {
  constexpr double none = std::numeric_limits<double>::infinity();
  if (!settings_.repeated || !begun_ || count_ == 0) return none;
  refresh();
  Eigen::Index newest = 0;
  ages_.head(count_).minCoeff(&newest);
  const double apart = between(z, newest);
  if (!(weighed_[newest] > 1.0) || !std::isfinite(apart)) return none;
  const double off = value - values_[newest];
  const double odd = off * off / (apart + now_.noise_variance * (1.0 / readings + 1.0 / averaged_[newest]));
  if (scatter_of(odd) > 1.0) return none;
  scatter_[newest] = weighed_[newest] = 1.0;
  factored_ = false;
  return odd;
}

double ProcessModel::record(const Inputs& z, double value, const Inputs& about, double readings) noexcept {
  const double odd = std::min(agreement(z, value, readings), oddness(z, value, readings));
  ages_.head(count_).array() += 1.0;
  const int known = scatter_of(odd) <= (settings_.repeated ? 1.0 : most_trusted) ? alike_reading(z, readings) : -1;
  if (known >= 0) {
    averaged_[known] += readings;
    const double share = readings / averaged_[known];
    Inputs middle = points_.row(known).head(settings_.inputs).transpose();
    middle += share * (z - middle);
    kernel_.describe(middle, &points_(known, 0));
    values_[known] += share * (value - values_[known]);
    ages_[known] *= 1.0 - share;
    ++told_;
    if (tables_known_) tabulate(known);
    factored_ = false;
    return odd;
  }
  const int at = count_ < settings_.kept ? static_cast<int>(count_++) : crowded_reading(about);
  kernel_.describe(z, &points_(at, 0));
  values_[at] = value;
  ages_[at] = 0.0;
  averaged_[at] = readings;
  scatter_[at] = weighed_[at] = !settings_.repeated && told_ < more_readings ? 1.0 : scatter_of(odd);
  ++told_;
  if (tables_known_) tabulate(at);
  factored_ = false;
  return odd;
}

double ProcessModel::oddness(const Inputs& z, double value, double readings) noexcept {
  const auto enough = settings_.repeated && kernel_.guided() ? guided_readings : 3 * (settings_.inputs + 1);
  if (settings_.labels || !begun_ || count_ < enough) return 1.0;
  refresh();
  double* const point = &asked_(0, 0);
  double* const own = &kernels_(0, 0);
  kernel_.describe(z, point);
  kernel_.covariances(point, columns_, count_, now_, own);
  const double off = value - level_ - kernel_.mean(point, now_) - dot(own, weights_.data(), count_);
  solve_lower(factor_, count_, own);
  const double known = kernel_.covariance(point, point, now_) - dot(own, own, count_);
  const double noise = std::max(noise_sd(), least_noise * std::abs(value));
  return off * off / std::max(std::max(known, 0.0) + noise * noise / readings, 1e-300);
}

bool ProcessModel::trusted(std::int64_t reading) const noexcept {
  return scatter_[reading] <= most_trusted;
}

double ProcessModel::lowest() const noexcept {
  double least = values_.head(count_).maxCoeff();
  for (std::int64_t i = 0; i < count_; ++i) {
    if (weighed_[i] <= most_trusted) least = std::min(least, values_[i]);
  }
  return least;
}

// By what is left of each reading, a small part of it where the process follows the others; counts from the next fit.
void ProcessModel::weigh() noexcept {
  weighed_ = scatter_;
  if (settings_.labels || told_ < fewest_weighed) return;
  for (std::int64_t i = 0; i < count_; ++i) {
    const double left = weights_[i] * scatter_[i] / averaged_[i];  // over the variance of a reading
    weighed_[i] = scatter_of(left * left * now_.noise_variance * averaged_[i]);
  }
}

// Three readings in a row that all lie far off what the others span, since one may be an outlier.
bool ProcessModel::wakes_up() const noexcept {
  if (count_ <= waking_readings) return false;
  std::array<double, waking_readings> youngest{};
  std::partial_sort_copy(ages_.data(), ages_.data() + count_, youngest.begin(), youngest.end());
  const double oldest_news = youngest.back();  // a doubt ages all that are known by as much
  double low = largest_reading, high = -largest_reading;
  const double* first = nullptr;
  bool elsewhere = false;
  for (std::int64_t i = 0; i < count_; ++i) {
    if (ages_[i] <= oldest_news) continue;
    if (first == nullptr) first = &points_(i, 0);
    elsewhere = elsewhere || !std::equal(first, first + settings_.inputs, &points_(i, 0));
    low = std::min(low, values_[i]);
    high = std::max(high, values_[i]);
  }
  const double far = waking_rise * (high - low);
  std::int64_t news = 0;
  for (std::int64_t i = 0; i < count_; ++i)
    news += ages_[i] <= oldest_news && std::max(values_[i] - high, low - values_[i]) > far ? 1 : 0;
  return elsewhere && news == waking_readings;
}

void ProcessModel::scattered(double sd, double readings) noexcept {
  const double freedom = readings - 1.0;
  if (!(sd > 0.0 && freedom > 0.0)) return;
  within_freedom_ = std::min(within_freedom_ + freedom, settings_.memory);
  within_ += std::min(1.0, freedom / within_freedom_) * (sd * sd - within_);
  factored_ = false;
}

void ProcessModel::age(double cycles) noexcept {
  ages_.head(count_).array() += cycles;
  factored_ = false;
}

void ProcessModel::forget() noexcept {
  count_ = told_ = 0;
  within_ = within_freedom_ = 0.0;
  begun_ = factored_ = tables_known_ = false;
  scatter_.setOnes();
  weighed_.setOnes();
  averaged_.setOnes();
  points_.setZero();
  values_.setZero();
  ages_.setZero();
  numbers_.setZero();
  settled_bend_.reset();
}

void ProcessModel::replace(const InputTable& at, const Eigen::VectorXd& values, const Eigen::VectorXd& ages, int count,
                           const Inputs& about) noexcept {
  count_ = told_ = 0;
  begun_ = false;
  settled_bend_.reset();
  for (int a = std::max(0, count - settings_.kept); a < count; ++a)
    record(at.row(a).transpose(), values[a], about);
  ages_.head(count_) = ages.segment(count - count_, count_);
}

}  // namespace mgdd::optimize
