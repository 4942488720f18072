#include "mgdd/optimize/least_squares/least_squares.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double least_gain = 1e-4;         // accepted share of the predicted decrease (Moré 1978)
constexpr double trusted_damping = 1.0;     // above it a step is short because it is damped, not because it is over
constexpr Eigen::Index rows_at_once = 256;  // rows times a dozen columns stay in the first-level cache

// Householder reflections that fold `rows` into the upper `triangle` above them (Golub and Van Loan
// 2013, 5.2.2). `rows` is left as scratch. The last column of both is the right-hand side.
void fold_rows(Eigen::MatrixXd& triangle, Eigen::Ref<Eigen::MatrixXd> rows) {
  const Eigen::Index columns = triangle.cols();
  for (Eigen::Index k = 0; k < columns; ++k) {
    const double below = rows.col(k).squaredNorm();
    if (!(below > 0.0)) {
      continue;
    }
    const double head = triangle(k, k);
    const double norm = std::sqrt(head * head + below);
    const double beta = head > 0.0 ? -norm : norm;
    const double tau = (beta - head) / beta;
    rows.col(k) /= head - beta;
    triangle(k, k) = beta;
    for (Eigen::Index j = k + 1; j < columns; ++j) {
      const double share = tau * (triangle(k, j) + rows.col(k).dot(rows.col(j)));
      triangle(k, j) -= share;
      rows.col(j) -= share * rows.col(k);
    }
  }
}

}  // namespace

LeastSquares::LeastSquares(std::vector<Parameter> parameters, Eigen::Index n_residuals, LeastSquaresOptions options)
    : parameters_(std::move(parameters)),
      options_(std::move(options)),
      n_(static_cast<Eigen::Index>(parameters_.size())),
      n_residuals_(n_residuals) {
  options_.validate();
  validate(parameters_);
  if (n_residuals_ < n_) {
    throw ShapeError("n_residuals", n_residuals_, "must be >= the " + std::to_string(n_) + " parameters");
  }
  lower_.resize(n_);
  upper_.resize(n_);
  for (Eigen::Index j = 0; j < n_; ++j) {
    const Parameter& p = parameters_[static_cast<std::size_t>(j)];
    lower_[j] = p.log_scaled ? std::log(p.lower) : p.lower;
    upper_[j] = p.log_scaled ? std::log(p.upper) : p.upper;
  }
  for (Eigen::VectorXd* v : {&x_, &trial_x_, &z_, &trial_z_, &chain_, &magnitude_, &column_norm_, &largest_norm_,
                             &scale_, &step_, &image_}) {
    v->setConstant(n_, std::numeric_limits<double>::quiet_NaN());
  }
  side_.setZero(n_);
  triangle_.setZero(n_ + 1, n_ + 1);
  rows_.setZero(std::min(rows_at_once, n_residuals_), n_ + 1);
  step_triangle_.setZero(n_ + 1, n_ + 1);
  step_rows_.setZero(n_, n_ + 1);
}

void LeastSquares::prepare(const Eigen::VectorXd& start) {
  validate_start(parameters_, start);
  // A model that threw may have left these in another size.
  residual_.setZero(n_residuals_);
  trial_residual_.setZero(n_residuals_);
  jacobian_.setZero(n_residuals_, n_);
  trial_jacobian_.setZero(n_residuals_, n_);
  x_ = start;
  for (Eigen::Index j = 0; j < n_; ++j) {
    z_[j] = parameters_[static_cast<std::size_t>(j)].log_scaled ? std::log(start[j]) : start[j];
  }
  largest_norm_.setZero();
  history_.clear();
  history_.reserve(static_cast<std::size_t>(options_.max_iterations) + 1);
  nfev_ = njev_ = iterations_ = 0;
  damping_ = options_.initial_damping;
  growth_ = 2.0;
  cost_ = std::numeric_limits<double>::quiet_NaN();
  status_ = FitStatus::not_run;
  phase_ = Phase::start;
}

bool LeastSquares::is_usable(bool returned, const Eigen::VectorXd& residual, const Eigen::MatrixXd* jacobian) const {
  if (residual.size() != n_residuals_) {
    throw ShapeError("the model returned " + std::to_string(residual.size()) + " residuals, expected " +
                     std::to_string(n_residuals_));
  }
  if (jacobian != nullptr && (jacobian->rows() != n_residuals_ || jacobian->cols() != n_)) {
    throw ShapeError("the model returned a Jacobian of " + std::to_string(jacobian->rows()) + " x " +
                     std::to_string(jacobian->cols()) + ", expected " + std::to_string(n_residuals_) + " x " +
                     std::to_string(n_));
  }
  // Sums are finite only if every term is, and they also catch squares that overflow.
  return returned && std::isfinite(residual.squaredNorm()) &&
         (jacobian == nullptr || std::isfinite(jacobian->squaredNorm()));
}

