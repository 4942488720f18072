// What a throttle plate leaves open: a round plate on a shaft in a round bore, area and discharge coefficient over the
// angle, and both inverses. Parameters in field units; areas in m², angles in rad inside. noexcept, heap-free.
// Area: Heywood 1988, chapter 7, with the signs of the exact geometry (the form printed in many places falls after
// 74.85 deg). The discharge coefficient is a placeholder of plausible shape, to be fitted to a flow bench.
#pragma once

namespace mgdd::throttle {

struct ThrottleBore {
  double bore_mm = 60.0;
  double shaft_mm = 8.0;
  double plate_closed_deg = 6.0;  ///< of the plate against the cross-section where the opening is zero
  double leak_mm2 = 3.0;          ///< open at any angle
  double discharge_5 = 0.65;      ///< [-] discharge coefficient up to 5 deg of opening, then linear
  double discharge_20 = 0.75;     ///< at 20 deg
  double discharge_45 = 0.85;
  double discharge_90 = 0.90;
  double discharge_pressure_loss = 0.1;  ///< [-] share that it loses at equal pressures

  bool operator==(const ThrottleBore&) const = default;
};

/// Prepared for evaluation. Angles are cut to 0..90 deg.
class PlateOpening {
 public:
  explicit PlateOpening(const ThrottleBore& bore) noexcept;

  /// Open area with the leak [m²]; constant once the shaft alone is in the way.
  double area_m2(double angle_rad) const noexcept;
  /// Discharge coefficient at ratio 0 [-].
  double discharge(double angle_rad) const noexcept;
  /// Their product [m²]: rises with the angle.
  double effective_m2(double angle_rad) const noexcept;

  /// Smallest angle of at least that area; the closed or the wide-open one beyond its range.
  double angle_of_area_rad(double area_m2) const noexcept;
  /// Smallest angle of at least that product.
  double angle_of_effective_rad(double effective_m2) const noexcept;

 private:
  ThrottleBore bore_;
  double bore_m2_, shaft_ratio_, cos_closed_, closed_rad_, shaft_term_;
};

}  // namespace mgdd::throttle
