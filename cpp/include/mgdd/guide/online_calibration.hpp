// Online calibration: while an engine runs, parameters of the cycle model follow the mean pressure of its last cycles.
// Tan (2018), chapter 6, and Tan et al. (2016) tune the wall heat by extremum seeking on the pressure error;
// Gauss-Newton with exact derivatives and its recursive form are ours, as are the safeguards. Angles °CA aTDC, pressure
// bar. `offer` and `update` are noexcept, allocation-free and of bounded work; one call of each per engine cycle.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/guide/calibration_model.hpp"
#include "mgdd/guide/correlated_step.hpp"
#include "mgdd/guide/cycle_window.hpp"
#include "mgdd/guide/online_calibration_settings.hpp"
#include "mgdd/optimize/laws/extremum_seeking.hpp"

namespace mgdd::guide {

/// Dither of extremum seeking, in wall-heat scales; its estimate keeps that distance from the bounds.
inline constexpr double calibration_amplitude = 0.05;

/// How much a parameter deserves belief.
enum class Knowledge {
  no_data,       ///< no step yet
  determined,    ///< standard error within `determined_sd`
  uncertain,     ///< above it
  held,          ///< the data know less than was known beforehand
  at_bound,      ///< the data want it beyond its bound
  contradicted,  ///< a nuisance had to move more than three of its standard deviations: the model itself does not fit
};
constexpr std::string_view other_name(Knowledge knowledge) noexcept {
  return knowledge == Knowledge::no_data ? "no data" : knowledge == Knowledge::at_bound ? "at bound" : "";
}

struct CalibrationVerdict {
  Knowledge knowledge = Knowledge::no_data;
  int culprit = -1;  ///< parameter that makes it uncertain or contradicts, -1 if none does
};

class OnlineCalibration {
 public:
  /// ParameterError by name.
  explicit OnlineCalibration(const OnlineCalibrationSettings& settings);

  /// One measured cycle on `angles_cad`: pressure [bar], its operating point, the start of combustion commanded or
  /// measured [°CA aTDC], and whether it misfired.
  CalibrationStatus offer(std::span<const double> pressure_bar, const engine::OperatingPoint& point, double soc_cad,
                          bool misfire = false) noexcept;

  /// At most one Gauss-Newton step, or `trials_per_update` trials. Without effect after a refused cycle.
  CalibrationStatus update() noexcept;

  /// Forgets all cycles and earlier data, keeps the parameters.
  void restart() noexcept;

  const CalibrationVector& parameters() const noexcept { return x_; }
  CalibrationVector standard_errors() const noexcept;
  CalibrationVerdict verdict(int parameter) const noexcept;
  std::string explain(int parameter) const;  ///< one sentence
  bool determined() const noexcept;          ///< every wanted parameter is
  engine::Cylinder cylinder() const noexcept { return model_.cylinder(x_, settings_.wanted); }

