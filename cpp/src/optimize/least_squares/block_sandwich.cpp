#include "mgdd/optimize/least_squares/block_sandwich.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include <Eigen/Cholesky>

#include "mgdd/common/error.hpp"
#include "mgdd/math/autocorrelation.hpp"

namespace mgdd::optimize {
namespace {

constexpr double least_block_s = 0.25;
constexpr double times_per_block = 3.0;
constexpr double blocks_per_record = 6.0;

void check(const FitReport& report, const Eigen::MatrixXd& jacobian, const std::vector<ResidualRecord>& records) {
  Eigen::Index rows = 0;
  for (const ResidualRecord& record : records) {
    if (record.first != rows || record.rows < 1) throw ShapeError("block_sandwich: records must follow one another");
    rows += record.rows;
  }
  if (rows != report.residual.size() || jacobian.rows() != rows || jacobian.cols() != report.values.size()) {
    throw ShapeError("block_sandwich: " + std::to_string(rows) + " rows of records, Jacobian " +
                     std::to_string(jacobian.rows()) + " x " + std::to_string(jacobian.cols()) + " for " +
                     std::to_string(report.residual.size()) + " residuals and " + std::to_string(report.values.size()) +
                     " parameters");
  }
}

// Sum over all windows of `length` rows, those that reach over an end included, of (window sum)(window sum)', over the
// length: the Bartlett-weighted sum of all products of rows.
Eigen::MatrixXd of_windows(const Eigen::MatrixXd& score, const ResidualRecord& record, Eigen::Index length) {
  const Eigen::Index n = score.cols();
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd window = Eigen::VectorXd::Zero(n);
  for (Eigen::Index last = 0; last < record.rows + length - 1; ++last) {
    if (last < record.rows) window += score.row(record.first + last).transpose();
    if (last >= length) window -= score.row(record.first + last - length).transpose();
    total.selfadjointView<Eigen::Lower>().rankUpdate(window);
  }
  return Eigen::MatrixXd(total.selfadjointView<Eigen::Lower>()) / static_cast<double>(length);
}

}  // namespace

Eigen::Index block_rows(const Eigen::VectorXd& residual, const ResidualRecord& record) {
  const double time = autocorrelation_time(
      std::span<const double>(residual.data() + record.first, static_cast<std::size_t>(record.rows)));
  const double most = static_cast<double>(record.rows) / blocks_per_record;
  return std::max<Eigen::Index>(
      1, static_cast<Eigen::Index>(std::min(most, std::max(times_per_block * time, least_block_s / record.row_s))));
}

void block_sandwich(FitReport& report, const Eigen::MatrixXd& jacobian, const std::vector<ResidualRecord>& records) {
  check(report, jacobian, records);
  std::vector<Eigen::Index> known;  // free, and in no null direction
  for (Eigen::Index j = 0; j < report.values.size(); ++j) {
    if (std::isfinite(report.standard_error[j])) known.push_back(j);
  }
  const auto n = static_cast<Eigen::Index>(known.size());
  if (n == 0) return;
  Eigen::MatrixXd columns(jacobian.rows(), n);
  Eigen::VectorXd scale(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    columns.col(k) = jacobian.col(known[static_cast<std::size_t>(k)]);
    scale[k] = columns.col(k).norm();
    columns.col(k) /= scale[k];
  }
  const Eigen::MatrixXd bread = (columns.transpose() * columns).ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd score = columns.array().colwise() * report.residual.array();
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(n, n), between = meat;
  double blocks = 0.0;
  for (const ResidualRecord& record : records) {
    const Eigen::Index length = block_rows(report.residual, record);
    meat += of_windows(score, record, length);
    blocks += static_cast<double>(record.rows) / static_cast<double>(length);
    const Eigen::VectorXd sum = score.middleRows(record.first, record.rows).colwise().sum().transpose();
    between += sum * sum.transpose();
  }
  const double rows = static_cast<double>(report.residual.size());
  const double freedom = rows / std::max(rows - static_cast<double>(n), 1.0);
  const double count = static_cast<double>(records.size());
  const Eigen::MatrixXd within = freedom * blocks / std::max(blocks - 1.0, 1.0) * (bread * meat * bread);
  const Eigen::MatrixXd apart =
      count > 1.0 ? Eigen::MatrixXd(count / (count - 1.0) * (bread * between * bread)) : Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    const Eigen::Index row = known[static_cast<std::size_t>(a)];
    for (Eigen::Index b = 0; b < n; ++b)
      report.covariance(row, known[static_cast<std::size_t>(b)]) = within(a, b) / (scale[a] * scale[b]);
    report.covariance(row, row) = std::max(within(a, a), apart(a, a)) / (scale[a] * scale[a]);
    report.standard_error[row] = std::sqrt(report.covariance(row, row));
  }
  report.residual_blocks = blocks;
}

}  // namespace mgdd::optimize
