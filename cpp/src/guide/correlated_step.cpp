#include "mgdd/guide/correlated_step.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "mgdd/math/autocorrelation.hpp"

namespace mgdd::guide {
namespace {

constexpr int passes = 6;              // the weights follow from the residual, and the residual from the weights
constexpr double least_freedom = 0.1;  // share of the samples that is left where parameters take nearly all

struct Normal {
  CalibrationMatrix matrix;
  CalibrationVector slope;
};

// In units of what is known beforehand, with ones for whatever does not move.
struct Solved {
  CalibrationVector change;
  CalibrationMatrix inverse;
};
Solved solve(const Normal& normal, const std::array<bool, n_calibrated>& moves) noexcept {
  CalibrationMatrix scaled = CalibrationMatrix::Identity();
  CalibrationVector slope = CalibrationVector::Zero(), unit;
  for (int i = 0; i < n_calibrated; ++i)
    unit[i] = info_of(i).known_sd;
  for (int i = 0; i < n_calibrated; ++i) {
    if (!moves[static_cast<std::size_t>(i)]) continue;
    slope[i] = normal.slope[i] * unit[i];
    for (int j = 0; j < n_calibrated; ++j) {
      if (moves[static_cast<std::size_t>(j)]) scaled(i, j) = normal.matrix(i, j) * unit[i] * unit[j];
    }
  }
  const Eigen::LDLT<CalibrationMatrix> factors(scaled);
  Solved out;
  out.change = unit.cwiseProduct(factors.solve(slope));
  out.inverse = unit.asDiagonal() * factors.solve(CalibrationMatrix::Identity()) * unit.asDiagonal();
  for (int i = 0; i < n_calibrated; ++i) {
    if (moves[static_cast<std::size_t>(i)]) continue;
    out.change[i] = 0.0;
    out.inverse.row(i).setZero();
    out.inverse.col(i).setZero();
  }
  return out;
}

Normal with_knowledge(const CalibrationMatrix& information, const CalibrationVector& slope, const CalibrationVector& x,
                      const Beforehand& beforehand, const EarlierData& earlier) noexcept {
  Normal out{information + earlier.information, slope + earlier.pull - earlier.information * x};
  out.matrix.diagonal() += beforehand.information;
  out.slope += beforehand.information.cwiseProduct(beforehand.start - x);
  return out;
}

}  // namespace

CorrelatedStep correlated_step(const CalibrationColumns& columns, std::span<const double> residual_bar,
                               std::size_t first, std::size_t last, const CalibrationVector& x,
                               const Beforehand& beforehand, const EarlierData& earlier, double least_sigma_bar,
                               std::span<double> scratch) noexcept {
  CalibrationMatrix square = CalibrationMatrix::Zero();
  CalibrationVector projection = CalibrationVector::Zero();
  for (std::size_t k = first; k < last; ++k) {
    const CalibrationVector row = columns.row(static_cast<Eigen::Index>(k)).transpose();
    square.noalias() += row * row.transpose();
    projection += row * residual_bar[k];
  }
  const auto n = static_cast<double>(last - first);
  const auto left = scratch.subspan(first, last - first);
  CorrelatedStep out;
  double tau = 1.0;
  out.sigma_bar = least_sigma_bar;
  for (int pass = 0; pass < passes; ++pass) {
    const double weight = 1.0 / (tau * out.sigma_bar * out.sigma_bar);
    out.information = weight * square;
    out.slope = weight * projection;
    const Solved solved = solve(with_knowledge(out.information, out.slope, x, beforehand, earlier), beforehand.unknown);
    out.change = solved.change;
    out.covariance = solved.inverse;
    double power = 0.0;
    for (std::size_t k = first; k < last; ++k) {
      const double r = residual_bar[k] - columns.row(static_cast<Eigen::Index>(k)).dot(out.change);
      scratch[k] = r;
      power += r * r;
    }
    // Each parameter that the samples determine takes tau of them, and as much of their correlation.
    const double raw = autocorrelation_time(left);
    const double taken = (solved.inverse * out.information).trace();
    const double freedom = std::max(1.0 - taken * raw / n, least_freedom);
    tau = raw / freedom;
    out.rms_bar = std::sqrt(power / n);
    out.sigma_bar = std::max(out.rms_bar / std::sqrt(freedom), least_sigma_bar);
  }
  out.samples = n / tau;
  return out;
}

}  // namespace mgdd::guide
