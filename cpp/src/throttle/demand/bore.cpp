#include "mgdd/throttle/demand/bore.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "mgdd/common/units.hpp"
#include "mgdd/math/monotone_inverse.hpp"
#include "mgdd/math/tables.hpp"

namespace mgdd::throttle {
namespace {

constexpr std::array discharge_angle_deg{5.0, 20.0, 45.0, 90.0};
constexpr double m2_per_mm2 = units::m_per_mm * units::m_per_mm;
constexpr double widest_rad = 90.0 * units::rad_per_deg;

// a sqrt(1 - a^2/c^2) + c asin(a/c): half the chord's share of an ellipse, c its shadow, a the shaft.
double half_shadow(double shaft, double shadow) noexcept {
  const double share = shaft / shadow;
  return shaft * std::sqrt(1.0 - share * share) + shadow * std::asin(share);
}

double cut(double angle_rad) noexcept {
  return std::clamp(angle_rad, 0.0, widest_rad);
}

}  // namespace

PlateOpening::PlateOpening(const ThrottleBore& bore) noexcept
    : bore_(bore),
      bore_m2_(0.25 * std::numbers::pi * bore.bore_mm * bore.bore_mm * m2_per_mm2),
      shaft_ratio_(bore.shaft_mm / bore.bore_mm),
      cos_closed_(std::cos(bore.plate_closed_deg * units::rad_per_deg)),
      closed_rad_(bore.plate_closed_deg * units::rad_per_deg),
      shaft_term_(half_shadow(shaft_ratio_, 1.0)) {}

double PlateOpening::area_m2(double angle_rad) const noexcept {
  const double angle = cut(angle_rad);
  const double shadow = std::cos(angle + closed_rad_) / cos_closed_;
  // From where the shaft hides the plate's edge on, the shaft alone is in the way.
  const double open = shadow > shaft_ratio_
                          ? 1.0 - shadow + 2.0 / std::numbers::pi * (half_shadow(shaft_ratio_, shadow) - shaft_term_)
                          : 1.0 - 2.0 / std::numbers::pi * shaft_term_;
  return bore_m2_ * open + bore_.leak_mm2 * m2_per_mm2;
}

double PlateOpening::discharge(double angle_rad) const noexcept {
  const std::array coefficients{bore_.discharge_5, bore_.discharge_20, bore_.discharge_45, bore_.discharge_90};
  return place_in(discharge_angle_deg, cut(angle_rad) / units::rad_per_deg).value_of(coefficients);
}

double PlateOpening::effective_m2(double angle_rad) const noexcept {
  return discharge(angle_rad) * area_m2(angle_rad);
}

double PlateOpening::angle_of_area_rad(double area) const noexcept {
  return monotone_inverse([this](double angle) noexcept { return area_m2(angle); }, area, 0.0, widest_rad);
}

double PlateOpening::angle_of_effective_rad(double effective) const noexcept {
  return monotone_inverse([this](double angle) noexcept { return effective_m2(angle); }, effective, 0.0, widest_rad);
}

}  // namespace mgdd::throttle
