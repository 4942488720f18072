#include "mgdd/guide/online_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

constexpr int seeking_period = 10;  // trials
constexpr double seeking_time_constant = 30.0;

constexpr double resolution = 1e-4;      // of the highest pressure: no sensor is better
constexpr double unremarkable = 1e-3;    // of the highest pressure: a residual that is never a jump
constexpr std::int64_t jump_cycles = 3;  // suspects in a row
constexpr std::int64_t settled_after = 3;
constexpr double settled_share = 2.0;  // of a standard error: steps below it are settled
constexpr double longest_step = 2.0;   // in what is known beforehand

std::size_t place(int parameter) noexcept {
  return static_cast<std::size_t>(parameter);
}

OnlineCalibrationSettings checked(OnlineCalibrationSettings settings) {
  validate(settings);
  return settings;
}

std::optional<optimize::ExtremumSeeking> seeker_of(const OnlineCalibrationSettings& s, double start) {
  if (s.method != CalibrationMethod::extremum_seeking) return std::nullopt;
  const Domain& domain = info_of(Calibrated::wall_heat_scale).field.domain;
  optimize::ExtremumSeekingSettings e;
  const double inside = std::clamp(start, domain.lower + calibration_amplitude, domain.upper - calibration_amplitude);
  e.space = {optimize::scalar_input(inside), optimize::scalar_input(domain.lower),
             optimize::scalar_input(domain.upper)};
  e.form = optimize::MeanRemoval::moving_average;
  e.dither = {.amplitude = optimize::scalar_input(calibration_amplitude), .period = seeking_period, .harmonics = {1}};
  e.gain = optimize::scalar_input(2.0 / (calibration_amplitude * seeking_time_constant));  // J is scaled to J'' = -1
  return optimize::ExtremumSeeking(e);
}

bool refused(CalibrationStatus status) noexcept {
  return status != CalibrationStatus::accepted && status != CalibrationStatus::collecting;
}

}  // namespace

OnlineCalibration::OnlineCalibration(const OnlineCalibrationSettings& settings)
    : settings_(checked(settings)),
      model_(settings_.cylinder, settings_.step_cad, settings_.integrator),
      window_(settings_.window, model_.volume_m3(), model_.swept_m3()),
      beforehand_(beforehand_of(settings_)),
      seeker_(seeker_of(settings_, beforehand_.start[Calibrated::wall_heat_scale])),
      x_(beforehand_.start) {
  const auto angles = model_.angles_cad();
  const std::size_t n = angles.size();
  columns_.setZero(static_cast<Eigen::Index>(n), n_calibrated);
  for (std::vector<double>* each : {&reading_bar_, &residual_bar_, &scratch_, &newest_bar_, &mean_bar_})
    each->resize(n);
  const double reach = info_of(Calibrated::tdc).field.domain.upper;
  const auto at = [&](double angle) { return std::lower_bound(angles.begin(), angles.end(), angle) - angles.begin(); };
  first_row_ = static_cast<std::size_t>(at(angles.front() + reach));
  last_row_ = static_cast<std::size_t>(at(angles.back() - reach));
  last_offer_ = last_status_ = static_cast<std::int64_t>(CalibrationStatus::collecting);
}

CalibrationStatus OnlineCalibration::offer(std::span<const double> pressure_bar, const engine::OperatingPoint& point,
                                           double soc_cad, bool misfire) noexcept {
  const CalibrationStatus status = window_.offer(pressure_bar, point, soc_cad, misfire);
  if (window_.points_seen() != points_seen_) forget_point();
  last_offer_ = last_status_ = static_cast<std::int64_t>(status);
  return status;
}

CalibrationStatus OnlineCalibration::update() noexcept {
  const CalibrationStatus status = advance();
  last_status_ = static_cast<std::int64_t>(status);
  return status;
}

