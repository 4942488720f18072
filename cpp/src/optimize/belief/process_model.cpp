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
constexpr int first_trials = 60, more_trials = 20, late_trials = 3;
constexpr int first_readings = 15;
constexpr double most_outliers = 0.25;  // of the readings: where there are more, the numbers are wrong and not they

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
      together_(together, settings.kept),
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

void ProcessModel::predict(const InputTable& at, int points, int from) noexcept {
  predict_means(at, points, from);
  factor_.topLeftCorner(count_, count_)
      .triangularView<Eigen::Lower>()
      .solveInPlace(kernels_.block(from, 0, points, count_).transpose());
}

void ProcessModel::predict_means(const InputTable& at, int points, int from) noexcept {
  refresh();
  for (int p = from; p < from + points; ++p) {
    kernel_.describe(at.row(p).head(settings_.inputs).transpose(), &asked_(p, 0));
    double* const own = &kernels_(p, 0);
    kernel_.covariances(&asked_(p, 0), columns_, count_, now_, own);
    mean_[p] = level_ + kernel_.mean(&asked_(p, 0), now_) + dot(own, weights_.data(), count_);
  }
}

// Eight at a time, so that what is known of a point is fetched once for all of them.
void ProcessModel::covariances(std::span<const int> of, std::span<const int> with, InputTable& out) noexcept {
  const auto others = static_cast<Eigen::Index>(with.size());
  for (Eigen::Index k = 0; k < others; ++k)
    asked_columns_.col(k) = asked_.row(with[static_cast<std::size_t>(k)]).transpose();
  for (std::size_t first = 0; first < of.size(); first += together) {
    const auto some = static_cast<Eigen::Index>(std::min<std::size_t>(together, of.size() - first));
    for (Eigen::Index k = 0; k < some; ++k) {
      const int own = of[first + static_cast<std::size_t>(k)];
      together_.row(k).head(count_) = kernels_.row(own).head(count_);
      double* const row = &out(static_cast<Eigen::Index>(first) + k, 0);
      kernel_.covariances(&asked_(own, 0), asked_columns_, others, now_, row);
    }
    for (Eigen::Index p = 0; p < others; ++p) {
      Eigen::Matrix<double, Eigen::Dynamic, 1, 0, together, 1> both(some);
      both.noalias() = together_.topLeftCorner(some, count_) *
                       kernels_.row(with[static_cast<std::size_t>(p)]).head(count_).transpose();
      for (Eigen::Index k = 0; k < some; ++k)
        out(static_cast<Eigen::Index>(first) + k, p) -= both[k];
    }
  }
}

double ProcessModel::covariance(int i, int j) const noexcept {
  return kernel_.covariance(&asked_(i, 0), &asked_(j, 0), now_) - dot(&kernels_(i, 0), &kernels_(j, 0), count_);
}

}  // namespace mgdd::optimize
