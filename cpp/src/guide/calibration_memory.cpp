// What an online calibration remembers of earlier cycles, and when it forgets them.
#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "mgdd/guide/online_calibration.hpp"

namespace mgdd::guide {
namespace {

constexpr double unremarkable = 1e-3;    // of the highest pressure: a residual that is never a jump
constexpr std::int64_t jump_cycles = 3;  // suspects in a row

}  // namespace

void OnlineCalibration::restart() noexcept {
  window_.clear();
  block_ = earlier_ = EarlierData{};
  has_mean_ = has_block_ = false;
  usual_power_ = 0.0;
  settled_updates_ = suspects_ = 0;
  taken_ = checked_ = window_.accepted();
}

// Mean square of a residual that nobody need wonder at, where the timing scatters by that share of its variance.
double OnlineCalibration::expected_power(double share) const noexcept {
  return std::pow(unremarkable * highest_bar(), 2) + share * std::pow(settings_.soc_scatter_cad, 2) * soc_power_;
}

// A cycle unlike those before it does not reach the calibration; three in a row are the new truth.
bool OnlineCalibration::newest_is_suspect() noexcept {
  if (settled_updates_ < settled_after) return false;
  const CalibrationConditions at = window_.newest(newest_bar_);
  const double power = residual_power(x_, at, newest_bar_);
  if (usual_power_ > 0.0 && power > std::pow(settings_.jump_factor, 2) * std::max(usual_power_, expected_power(1.0))) {
    window_.drop_newest();
    if (++suspects_ >= jump_cycles) {
      restart();
      ++jumps_;
    }
    return true;
  }
  suspects_ = 0;
  const double share = usual_power_ > 0.0 ? 1.0 / settings_.window.window_cycles : 1.0;
  if (power >= 0.0) usual_power_ += share * (power - usual_power_);
  return false;
}

bool OnlineCalibration::take_mean() noexcept {
  const std::int64_t fresh = window_.accepted() - taken_;
  const bool recursive = settings_.method == CalibrationMethod::recursive;
  if (has_mean_ && fresh < (recursive ? settings_.window.window_cycles : 1)) return true;
  const bool known = recursive && has_block_;
  const double before = known ? residual_power(x_, mean_, mean_bar_) : 0.0;
  taken_ = window_.accepted();
  mean_ = window_.mean(mean_bar_);
  mean_.scatter_cad = settings_.soc_scatter_cad;
  has_mean_ = true;
  if (!known) return true;
  earlier_.information = settings_.forgetting * (earlier_.information + block_.information);
  earlier_.pull = settings_.forgetting * (earlier_.pull + block_.pull);
  const double m = settings_.window.window_cycles;
  let_wander(Calibrated::soc_offset, 2.0 * std::pow(settings_.soc_scatter_cad, 2) / m);
  let_wander(Calibrated::soc_variance, 2.0 * chance_of_soc_variance());
  const double usual = std::max(before, expected_power(2.0 / settings_.window.window_cycles));
  if (settled_updates_ < settled_after ||
      residual_power(x_, mean_, mean_bar_) <= std::pow(settings_.jump_factor, 2) * usual) {
    return true;
  }
  restart();
  ++jumps_;
  return false;
}

// The mean and the variance of the timings of M cycles are those of other cycles in the next window: as much variance
// for the parameter (matrix inversion lemma), while the mean of the earlier data stays.
void OnlineCalibration::let_wander(int parameter, double variance) noexcept {
  if (!beforehand_.unknown[place(parameter)] || !(variance > 0.0)) return;
  const CalibrationVector column = earlier_.information.col(parameter);
  const double divisor = 1.0 / variance + column[parameter];
  earlier_.pull -= column * (earlier_.pull[parameter] / divisor);
  earlier_.information -= column * column.transpose() / divisor;
}

// Variance of the variance of M timings, in that of the scatter: of their scatter itself, and of its chance correlation
// with what was told.
double OnlineCalibration::chance_of_soc_variance() const noexcept {
  if (!(mean_.scatter_cad > 0.0)) return 0.0;
  return (2.0 + 4.0 * std::pow(mean_.soc_sd_cad / mean_.scatter_cad, 2)) / settings_.window.window_cycles;
}

Beforehand OnlineCalibration::beforehand() const noexcept {
  constexpr int i = Calibrated::soc_variance;
  Beforehand out = beforehand_;
  if (out.unknown[place(i)]) out.information[i] = 1.0 / (1.0 / out.information[i] + chance_of_soc_variance());
  return out;
}

// What belongs to the old point is integrated out of the earlier data (Schur complement), with what was known of it.
void OnlineCalibration::forget_point() noexcept {
  const Beforehand known = beforehand();
  points_seen_ = window_.points_seen();
  if (has_block_) {
    EarlierData all{earlier_.information + block_.information, earlier_.pull + block_.pull};
    for (int i = 0; i < n_calibrated; ++i) {  // what is known exactly is put in
      if (beforehand_.unknown[place(i)]) continue;
      all.pull -= all.information.col(i) * x_[i];
      all.information.row(i).setZero();
      all.information.col(i).setZero();
      all.pull[i] = 0.0;
    }
    CalibrationMatrix own = CalibrationMatrix::Identity();
    CalibrationVector pull = CalibrationVector::Zero();
    CalibrationMatrix mixed = CalibrationMatrix::Zero();  // row: kept, column: of the point
    for (int i = 0; i < n_calibrated; ++i) {
      if (!info_of(i).at_point) continue;
      pull[i] = all.pull[i] + known.information[i] * known.start[i];
      for (int j = 0; j < n_calibrated; ++j) {
        if (info_of(j).at_point) {
          own(i, j) = all.information(i, j) + (i == j ? known.information[i] : 0.0);
        } else {
          mixed(j, i) = all.information(j, i);
        }
      }
      if (!beforehand_.unknown[place(i)]) own(i, i) = 1.0;
    }
    const Eigen::LDLT<CalibrationMatrix> factors(own);
    all.information -= mixed * factors.solve(mixed.transpose());
    all.pull -= mixed * factors.solve(pull);
    for (int i = 0; i < n_calibrated; ++i) {
      if (!info_of(i).at_point) continue;
      all.information.row(i).setZero();
      all.information.col(i).setZero();
      all.pull[i] = 0.0;
    }
    earlier_.information = settings_.forgetting * all.information;
    earlier_.pull = settings_.forgetting * all.pull;
  }
  for (int i = 0; i < n_calibrated; ++i) {
    if (info_of(i).at_point && !settings_.wanted[place(i)]) x_[i] = beforehand_.start[i];
  }
  block_ = EarlierData{};
  has_mean_ = has_block_ = false;
  settled_updates_ = suspects_ = 0;
  taken_ = checked_ = window_.accepted();
}

}  // namespace mgdd::guide