void LeastSquares::begin(bool usable) noexcept {
  if (!usable) {
    finish(FitStatus::evaluation_failed);
    return;
  }
  cost_ = 0.5 * residual_.squaredNorm();
  phase_ = Phase::search;
  factorise();
  history_.push_back({cost_, damping_, 0.0, true});
  is_stationary();
}

// One pass over the Jacobian: everything after it happens on n x n numbers.
void LeastSquares::factorise() noexcept {
  for (Eigen::Index j = 0; j < n_; ++j) {
    const bool log_scaled = parameters_[static_cast<std::size_t>(j)].log_scaled;
    chain_[j] = log_scaled ? x_[j] : 1.0;
    magnitude_[j] = log_scaled ? 1.0 : std::abs(x_[j]);
    column_norm_[j] = chain_[j] * jacobian_.col(j).norm();
    largest_norm_[j] = std::max(largest_norm_[j], column_norm_[j]);
    scale_[j] = largest_norm_[j] > 0.0 ? largest_norm_[j] : 1.0;
  }
  triangle_.setZero();
  for (Eigen::Index first = 0; first < n_residuals_; first += rows_.rows()) {
    const Eigen::Index count = std::min(rows_.rows(), n_residuals_ - first);
    for (Eigen::Index j = 0; j < n_; ++j) {
      rows_.col(j).head(count) = (chain_[j] / scale_[j]) * jacobian_.col(j).segment(first, count);
    }
    rows_.col(n_).head(count) = residual_.segment(first, count);
    fold_rows(triangle_, rows_.topRows(count));
  }
}

// Holds the parameters whose descent leaves the box, then looks at the angle between residual and free
// columns.
bool LeastSquares::is_stationary() noexcept {
  const double residual_norm = std::sqrt(2.0 * cost_);
  cosine_ = 0.0;
  for (Eigen::Index j = 0; j < n_; ++j) {
    const double gradient = triangle_.col(j).head(n_).dot(triangle_.col(n_).head(n_));
    side_[j] = z_[j] <= lower_[j] && gradient > 0.0 ? -1 : z_[j] >= upper_[j] && gradient < 0.0 ? 1 : 0;
    if (side_[j] == 0 && column_norm_[j] > 0.0 && residual_norm > 0.0) {
      cosine_ = std::max(cosine_, std::abs(gradient) * (scale_[j] / column_norm_[j]) / residual_norm);
    }
  }
  if (cosine_ <= options_.gradient_tolerance) {
    finish(FitStatus::gradient_converged);
  }
  return phase_ == Phase::done;
}

// min |R q + Q^T r|^2 + damping |q|^2 over the parameters that are not held; held ones keep their q.
void LeastSquares::solve_damped() noexcept {
  step_triangle_.setZero();
  step_rows_.col(n_) = triangle_.col(n_).head(n_);
  for (Eigen::Index j = 0; j < n_; ++j) {
    if (side_[j] == 0) {
      step_triangle_(j, j) = std::sqrt(damping_);
      step_rows_.col(j) = triangle_.col(j).head(n_);
    } else {
      step_triangle_(j, j) = 1.0;
      step_rows_.col(j).setZero();
      step_rows_.col(n_) += step_[j] * triangle_.col(j).head(n_);
    }
  }
  fold_rows(step_triangle_, step_rows_);
  for (Eigen::Index j = n_ - 1; j >= 0; --j) {
    if (side_[j] == 0) {
      double sum = step_triangle_(j, n_);
      for (Eigen::Index k = j + 1; k < n_; ++k) {
        sum += step_triangle_(j, k) * (side_[k] == 0 ? step_[k] : 0.0);
      }
      step_[j] = -sum / step_triangle_(j, j);
    }
  }
}

// True when a parameter newly met its bound: the others then deserve another solve.
bool LeastSquares::clip_to_box() noexcept {
  bool clipped = false;
  for (Eigen::Index j = 0; j < n_; ++j) {
    const double target = z_[j] + step_[j] / scale_[j];
    if (side_[j] == 0 && (target < lower_[j] || target > upper_[j])) {
      side_[j] = target < lower_[j] ? -1 : 1;
      step_[j] = ((side_[j] < 0 ? lower_[j] : upper_[j]) - z_[j]) * scale_[j];
      clipped = true;
    }
  }
  return clipped;
}

