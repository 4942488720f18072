#include "mgdd/optimize/least_squares/fit_report.hpp"

#include <cmath>
#include <cstdio>

#include <Eigen/SVD>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::optimize {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();
// Share of a unit null direction: rounding puts about epsilon / rank_tolerance = 2e-6 into the others.
constexpr double least_share = 1e-3;

std::string formatted(const char* format, double value) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// "a +1, b -0.5": the parts of a direction that count.
std::string direction_text(const FitReport& report, const Eigen::VectorXd& direction) {
  std::string text;
  for (Eigen::Index j = 0; j < direction.size(); ++j) {
    if (direction[j] != 0.0) {
      text +=
          (text.empty() ? "" : ", ") + report.names[static_cast<std::size_t>(j)] + formatted(" %+.4g", direction[j]);
    }
  }
  return text;
}

void name_null_direction(FitReport& report, const Eigen::VectorXd& direction) {
  const Eigen::Index parts = (direction.array() != 0.0).count();
  Eigen::Index largest = 0;
  direction.cwiseAbs().maxCoeff(&largest);
  report.findings.push_back(parts == 1 ? report.names[static_cast<std::size_t>(largest)] +
                                             ": the residual does not depend on it"
                                       : "the residual does not change along (" + direction_text(report, direction) +
                                             "): only a combination of these is determined");
}

// Same span, fewest names per column: elimination with full pivoting leaves every pivot in one column only.
void make_sparse(Eigen::MatrixXd& basis) {
  for (Eigen::Index k = 0; k < basis.cols(); ++k) {
    Eigen::Index row = 0;
    Eigen::Index column = 0;
    basis.rightCols(basis.cols() - k).cwiseAbs().maxCoeff(&row, &column);
    basis.col(k).swap(basis.col(k + column));
    basis.col(k) /= basis(row, k);
    for (Eigen::Index other = 0; other < basis.cols(); ++other) {
      if (other != k) {
        const double factor = basis(row, other);
        basis.col(other) -= factor * basis.col(k);
      }
    }
  }
  basis = (basis.array().abs() > least_share).select(basis, 0.0);
}

void check_shapes(const FitReport& report, const Eigen::MatrixXd& triangle, const Eigen::VectorXd& column_scale) {
  const auto n = static_cast<Eigen::Index>(report.names.size());
  if (triangle.cols() != n || triangle.rows() < n || column_scale.size() != n || report.values.size() != n ||
      report.bounds_active.size() != n) {
    throw about("describe_uncertainty",
                ShapeError("describe_uncertainty: triangle is " + std::to_string(triangle.rows()) + " x " +
                           std::to_string(triangle.cols()) + " and column_scale has " +
                           std::to_string(column_scale.size()) + " values for " + std::to_string(n) + " parameters"));
  }
}

// Indices of the parameters that were estimated; those held at a bound are named and suspect.
std::vector<Eigen::Index> free_parameters(FitReport& report, std::vector<bool>& suspect) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index j = 0; j < report.bounds_active.size(); ++j) {
    const int side = report.bounds_active[j];
    if (side == 0) {
      free.push_back(j);
      continue;
    }
    const auto index = static_cast<std::size_t>(j);
    suspect[index] = true;
    report.findings.push_back(report.names[index] + " stands at its " + (side < 0 ? "lower" : "upper") + " bound" +
                              formatted(" %.6g", side < 0 ? report.lower[j] : report.upper[j]));
  }
  return free;
}

struct Spectrum {
  Eigen::MatrixXd v;        // right singular vectors
  Eigen::Index rank = 0;    // singular values that count
  Eigen::MatrixXd inverse;  // of J^T J over those
};

Spectrum spectrum_of(const Eigen::MatrixXd& unit_columns, double rank_tolerance) {
  Spectrum result;
  const Eigen::Index n = unit_columns.cols();
  result.inverse.setZero(n, n);
  if (n == 0) {
    return result;
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(unit_columns, Eigen::ComputeThinV);
  result.v = svd.matrixV();
  const Eigen::VectorXd& sigma = svd.singularValues();
  while (result.rank < n && sigma[result.rank] > rank_tolerance * sigma[0]) {
    result.inverse +=
        result.v.col(result.rank) * result.v.col(result.rank).transpose() / (sigma[result.rank] * sigma[result.rank]);
    ++result.rank;
  }
  return result;
}

}  // namespace

std::string_view explain(FitStatus status) noexcept {
  switch (status) {
    case FitStatus::not_run:
      return "the fit has not been run";
    case FitStatus::cost_converged:
      return "no further step lowers the cost";
    case FitStatus::step_converged:
      return "the steps have become negligible";
    case FitStatus::gradient_converged:
      return "the gradient over the free parameters is zero";
    case FitStatus::iteration_limit:
      return "stopped at the iteration limit before a tolerance was met";
    case FitStatus::evaluation_failed:
      return "the model could not be evaluated at the start";
    case FitStatus::stalled:
      return "no step lowers the cost although the gradient is not zero (a wrong Jacobian, a noisy "
             "residual "
             "or the edge of where the model can be evaluated)";
    case FitStatus::interrupted:
      return "interrupted before a tolerance was met";
  }
  return "unknown";
}

