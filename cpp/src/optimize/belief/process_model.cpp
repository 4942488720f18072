#include "mgdd/optimize/belief/process_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "mgdd/optimize/ask_tell/reading.hpp"
#include "mgdd/optimize/belief/row_cholesky.hpp"
#include "mgdd/optimize/watch/outliers.hpp"

namespace mgdd::optimize {
namespace {

constexpr int settling_readings = 30;
constexpr double crowd = 0.75;  // share of the readings, those nearest to the estimate, of which the oldest goes
constexpr int first_trials = 60, more_trials = 20, late_trials = 3;
constexpr int first_readings = 15;
constexpr int fewest_weighed = 4;
constexpr double most_trusted = 81.0;   // of what a variance is multiplied by: nine standard deviations
constexpr double most_outliers = 0.25;  // of the readings: where there are more, the numbers are wrong and not they
constexpr int waking_readings = 3;
constexpr double waking_rise = 1e3;          // of what all earlier readings span
constexpr Eigen::Index guided_readings = 3;  // from which on those of a guide may be odd
constexpr double least_noise = 1e-12;        // of a reading
constexpr double young = 0.1;                // memories, in which little has wandered

}  // namespace

ProcessModel::ProcessModel(const Settings& settings)
    : settings_(settings),
      kernel_(settings.inputs, settings.context, settings.bends_down, settings.guide),
      points_(InputTable::Zero(settings.kept, kernel_.width())),
      values_(Eigen::VectorXd::Zero(settings.kept)),
      ages_(values_),
      scatter_(Eigen::VectorXd::Ones(settings.kept)),
      weighed_(scatter_),
      averaged_(scatter_),
      numbers_(Numbers::Zero(5 + settings.inputs + (kernel_.guided() ? 1 : 0))),
      columns_(InputTable::Zero(kernel_.width(), settings.kept)),
      quadratic_(settings.kept, settings.kept),
      guide_(quadratic_),
      matern_(quadratic_),
      table_lengths_(Inputs::Zero(settings.inputs)),
      factor_(settings.kept, settings.kept),
      small_(evidence_readings, evidence_readings),
      weights_(values_),
      small_rest_(Eigen::VectorXd::Zero(evidence_readings)),
      mean_of_(small_rest_),
      distance_(values_),
      mean_(Eigen::VectorXd::Zero(settings.most_points)),
      order_(static_cast<std::size_t>(settings.kept), 0),
      chosen_(evidence_readings, 0),
      kernels_(settings.most_points, settings.kept),
      asked_(InputTable::Zero(settings.most_points, kernel_.width())),
      asked_columns_(InputTable::Zero(kernel_.width(), settings.most_points)) {
  now_.inverse_length = Inputs::Ones(settings.inputs);
}

double ProcessModel::middle() const noexcept {
  return (values_.head(count_).array() / scatter_.head(count_).array()).sum() /
         scatter_.head(count_).cwiseInverse().sum();
}

double ProcessModel::noise_sd() const noexcept {
  return settings_.noise_sd.value_or(std::max(std::exp(numbers_[0] + numbers_[1]), std::sqrt(within_)));
}

void ProcessModel::tabulate(std::int64_t reading) noexcept {
  columns_.col(reading) = points_.row(reading).transpose();
  for (std::int64_t other = 0; other < count_; ++other) {
    const std::int64_t i = std::max(reading, other), j = std::min(reading, other);
    const ProcessKernel::Fixed f = kernel_.fixed(&points_(i, 0), &points_(j, 0));
    quadratic_(i, j) = f.quadratic;
    guide_(i, j) = f.guide;
    matern_(i, j) = kernel_.matern(&points_(i, 0), &points_(j, 0), table_lengths_);
  }
}

void ProcessModel::tabulate_lengths() noexcept {
  for (std::int64_t i = 0; i < count_; ++i) {
    for (std::int64_t j = 0; j <= i; ++j)
      matern_(i, j) = kernel_.matern(&points_(i, 0), &points_(j, 0), table_lengths_);
  }
}

// Tables of all readings at the lengths in use.
void ProcessModel::know_tables() noexcept {
  const Inputs lengths = scales_of(numbers_).inverse_length;
  if (!tables_known_) {
    table_lengths_ = lengths;
    for (std::int64_t i = 0; i < count_; ++i)
      tabulate(i);
    tables_known_ = true;
  } else if (lengths != table_lengths_) {
    table_lengths_ = lengths;
    tabulate_lengths();
  }
}

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

// Random walks of level and slopes, from a reading of that age until now; of two readings the younger one counts.
double ProcessModel::wandered(const double* a, const double* b, double age, const Scales& s) const noexcept {
  double slopes = 0.0;
  for (Eigen::Index k = 0; k < settings_.inputs; ++k)
    slopes += (a[k] - 0.5) * (b[k] - 0.5);
  return (s.wander_level + s.wander_slope * slopes) * age;
}

void ProcessModel::factor() noexcept {
  for (std::int64_t i = 0; i < count_; ++i) {
    weights_[i] = values_[i] - level_ - kernel_.mean(&points_(i, 0), now_);
    for (std::int64_t j = 0; j <= i; ++j) {
      factor_(i, j) = kernel_.join({quadratic_(i, j), guide_(i, j)}, matern_(i, j), now_) +
                      wandered(&points_(i, 0), &points_(j, 0), std::min(ages_[i], ages_[j]), now_);
    }
    factor_(i, i) += noise_of(i, now_) + jitter * now_.bend * now_.bend;
  }
  cholesky(factor_, count_);
  solve_lower(factor_, count_, weights_.data());
  solve_upper(factor_, count_, weights_.data());
  factored_ = true;
}

// After a restart in another process, or readings since the last fit.
void ProcessModel::refresh() noexcept {
  if (factored_) return;
  level_ = middle();
  now_ = scales_of(numbers_);
  know_tables();
  factor();
}

void ProcessModel::fit(const Inputs& about) noexcept {
  scatter_ = weighed_;
  const auto enough = kernel_.guided() ? 2 : settings_.inputs + 1;
  if (static_cast<double>((scatter_.head(count_).array() > most_trusted).count()) >
      most_outliers * static_cast<double>(count_)) {
    scatter_.setOnes();
    begin_numbers(false);
  } else if (!begun_ || told_ <= enough) {
    begin_numbers(kernel_.guided());
  }
  level_ = middle();
  know_tables();
  choose_readings(about);
  if (told_ >= enough) {
    if (told_ > enough && told_ < more_readings && !settings_.labels) suspect();
    try_numbers(told_ < first_readings ? first_trials : told_ < more_readings ? more_trials : late_trials);
    if (told_ == enough + settling_readings) settled_bend_ = numbers_[0];
  }
  factored_ = false;
  refresh();
  weigh();
}

void ProcessModel::predict(const InputTable& at, int points) noexcept {
  predict_means(at, points);
  factor_.topLeftCorner(count_, count_)
      .triangularView<Eigen::Lower>()
      .solveInPlace(kernels_.topLeftCorner(points, count_).transpose());
  asked_columns_.leftCols(points) = asked_.topRows(points).transpose();
}

void ProcessModel::predict_means(const InputTable& at, int points) noexcept {
  refresh();
  for (int p = 0; p < points; ++p) {
    kernel_.describe(at.row(p).head(settings_.inputs).transpose(), &asked_(p, 0));
    double* const own = &kernels_(p, 0);
    kernel_.covariances(&asked_(p, 0), columns_, count_, now_, own);
    mean_[p] = level_ + kernel_.mean(&asked_(p, 0), now_) + dot(own, weights_.data(), count_);
  }
}

void ProcessModel::covariances(int i, int points, double* out) const noexcept {
  for (int from = 0; from < points; from += most_kept) {
    const int some = std::min(most_kept, points - from);
    kernel_.covariances(&asked_(i, 0), asked_columns_.middleCols(from, some), some, now_, out + from);
  }
  Eigen::Map<Eigen::VectorXd>(out, points).noalias() -=
      kernels_.topLeftCorner(points, count_) * kernels_.row(i).head(count_).transpose();
}

double ProcessModel::covariance(int i, int j) const noexcept {
  return kernel_.covariance(&asked_(i, 0), &asked_(j, 0), now_) - dot(&kernels_(i, 0), &kernels_(j, 0), count_);
}

}  // namespace mgdd::optimize