CalibrationStatus OnlineCalibration::advance() noexcept {
  const auto offered = static_cast<CalibrationStatus>(last_offer_);
  if (refused(offered)) return offered;
  if (window_.accepted() != checked_) {
    const bool suspect = newest_is_suspect();
    checked_ = window_.accepted();
    if (suspect) return CalibrationStatus::jump;
  }
  if (window_.full()) {
    if (window_.cov_percent() >= settings_.window.cov_limit_percent) return CalibrationStatus::cov;
    if (!take_mean()) return CalibrationStatus::jump;
  }
  if (!has_mean_) return CalibrationStatus::collecting;
  return seeker_ ? seek(*seeker_) : step();
}

void OnlineCalibration::restart() noexcept {
  window_.clear();
  block_ = earlier_ = EarlierData{};
  has_mean_ = has_block_ = false;
  usual_power_ = 0.0;
  settled_updates_ = suspects_ = 0;
  taken_ = checked_ = window_.accepted();
}

double OnlineCalibration::highest_bar() const noexcept {
  return *std::max_element(mean_bar_.begin(), mean_bar_.end());
}

double OnlineCalibration::residual_power(const CalibrationVector& x, const CalibrationConditions& at,
                                         std::span<const double> measured_bar) noexcept {
  if (!model_.predict(x, at, reading_bar_)) return -1.0;
  double power = 0.0;
  for (std::size_t k = 0; k < measured_bar.size(); ++k) {
    residual_bar_[k] = measured_bar[k] - reading_bar_[k];
    if (k >= first_row_ && k < last_row_) power += residual_bar_[k] * residual_bar_[k];
  }
  return power / static_cast<double>(last_row_ - first_row_);
}