void LeastSquares::propose() noexcept {
  step_.setZero();
  do {
    solve_damped();
  } while (clip_to_box());

  for (Eigen::Index j = 0; j < n_; ++j) {
    const Parameter& p = parameters_[static_cast<std::size_t>(j)];
    if (side_[j] != 0) {
      trial_z_[j] = side_[j] < 0 ? lower_[j] : upper_[j];
      trial_x_[j] = side_[j] < 0 ? p.lower : p.upper;
    } else {
      trial_z_[j] = z_[j] + step_[j] / scale_[j];
      trial_x_[j] = p.log_scaled ? std::clamp(std::exp(trial_z_[j]), p.lower, p.upper) : trial_z_[j];
    }
  }
  image_.noalias() = triangle_.topLeftCorner(n_, n_) * step_;
  predicted_ = -image_.dot(triangle_.col(n_).head(n_)) - 0.5 * image_.squaredNorm();
}

bool LeastSquares::judge(bool usable) noexcept {
  // The product of difference and sum keeps the digits that a difference of two costs loses.
  actual_ = usable ? 0.5 * (residual_ - trial_residual_).dot(residual_ + trial_residual_)
                   : -std::numeric_limits<double>::infinity();
  gain_ = predicted_ > 0.0 ? actual_ / predicted_ : 0.0;
  return gain_ > least_gain;
}

void LeastSquares::settle(bool accepted) noexcept {
  const double used_damping = damping_;
  const double step_norm = step_.norm();
  const double floor = options_.cost_tolerance * cost_;
  const bool small_change = std::abs(predicted_) <= floor && std::abs(actual_) <= floor;
  const bool small_step = step_norm <= options_.step_tolerance * (scale_.array() * magnitude_.array()).matrix().norm();
  ++iterations_;
  if (accepted) {
    x_.swap(trial_x_);
    z_.swap(trial_z_);
    residual_.swap(trial_residual_);
    jacobian_.swap(trial_jacobian_);
    cost_ = 0.5 * residual_.squaredNorm();
    damping_ = std::max(least_damping, damping_ * std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * gain_ - 1.0, 3)));
    growth_ = 2.0;
    factorise();
  } else {
    damping_ *= growth_;
    growth_ *= 2.0;
  }
  history_.push_back({cost_, used_damping, step_norm, accepted});
  if (is_stationary()) {
    return;
  }
  const bool trusted = used_damping <= trusted_damping || cosine_ * cosine_ <= options_.cost_tolerance;
  if (small_change && trusted) {
    finish(FitStatus::cost_converged);
  } else if (small_step && trusted) {
    finish(FitStatus::step_converged);
  } else if (!accepted && (small_step || damping_ > largest_damping)) {
    finish(FitStatus::stalled);
  } else if (iterations_ >= options_.max_iterations) {
    finish(FitStatus::iteration_limit);
  }
}

bool LeastSquares::is_stopped() noexcept {
  const bool running = phase_ == Phase::start || phase_ == Phase::search;
  if (running && options_.stop.stop_requested()) finish(FitStatus::interrupted);
  return phase_ == Phase::done;
}

void LeastSquares::finish(FitStatus status) noexcept {
  status_ = status;
  phase_ = Phase::done;
}

FitReport LeastSquares::report() const {
  FitReport report;
  report.lower.resize(n_);
  report.upper.resize(n_);
  report.bounds_active.setZero(n_);
  for (Eigen::Index j = 0; j < n_; ++j) {
    const Parameter& p = parameters_[static_cast<std::size_t>(j)];
    report.names.push_back(p.name);
    report.lower[j] = p.lower;
    report.upper[j] = p.upper;
    report.bounds_active[j] = x_[j] <= p.lower ? -1 : x_[j] >= p.upper ? 1 : 0;
  }
  report.values = x_;
  report.n_residuals = n_residuals_;
  report.nfev = nfev_;
  report.njev = njev_;
  report.iterations = iterations_;
  report.history = history_;
  report.status = phase_ == Phase::search ? FitStatus::iteration_limit : status_;
  const IdentifiabilityLimits limits{options_.correlation_limit, options_.rank_tolerance};
  if (std::isfinite(cost_) && !history_.empty()) {
    report.cost = cost_;
    report.rmse = std::sqrt(2.0 * cost_ / static_cast<double>(n_residuals_));
    report.residual = residual_;
    const Eigen::VectorXd natural_scale = scale_.cwiseQuotient(chain_);
    describe_uncertainty(report, triangle_.topLeftCorner(n_, n_), natural_scale, limits);
  } else {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    report.standard_error.setConstant(n_, nan);
    report.covariance.setConstant(n_, n_, nan);
    report.correlation.setConstant(n_, n_, nan);
    report.null_directions.resize(n_, 0);
    report.residual.setConstant(n_residuals_, nan);
  }
  return report;
}

}  // namespace mgdd::optimize