bool is_converged(FitStatus status) noexcept {
  return status == FitStatus::cost_converged || status == FitStatus::step_converged ||
         status == FitStatus::gradient_converged;
}

std::string FitReport::brief() const {
  std::string text = std::string(name_of(status)) + " after " + std::to_string(iterations) + " iterations, rmse " +
                     formatted("%.6g", rmse);
  for (std::size_t i = 0; i < unidentifiable.size(); ++i) {
    text += (i == 0 ? ", not identifiable: " : ", ") + unidentifiable[i];
  }
  return text;
}

void describe_uncertainty(FitReport& report, const Eigen::MatrixXd& triangle, const Eigen::VectorXd& column_scale,
                          const IdentifiabilityLimits& limits) {
  check_shapes(report, triangle, column_scale);
  const auto n = static_cast<Eigen::Index>(report.names.size());
  report.findings.clear();
  report.covariance.setConstant(n, n, undefined);
  report.correlation.setConstant(n, n, undefined);
  report.standard_error.setConstant(n, undefined);
  std::vector<bool> suspect(report.names.size(), false);
  const std::vector<Eigen::Index> free = free_parameters(report, suspect);
  const auto n_free = static_cast<Eigen::Index>(free.size());

  Eigen::MatrixXd unit(triangle.rows(), n_free);
  Eigen::VectorXd scale(n_free);
  for (Eigen::Index k = 0; k < n_free; ++k) {
    const Eigen::Index j = free[static_cast<std::size_t>(k)];
    const double norm = triangle.col(j).norm();
    const double divisor = norm > 0.0 ? norm : 1.0;
    unit.col(k) = triangle.col(j) / divisor;
    scale[k] = column_scale[j] * divisor;
  }
  const Spectrum spectrum = spectrum_of(unit, limits.rank_tolerance);
  const Eigen::Index freedom = report.n_residuals - spectrum.rank;
  const double variance = freedom > 0 ? 2.0 * report.cost / static_cast<double>(freedom) : undefined;

  Eigen::MatrixXd basis = spectrum.v.rightCols(n_free - spectrum.rank);
  const Eigen::MatrixXd null = basis * basis.transpose();
  make_sparse(basis);
  report.null_directions.setZero(n, basis.cols());
  for (Eigen::Index k = 0; k < basis.cols(); ++k) {
    Eigen::VectorXd direction = Eigen::VectorXd::Zero(n);
    for (Eigen::Index i = 0; i < n_free; ++i) {
      direction[free[static_cast<std::size_t>(i)]] = basis(i, k) / scale[i];
    }
    Eigen::Index largest = 0;
    direction.cwiseAbs().maxCoeff(&largest);
    const double divisor = direction[largest];
    report.null_directions.col(k) = direction / divisor;
    name_null_direction(report, report.null_directions.col(k));
  }

  for (Eigen::Index a = 0; a < n_free; ++a) {
    const Eigen::Index row = free[static_cast<std::size_t>(a)];
    const bool a_null = null(a, a) > least_share * least_share;
    for (Eigen::Index b = 0; b < n_free; ++b) {
      const Eigen::Index column = free[static_cast<std::size_t>(b)];
      const bool b_null = null(b, b) > least_share * least_share;
      const Eigen::MatrixXd& source = a_null ? null : spectrum.inverse;
      const double correlation = a_null == b_null ? source(a, b) / std::sqrt(source(a, a) * source(b, b)) : 0.0;
      report.correlation(row, column) = a == b ? 1.0 : correlation;
      if (!a_null && !b_null) {
        report.covariance(row, column) = variance * spectrum.inverse(a, b) / (scale[a] * scale[b]);
      }
      if (!a_null && !b_null && a < b && std::abs(correlation) > limits.correlation) {
        suspect[static_cast<std::size_t>(row)] = suspect[static_cast<std::size_t>(column)] = true;
        report.findings.push_back(report.names[static_cast<std::size_t>(row)] + " and " +
                                  report.names[static_cast<std::size_t>(column)] + ": correlation" +
                                  formatted(" %+.5f", correlation) + formatted(" is beyond +-%g", limits.correlation));
      }
    }
    if (a_null) {
      suspect[static_cast<std::size_t>(row)] = true;
      report.covariance(row, row) = infinity;
    }
    report.standard_error[row] = std::sqrt(report.covariance(row, row));
  }
  report.unidentifiable.clear();
  for (std::size_t j = 0; j < suspect.size(); ++j) {
    if (suspect[j]) {
      report.unidentifiable.push_back(report.names[j]);
    }
  }
}

}  // namespace mgdd::optimize
