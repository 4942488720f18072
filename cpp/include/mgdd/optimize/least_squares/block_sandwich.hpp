// Standard errors of a least-squares fit whose residual is correlated in time: the jackknife over blocks of the record
// (Kuensch 1989), to first order, and over records the sandwich (Liang and Zeger 1986). Units of the parameters. Not
// real-time safe: allocates.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "mgdd/optimize/least_squares/fit_report.hpp"

namespace mgdd::optimize {

/// Rows of one record, one after the other in time.
struct ResidualRecord {
  Eigen::Index first = 0;
  Eigen::Index rows = 0;
  double row_s = 1.0;  ///< time from row to row
};

/// Length of a block: three autocorrelation times of the residual, 0.25 s at least, a sixth of the record at most.
Eigen::Index block_rows(const Eigen::VectorXd& residual, const ResidualRecord& record);

/// Replaces covariance and standard errors of a report that `describe_uncertainty` has filled, where they are finite,
/// and states `residual_blocks`. Of two or more records the spread between them counts where it is larger. Correlation
/// and findings stay: they are those of the experiment, whatever the noise. ShapeError for rows that do not fit.
void block_sandwich(FitReport& report, const Eigen::MatrixXd& jacobian, const std::vector<ResidualRecord>& records);

}  // namespace mgdd::optimize
