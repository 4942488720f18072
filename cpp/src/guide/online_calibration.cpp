#include "mgdd/guide/online_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

constexpr int seeking_period = 10;  // trials
constexpr double seeking_time_constant = 30.0;

constexpr double resolution = 1e-4;    // of the highest pressure: no sensor is better
constexpr double settled_share = 2.0;  // of a standard error: steps below it are settled
constexpr double longest_step = 2.0;   // in what is known beforehand

OnlineCalibrationSettings checked(OnlineCalibrationSettings settings) {
  validate(settings);
  return settings;
}

std::optional<optimize::ExtremumSeeking> seeker_of(const OnlineCalibrationSettings& s, double start) {
  if (s.method != CalibrationMethod::extremum_seeking) return std::nullopt;
  const Domain& domain = info_of(Calibrated::wall_heat_scale).field.domain;
  optimize::ExtremumSeekingSettings e;
  const double inside = std::clamp(start, domain.lower + calibration_amplitude, domain.upper - calibration_amplitude);
  e.space = {
      optimize::scalar_input(inside), optimize::scalar_input(domain.lower), optimize::scalar_input(domain.upper), {}};
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

// Columns of one window after the other, each at its own estimate, would together know a direction that none of them
// sees; so all that add up are taken at the first settled estimate (Huang, Mourikis and Roumeliotis 2010).
bool OnlineCalibration::linearise() noexcept {
  const bool alone = settings_.method != CalibrationMethod::recursive || earlier_.information.isZero(0.0);
  for (int i = 0; i < n_calibrated; ++i) {
    if (alone || (info_of(i).at_point && settled_updates_ < settled_after)) anchor_[i] = x_[i];
  }
  if (residual_power(anchor_, mean_, mean_bar_) < 0.0 ||
      !model_.differentiate(anchor_, mean_, reading_bar_, columns_)) {
    return false;
  }
  soc_power_ = columns_.col(Calibrated::soc_offset).squaredNorm() / static_cast<double>(columns_.rows());
  return anchor_ == x_ || residual_power(x_, mean_, mean_bar_) >= 0.0;
}

CalibrationStatus OnlineCalibration::step() noexcept {
  if (!linearise()) {
    x_ = beforehand_.start;
    block_ = earlier_ = EarlierData{};
    has_block_ = false;
    return CalibrationStatus::unphysical;
  }
  const auto stepped = [&](const Beforehand& moving) {
    return correlated_step(columns_, residual_bar_, first_row_, last_row_, x_, moving, earlier_,
                           resolution * highest_bar(), scratch_);
  };
  // What the data want beyond its bound stays, then what they do not show; the rest moves as if that were known.
  Beforehand moving = beforehand();
  CorrelatedStep s = stepped(moving);
  covariance_ = s.covariance;
  for (int i = 0; i < n_calibrated; ++i) {
    const Domain& domain = info_of(i).field.domain;
    const bool outward = (x_[i] <= domain.lower && s.change[i] < 0.0) || (x_[i] >= domain.upper && s.change[i] > 0.0);
    if (outward) moving.unknown[place(i)] = false;
  }
  if (moving.unknown != beforehand_.unknown) {
    s = stepped(moving);
    const CalibrationVector alone = covariance_.diagonal();
    covariance_ = s.covariance;
    for (int i = 0; i < n_calibrated; ++i) {
      if (!moving.unknown[place(i)]) covariance_(i, i) = alone[i];
    }
  }
  bool all = true, any = false;
  for (int i = 0; i < n_calibrated; ++i) {
    if (!settings_.wanted[place(i)]) continue;
    const bool held = is_held(i);
    if (held) moving.unknown[place(i)] = false;
    all = all && held;
    any = any || held;
  }
  if (any) s = stepped(moving);
  const CalibrationVector& change = s.change;
  rms_bar_ = s.rms_bar;
  sigma_bar_ = s.sigma_bar;
  samples_ = s.samples;
  if (settings_.method == CalibrationMethod::recursive) {
    block_ = {s.information, s.slope + s.information * x_};
    has_block_ = true;
  }
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
  if (!linearise()) return CalibrationStatus::unphysical;
  // Moving one parameter alone, the errors of all others act in full ("consider" covariance).
  const Beforehand known = beforehand();
  Beforehand alone = known;
  alone.unknown.fill(false);
  alone.unknown[place(wall)] = true;
  const CorrelatedStep s = correlated_step(columns_, residual_bar_, first_row_, last_row_, x_, alone, EarlierData{},
                                           resolution * highest_bar(), scratch_);
  rms_bar_ = s.rms_bar;
  sigma_bar_ = s.sigma_bar;
  samples_ = s.samples;
  covariance_ = s.covariance;
  for (int i = 0; i < n_calibrated; ++i) {
    if (i == wall || !known.unknown[place(i)]) continue;
    const double variance = 1.0 / known.information[i];
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