// A cycle unlike those before it does not reach the calibration; three in a row are the new truth.
bool OnlineCalibration::newest_is_suspect() noexcept {
  if (settled_updates_ < settled_after) return false;
  const CalibrationConditions at = window_.newest(newest_bar_);
  const double power = residual_power(x_, at, newest_bar_);
  const double floor = std::pow(unremarkable * highest_bar(), 2);
  if (usual_power_ > 0.0 && power > std::pow(settings_.jump_factor, 2) * std::max(usual_power_, floor)) {
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
  mean_.soc_sd_cad = std::hypot(mean_.soc_sd_cad, settings_.soc_scatter_cad);
  has_mean_ = true;
  if (!known) return true;
  earlier_.information = settings_.forgetting * (earlier_.information + block_.information);
  earlier_.pull = settings_.forgetting * (earlier_.pull + block_.pull);
  let_timing_wander();
  const double usual = std::max(before, std::pow(unremarkable * highest_bar(), 2));
  if (settled_updates_ < settled_after ||
      residual_power(x_, mean_, mean_bar_) <= std::pow(settings_.jump_factor, 2) * usual) {
    return true;
  }
  restart();
  ++jumps_;
  return false;
}

// Two means of M cycles differ by sqrt(2/M) of the scatter: as much variance for the offset of the timing (matrix
// inversion lemma), while the mean of the earlier data stays.
void OnlineCalibration::let_timing_wander() noexcept {
  constexpr int soc = Calibrated::soc_offset;
  const double variance = 2.0 * std::pow(settings_.soc_scatter_cad, 2) / settings_.window.window_cycles;
  if (!beforehand_.unknown[place(soc)] || !(variance > 0.0)) return;
  const CalibrationVector column = earlier_.information.col(soc);
  const double divisor = 1.0 / variance + column[soc];
  earlier_.pull -= column * (earlier_.pull[soc] / divisor);
  earlier_.information -= column * column.transpose() / divisor;
}

// What belongs to the old point is integrated out of the earlier data (Schur complement), with what was known of it.
void OnlineCalibration::forget_point() noexcept {
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
      pull[i] = all.pull[i] + beforehand_.information[i] * beforehand_.start[i];
      for (int j = 0; j < n_calibrated; ++j) {
        if (info_of(j).at_point) {
          own(i, j) = all.information(i, j) + (i == j ? beforehand_.information[i] : 0.0);
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

CalibrationStatus OnlineCalibration::step() noexcept {
  if (residual_power(x_, mean_, mean_bar_) < 0.0 || !model_.differentiate(x_, mean_, columns_)) {
    x_ = beforehand_.start;
    return CalibrationStatus::unphysical;
  }
  const CorrelatedStep s = correlated_step(columns_, residual_bar_, first_row_, last_row_, x_, beforehand_, earlier_,
                                           resolution * highest_bar(), scratch_);
  covariance_ = s.covariance;
  rms_bar_ = s.rms_bar;
  sigma_bar_ = s.sigma_bar;
  samples_ = s.samples;
  if (settings_.method == CalibrationMethod::recursive) {
    block_ = {s.information, s.slope + s.information * x_};
    has_block_ = true;
  }
  std::array<bool, n_calibrated> held{};
  bool any = false, all = true;
  for (int i = 0; i < n_calibrated; ++i) {
    if (!settings_.wanted[place(i)]) continue;
    held[place(i)] = is_held(i);
    any = any || held[place(i)];
    all = all && held[place(i)];
  }
  CalibrationVector change = any ? step_with_held(s, x_, beforehand_, earlier_, held) : s.change;
  double farthest = 1.0, unsettled = 0.0;
  for (int i = 0; i < n_calibrated; ++i)
    farthest = std::max(farthest, std::abs(change[i]) / (longest_step * info_of(i).known_sd));
  for (int i = 0; i < n_calibrated; ++i) {
    const double moved = info_of(i).field.domain.clamped(x_[i] + change[i] / farthest);
    const double error = std::sqrt(std::max(covariance_(i, i), 0.0));
    if (error > 0.0) unsettled = std::max(unsettled, std::abs(moved - x_[i]) / error);
    x_[i] = moved;
  }
  settled_updates_ = unsettled <= settled_share ? settled_updates_ + 1 : 0;
  ++updates_;
  return all ? CalibrationStatus::poor_excitation : CalibrationStatus::updated;
}

CalibrationStatus OnlineCalibration::seek(optimize::ExtremumSeeking& seeker) noexcept {
  constexpr int wall = Calibrated::wall_heat_scale;
  if (residual_power(x_, mean_, mean_bar_) < 0.0 || !model_.differentiate(x_, mean_, columns_)) {
    return CalibrationStatus::unphysical;
  }
  // Moving one parameter alone, the errors of all others act in full ("consider" covariance).
  Beforehand alone = beforehand_;
  alone.unknown.fill(false);
  alone.unknown[place(wall)] = true;
  const CorrelatedStep s = correlated_step(columns_, residual_bar_, first_row_, last_row_, x_, alone, EarlierData{},
                                           resolution * highest_bar(), scratch_);
  rms_bar_ = s.rms_bar;
  sigma_bar_ = s.sigma_bar;
  samples_ = s.samples;
  covariance_ = s.covariance;
  for (int i = 0; i < n_calibrated; ++i) {
    if (i == wall || !beforehand_.unknown[place(i)]) continue;
    const double variance = 1.0 / beforehand_.information[i];
    const double pull = s.information(wall, i) / s.information(wall, wall);
    covariance_(wall, wall) += pull * pull * variance;
    covariance_(i, i) = variance;
    covariance_(wall, i) = covariance_(i, wall) = pull * variance;
  }
  ++updates_;
  if (is_held(wall)) return CalibrationStatus::poor_excitation;
  const double bend = 2.0 * columns_.col(wall).squaredNorm() / static_cast<double>(last_row_ - first_row_);
  const double before = x_[wall];
  for (int trial = 0; trial < settings_.trials_per_update; ++trial) {
    CalibrationVector tried = x_;
    tried[wall] = seeker.ask()[0];
    const double power = residual_power(tried, mean_, mean_bar_);
    const double value[] = {-power / bend};
    seeker.tell({.components = value, .limits = {}, .misfire = power < 0.0});
  }
  x_[wall] = seeker.estimate()[0];
  settled_updates_ = std::abs(x_[wall] - before) <= calibration_amplitude / seeking_period ? settled_updates_ + 1 : 0;
  return CalibrationStatus::updated;
}

}  // namespace mgdd::guide
