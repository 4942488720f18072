// Slider-crank geometry: volume, its slope and the wall area against crank angle. Angles in °CA aTDC, results in SI.
// Source: Tan 2018, eq. 2-1; Heywood 1988, chapters 2 and 15 (slope and area).
#pragma once

#include <cmath>
#include <numbers>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"

namespace mgdd::engine {

template <class T>
struct Geometry {
  T swept_m3, clearance_m3, piston_area_m2, bore_m, stroke_m;
  T rod_ratio;    ///< [-] connecting rod over crank radius, R of eq. 2-1
  T area_factor;  ///< [-]

  explicit Geometry(const GeometryParameters<T>& c) noexcept
      : bore_m(c.bore_mm * units::m_per_mm),
        stroke_m(c.stroke_mm * units::m_per_mm),
        rod_ratio(c.connecting_rod_mm * 2.0 / c.stroke_mm),
        area_factor(c.bowl_area_factor) {
    piston_area_m2 = bore_m * bore_m * (std::numbers::pi / 4.0);
    swept_m3 = piston_area_m2 * stroke_m;
    clearance_m3 = swept_m3 / (c.compression_ratio - 1.0);
  }

  /// V = Vc + Vs/2 [1 + R - cos - sqrt(R^2 - sin^2)] (Tan 2018, eq. 2-1). Exact at both dead centres.
  T volume_m3(double crank_angle_cad) const noexcept {
    using std::sqrt;
    const double phi = crank_angle_cad * units::rad_per_deg;
    const double s = std::sin(phi);
    return clearance_m3 + swept_m3 * 0.5 * (1.0 + rod_ratio - std::cos(phi) - sqrt(rod_ratio * rod_ratio - s * s));
  }

  /// dV/dphi per degree of crank angle (Heywood 1988, chapter 2).
  T volume_slope_m3_per_cad(double crank_angle_cad) const noexcept {
    using std::sqrt;
    const double phi = crank_angle_cad * units::rad_per_deg;
    const double s = std::sin(phi);
    return swept_m3 * (0.5 * s) * (1.0 + std::cos(phi) / sqrt(rod_ratio * rod_ratio - s * s)) * units::rad_per_deg;
  }

  /// Wall area of a flat-disc chamber at a given volume: two discs times `bowl_area_factor` plus the liner.
  /// Tan 2018 only names A_s; this form follows Heywood 1988, chapter 2.
  T wall_area_m2(const T& volume_m3) const noexcept {
    return area_factor * 2.0 * piston_area_m2 + volume_m3 / piston_area_m2 * bore_m * std::numbers::pi;
  }

  /// Mean piston speed 2 S N / 60 [m/s].
  T mean_piston_speed_m_per_s(const T& speed_rpm) const noexcept { return stroke_m * speed_rpm * (2.0 / 60.0); }
};

}  // namespace mgdd::engine