  CalibrationStatus status() const noexcept {
    return static_cast<CalibrationStatus>(last_status_);
  }  ///< of the last call
  std::span<const double> angles_cad() const noexcept { return model_.angles_cad(); }
  double residual_rms_bar() const noexcept { return rms_bar_; }  ///< of the mean trace, after the last step
  double noise_bar() const noexcept { return sigma_bar_; }       ///< of one sample of the mean trace
  double effective_samples() const noexcept { return samples_; }
  double cov_percent() const noexcept { return window_.cov_percent(); }
  std::int64_t updates() const noexcept { return updates_; }
  std::int64_t accepted() const noexcept { return window_.accepted(); }
  std::int64_t jumps() const noexcept { return jumps_; }
  const OnlineCalibrationSettings& settings() const noexcept { return settings_; }

  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    CycleWindow::visit(self.window_, v);
    v("parameters", self.x_);
    v("covariance", self.covariance_);
    v("block_information", self.block_.information);
    v("block_pull", self.block_.pull);
    v("earlier_information", self.earlier_.information);
    v("earlier_pull", self.earlier_.pull);
    v("mean_pressure_bar", self.mean_bar_);
    v("mean_soc_cad", self.mean_.soc_cad);
    v("mean_soc_sd_cad", self.mean_.soc_sd_cad);
    v("mean_scatter_cad", self.mean_.scatter_cad);
    for (const auto& field : engine::operating_point_fields<double>())
      v("mean_" + std::string(field.info.name), field.in(self.mean_.point));
    v("mean_burn_duration_cad", self.mean_.point.burn_duration_cad);
    v("mean_trapped_mass_g", self.mean_.point.trapped_mass_g);
    v("mean_ivc_temperature_k", self.mean_.point.ivc_temperature_k);
    v("rms_bar", self.rms_bar_);
    v("sigma_bar", self.sigma_bar_);
    v("samples", self.samples_);
    v("usual_power_bar2", self.usual_power_);
    v("soc_power_bar2_per_cad2", self.soc_power_);
    v("anchor", self.anchor_);
    v("updates", self.updates_, counts_end);
    v("settled_updates", self.settled_updates_, counts_end);
    v("taken", self.taken_, counts_end);
    v("checked", self.checked_, counts_end);
    v("points_seen", self.points_seen_, counts_end);
    v("jumps", self.jumps_, counts_end);
    v("suspects", self.suspects_, counts_end);
    v("has_mean", self.has_mean_);
    v("has_block", self.has_block_);
    v("last_offer", self.last_offer_, statuses);
    v("last_status", self.last_status_, statuses);
    if (self.seeker_) optimize::ExtremumSeeking::visit(*self.seeker_, v);
  }

 private:
  static constexpr std::int64_t statuses = 12;
  static constexpr std::int64_t settled_after = 3;  // updates

  CalibrationStatus advance() noexcept;
  bool newest_is_suspect() noexcept;
  bool take_mean() noexcept;  // false: the new mean contradicts what was learnt
  void forget_point() noexcept;
  void let_wander(int parameter, double variance) noexcept;
  double chance_of_soc_variance() const noexcept;
  Beforehand beforehand() const noexcept;  ///< for the mean in work
  CalibrationStatus step() noexcept;
  bool linearise() noexcept;  // false where the model has no such cycle
  CalibrationStatus seek(optimize::ExtremumSeeking& seeker) noexcept;
  /// Mean square of measured less predicted over the rows in use; negative where the model has no such cycle.
  double residual_power(const CalibrationVector& x, const CalibrationConditions& at,
                        std::span<const double> measured_bar) noexcept;
  bool is_held(int parameter) const noexcept;
  double highest_bar() const noexcept;
  double expected_power(double share) const noexcept;

  OnlineCalibrationSettings settings_;
  CalibrationModel model_;
  CycleWindow window_;
  Beforehand beforehand_;
  std::optional<optimize::ExtremumSeeking> seeker_;
  CalibrationColumns columns_;
  std::vector<double> reading_bar_, residual_bar_, scratch_, newest_bar_;
  std::size_t first_row_, last_row_;  // rows that a shift of TDC leaves inside the closed part

  CalibrationVector x_;
  CalibrationVector anchor_ = CalibrationVector::Zero();  // where the model is linearised
  CalibrationMatrix covariance_ = CalibrationMatrix::Zero();
  EarlierData block_, earlier_;  // of the mean in work, and of the windows before it
  std::vector<double> mean_bar_;
  CalibrationConditions mean_{};
  double rms_bar_ = 0.0, sigma_bar_ = 0.0, samples_ = 0.0;
  double usual_power_ = 0.0;  // mean square of a cycle's residual
  double soc_power_ = 0.0;    // the same by one degree of timing
  std::int64_t updates_ = 0, settled_updates_ = 0, taken_ = 0, checked_ = 0, points_seen_ = 0, jumps_ = 0,
               suspects_ = 0;
  bool has_mean_ = false, has_block_ = false;
  std::int64_t last_offer_ = 0, last_status_ = 0;  // a CalibrationStatus each
};

}  // namespace mgdd::guide
