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

// Spread of the estimates that lack one block each, to first order: (J'J - J_b'J_b)^-1 J_b'r_b. A block without which
// nothing is known of a parameter leaves it a spread to match. Mean of two partitions, the second half a block on.
Eigen::MatrixXd without_one_block(const Eigen::MatrixXd& columns, const Eigen::VectorXd& residual,
                                  const Eigen::MatrixXd& whole, const ResidualRecord& record, Eigen::Index length) {
  const Eigen::Index n = columns.cols();
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(n, n);
  for (const Eigen::Index shift : {Eigen::Index{0}, length / 2}) {
    for (Eigen::Index first = -shift; first < record.rows; first += length) {
      const Eigen::Index begin = std::max<Eigen::Index>(first, 0);
      const Eigen::Index rows = std::min(first + length, record.rows) - begin;
      if (rows < 1) continue;
      const auto own = columns.middleRows(record.first + begin, rows);
      const Eigen::VectorXd score = own.transpose() * residual.segment(record.first + begin, rows);
      const Eigen::VectorXd change = (whole - own.transpose() * own).ldlt().solve(score);
      if (change.allFinite()) spread += 0.5 * change * change.transpose();
    }
  }
  return spread;
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
  const Eigen::MatrixXd whole = columns.transpose() * columns;
  const Eigen::MatrixXd bread = whole.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd score = columns.array().colwise() * report.residual.array();
  Eigen::MatrixXd within = Eigen::MatrixXd::Zero(n, n), between = within;
  double blocks = 0.0;
  for (const ResidualRecord& record : records) {
    const Eigen::Index length = block_rows(report.residual, record);
    within += without_one_block(columns, report.residual, whole, record, length);
    blocks += static_cast<double>(record.rows) / static_cast<double>(length);
    const Eigen::VectorXd sum = score.middleRows(record.first, record.rows).colwise().sum().transpose();
    between += sum * sum.transpose();
  }
  const double count = static_cast<double>(records.size());
  within *= (blocks - 1.0) / blocks;
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
