// The last cycles that may teach a calibration, and why another one may not. Pressure bar on one crank grid; `offer` is
// noexcept and allocation-free, and a refused cycle leaves the window as it was.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/guide/calibration_model.hpp"

namespace mgdd::guide {

/// What became of a cycle, or of an update.
enum class CalibrationStatus {
  accepted,         ///< the cycle was taken
  updated,          ///< the parameters moved, or stand where the data want them
  collecting,       ///< too few cycles yet, or none that is new
  poor_excitation,  ///< the data know less than was known beforehand: everything is held
  misfire,          ///< said, or seen: IMEP below half of the median, or not positive
  cov,              ///< COV of IMEP in the window at or above its limit
  jump,             ///< the residual is far above what it was
  unsteady,         ///< too soon after a change of operating point
  saturated,        ///< the highest pressure stands still
  unusable,         ///< a number that is not finite or outside its domain
  wrong_size,       ///< not one pressure per angle of the model
  unphysical,       ///< the model has no such cycle
};
constexpr std::string_view other_name(CalibrationStatus status) noexcept {
  switch (status) {
    case CalibrationStatus::poor_excitation:
      return "poor excitation";
    case CalibrationStatus::cov:
      return "COV";
    case CalibrationStatus::unusable:
      return "unusable numbers";
    case CalibrationStatus::wrong_size:
      return "wrong size";
    case CalibrationStatus::unphysical:
      return "no such cycle";
    default:
      return "";
  }
}

struct CycleWindowSettings {
  int window_cycles = 10;          ///< M, in [2, 500]
  int steady_cycles = 20;          ///< cycles that are left out after a change of operating point, in [0, 10000]
  double cov_limit_percent = 3.0;  ///< of IMEP in the window, in (0, 100]
};

class CycleWindow {
 public:
  /// ParameterError by name. Volumes belong to the angles of the traces; `swept_m3` scales IMEP.
  CycleWindow(const CycleWindowSettings& settings, std::span<const double> volume_m3, double swept_m3);

  CalibrationStatus offer(std::span<const double> pressure_bar, const engine::OperatingPoint& point, double soc_cad,
                          bool misfire) noexcept;
  /// Forgets the cycles, not the operating point.
  void clear() noexcept { held_ = 0; }
  /// Forgets the newest cycle.
  void drop_newest() noexcept;

  bool full() const noexcept { return held_ == static_cast<std::int64_t>(imep_bar_.size()); }
  std::int64_t accepted() const noexcept {
    return accepted_;
  }  ///< cycles taken since the start, dropped ones not counted
  std::int64_t points_seen() const noexcept { return points_seen_; }  ///< changes of operating point since the start
  double cov_percent() const noexcept;  ///< of closed IMEP in the window; 0 below two cycles or without fuel

  /// Mean trace and conditions of the window, and those of its newest cycle.
  CalibrationConditions mean(std::span<double> pressure_bar) const noexcept;
  CalibrationConditions newest(std::span<double> pressure_bar) const noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("window_pressure_bar", self.pressure_bar_);
    v("window_soc_cad", self.soc_cad_);
    v("window_imep_bar", self.imep_bar_);
    v("window_points", self.points_);
    v("window_next", self.next_, static_cast<std::int64_t>(self.imep_bar_.size()));
    v("window_held", self.held_, static_cast<std::int64_t>(self.imep_bar_.size()) + 1);
    v("window_accepted", self.accepted_, counts_end);
    v("window_points_seen", self.points_seen_, counts_end);
    v("window_steady_left", self.steady_left_, std::int64_t{self.settings_.steady_cycles} + 1);
    v("window_has_point", self.has_point_);
    v("window_point", self.reference_);
    v("window_burn_duration_cad", self.optionals_.burn_duration_cad);
    v("window_trapped_mass_g", self.optionals_.trapped_mass_g);
    v("window_ivc_temperature_k", self.optionals_.ivc_temperature_k);
  }

 private:
  static constexpr std::size_t point_numbers = 4;
  using PointNumbers = std::array<double, point_numbers>;

  bool same_point(const PointNumbers& now, const engine::OperatingPoint& point) const noexcept;
  double imep_bar(std::span<const double> pressure_bar) const noexcept;
  bool looks_misfired(double imep_bar) const noexcept;
  engine::OperatingPoint point_of(const PointNumbers& numbers) const noexcept;

  CycleWindowSettings settings_;
  std::vector<double> volume_m3_;
  double swept_m3_;
  std::vector<double> pressure_bar_, soc_cad_, imep_bar_, points_;  // rings of the last M cycles
  mutable std::vector<double> sorted_;                              // scratch of the median
  std::int64_t next_ = 0, held_ = 0, accepted_ = 0, points_seen_ = 0, steady_left_ = 0;
  bool has_point_ = false;
  PointNumbers reference_{};            // operating point that the window belongs to
  engine::OperatingPoint optionals_{};  // its optional fields
};

}  // namespace mgdd::guide
