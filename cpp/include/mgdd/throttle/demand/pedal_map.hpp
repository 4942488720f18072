// The driver's wish: engine torque [N m] over pedal [%] and speed [rpm], a table read bilinearly and held at its edges.
// `torque_nm` is noexcept and heap-free; to make and check a table is offline code.
#pragma once

#include <span>
#include <vector>

namespace mgdd::throttle {

/// With p the pedal 0..1 and M the full-load torque at a speed N: M (0.6 p + 0.4 p^2) - 0.1 M (1 - p) N/N_last, so
/// that the released pedal brakes. Our formula; rows are pedals, speeds run fastest.
std::vector<double> progressive_torque_nm(std::span<const double> pedal_percent, std::span<const double> speed_rpm,
                                          std::span<const double> full_load_nm);

/// The default is for a naturally aspirated engine of 2 L, whose full load the defaults of `IntakeAir` can feed.
struct PedalMap {
  std::vector<double> pedal_percent{0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0, 100.0};
  std::vector<double> speed_rpm{800.0, 1500.0, 2000.0, 2500.0, 3500.0, 4500.0, 5250.0, 6000.0};
  std::vector<double> wanted_nm = progressive_torque_nm(
      pedal_percent, speed_rpm, std::vector<double>{118.0, 118.0, 117.0, 116.0, 113.0, 110.0, 107.0, 104.0});

  /// Wanted torque; NaN for a number that is not finite.
  double torque_nm(double pedal, double speed) const noexcept;

  bool operator==(const PedalMap&) const = default;
};

/// ShapeError or ParameterError naming field, value and bound: axes of two or more increasing entries, pedal in 0..100,
/// speed > 0, one torque per cell that does not fall with the pedal.
void validate(const PedalMap& map);

}  // namespace mgdd::throttle
