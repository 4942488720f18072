// One Gauss-Newton step of a calibration, with what is known beforehand and with a residual whose samples are
// correlated: n samples with autocorrelation time tau count as n / tau. The noise comes from the residual that the step
// leaves. Minimises |r - A d|^2 / (tau sigma^2) + |x + d - start|^2 / known^2 + earlier data (normal prior: Bard 1974).
// noexcept, allocation-free.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "mgdd/guide/calibration_model.hpp"
#include "mgdd/guide/calibration_parameters.hpp"

namespace mgdd::guide {

/// What earlier data say, as the quadratic  -x' information x / 2 + pull' x.
struct EarlierData {
  CalibrationMatrix information = CalibrationMatrix::Zero();
  CalibrationVector pull = CalibrationVector::Zero();
};

/// Which parameters are unknown at all, and how well they are known beforehand.
struct Beforehand {
  std::array<bool, n_calibrated> unknown{};  ///< false: exactly as it stands
  CalibrationVector start = CalibrationVector::Zero();
  CalibrationVector information = CalibrationVector::Zero();  ///< 1 / sd^2 of what is known; 0 for nothing
};

struct CorrelatedStep {
  CalibrationVector change = CalibrationVector::Zero();
  CalibrationMatrix covariance = CalibrationMatrix::Zero();   ///< of the unknown ones; zero elsewhere
  CalibrationMatrix information = CalibrationMatrix::Zero();  ///< of these samples alone
  CalibrationVector slope = CalibrationVector::Zero();        ///< A' r of these samples, in the same weight
  double sigma_bar = 0.0;                                     ///< of one sample
  double rms_bar = 0.0;                                       ///< of the residual that the step leaves
  double samples = 0.0;                                       ///< that the residual is worth
};

/// `scratch` has the size of the residual. Rows outside [first, last) do not count.
CorrelatedStep correlated_step(const CalibrationColumns& columns, std::span<const double> residual_bar,
                               std::size_t first, std::size_t last, const CalibrationVector& x,
                               const Beforehand& beforehand, const EarlierData& earlier, double least_sigma_bar,
                               std::span<double> scratch) noexcept;

}  // namespace mgdd::guide
