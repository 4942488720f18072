// The parameters of an online calibration: what may be adapted, and what stands between model and measurement that
// nobody knows exactly. Names, units, bounds, and how well each is known beforehand. No heap.
#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "mgdd/common/record.hpp"

namespace mgdd::guide {

inline constexpr int n_calibrated = 12;
using CalibrationVector = Eigen::Matrix<double, n_calibrated, 1>;
using CalibrationMatrix = Eigen::Matrix<double, n_calibrated, n_calibrated>;

/// Places in a CalibrationVector. The first eight need a derivative of the cycle model.
struct Calibrated {
  static constexpr int wall_heat_scale = 0, soc_offset = 1, burn_duration = 2, gamma = 3, fuel_heat = 4,
                       compression_ratio = 5, charge_temperature = 6, wall_temperature = 7, tdc = 8, gain = 9,
                       offset = 10, soc_variance = 11;
};

struct CalibratedInfo {
  FieldInfo field;     ///< name, unit and bounds
  double start = 0.0;  ///< value beforehand; the wall heat starts from that of the cylinder
  /// How well it is known beforehand, as a standard deviation; data that know less teach nothing.
  double known_sd = 0.0;
  /// Standard error below which it counts as determined; of the wall heat a share of its value.
  double determined_sd = 0.0;
  bool at_point = false;  ///< belongs to the operating point and is not carried to the next one
};

/// Ours. Two standard deviations of what is known beforehand move a determined wall heat by at most 5 %.
inline constexpr std::array<CalibratedInfo, n_calibrated> calibrated_parameters{{
    {{"wall_heat_scale", "-", closed(0.2, 2.5), "wall heat over the textbook law"}, 0.5, 0.25, 0.025, false},
    {{"soc_offset_cad", "degree", closed(-5.0, 5.0), "start of combustion less what was told"}, 0.0, 0.3, 0.1, true},
    {{"burn_duration_scale", "-", closed(0.5, 2.0), "burn duration over that of the model"}, 1.0, 0.05, 0.025, true},
    {{"gamma_offset", "-", closed(-0.1, 0.1), "ratio of specific heats less that of the model"},
     0.0,
     0.01,
     0.0025,
     false},
    {{"fuel_heat_scale", "-", closed(0.5, 1.5), "heat of the fuel over that of the operating point"},
     1.0,
     0.02,
     0.005,
     true},
    {{"compression_ratio_offset", "-", closed(-1.0, 1.0), "compression ratio less that of the model"},
     0.0,
     0.1,
     0.05,
     false},
    // Nearly the same mark on pressure as a volumetric efficiency or a trapped mass that is off: 10 K are 3 %.
    {{"charge_temperature_offset_k", "K", closed(-60.0, 60.0), "charge at IVC less that of the operating point"},
     0.0,
     10.0,
     2.5,
     false},
    {{"wall_temperature_offset_k", "K", closed(-250.0, 250.0), "mean wall temperature less that of the model"},
     0.0,
     70.0,
     15.0,
     false},
    {{"tdc_offset_cad", "degree", closed(-3.0, 3.0), "angle of the trace less the true angle"}, 0.0, 0.3, 0.1, false},
    {{"pressure_gain", "-", closed(0.8, 1.25), "measured over true pressure"}, 1.0, 0.005, 0.0025, false},
    {{"pressure_offset_bar", "bar", closed(-2.0, 2.0), "measured less true pressure: pegging"}, 0.0, 0.1, 0.025, false},
    {{"soc_variance_scale", "-", closed(-50.0, 50.0),
      "variance of the timing beside what was told, over that expected"},
     1.0,
     1.0,
     0.25,
     true},
}};

/// The place of a parameter as an index of an array.
constexpr std::size_t place(int parameter) noexcept {
  return static_cast<std::size_t>(parameter);
}
constexpr const CalibratedInfo& info_of(int parameter) noexcept {
  return calibrated_parameters[place(parameter)];
}

}  // namespace mgdd::guide
