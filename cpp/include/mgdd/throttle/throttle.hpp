// Parameters of one electronic throttle body: a flat struct in the units of the field, checked by `validate`.
// Everything is seen from the plate shaft (motor quantities reflected through the gear). Angles are degrees from the
// mechanically closed position, opening positive; torques are positive when they open, except the spring's, which is
// positive when it closes. Defaults are the preset P1 (Loh et al. 2013, table as quoted in public code).
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/control/plate.hpp"
#include "mgdd/dynamics/dry_friction.hpp"

namespace mgdd::throttle {

using dynamics::Friction;
/// Play between gear and plate.
enum class Backlash {
  none,
  compliance,  ///< two masses and a spring with a gap
  hysteresis,  ///< a play operator on the angle; valid where plate friction holds the plate inside the gap
};
/// What the bridge does while the duty is zero.
enum class Bridge {
  brake,  ///< both low sides on: the shorted motor brakes
  open,   ///< high impedance: no current, the fail-safe state
};

struct Throttle {
  // Motor and gear.
  double inertia_kgm2 = 0.0021;
  double viscous_nms_per_rad = 0.0088;
  double torque_constant_nm_per_a = 0.383;
  double back_emf_vs_per_rad = 0.383;
  double resistance_ohm = 1.5;
  double inductance_mh = 1.5;  ///< 0: the current follows the voltage at once

  // Driver.
  double supply_v = 12.0;
  double driver_drop_v = 0.0;  ///< lost at full duty, whatever the current
  double driver_resistance_ohm = 0.0;
  double dead_band = 0.0;  ///< [-] duty without effect on either side of zero

  // Dry friction.
  Friction friction = Friction::coulomb;
  double coulomb_nm = 0.284;
  double stiction_nm = 0.284;  ///< not used by coulomb and tanh
  double stribeck_rad_per_s = 0.3;
  double karnopp_rad_per_s = 0.05;
  double tanh_rad_per_s = 0.05;
  double bristle_nm_per_rad = 81.0;           ///< LuGre sigma_0: 0.2 deg of presliding
  double bristle_damping_nms_per_rad = 0.41;  ///< LuGre sigma_1

  // Limp-home springs: different parts above and below.
  double limp_home_deg = 8.0;
  double spring_above_nm_per_rad = 0.087;
  double spring_below_nm_per_rad = 0.087;
  double preload_above_nm = 0.396;
  double preload_below_nm = 0.396;
  double preload_ramp_deg = 0.25;  ///< half width over which the preload changes its sign

  // End stops.
  double closed_deg = 0.0;
  double open_deg = 90.0;
  double stop_stiffness_nm_per_rad = 5000.0;
  double stop_damping_nms_per_rad = 4.5;

  // Backlash.
  Backlash backlash = Backlash::none;
  double backlash_half_deg = 0.2;
  double gear_stiffness_nm_per_rad = 200.0;
  double gear_damping_nms_per_rad = 0.2;
  double plate_inertia_kgm2 = 0.0003;  ///< share of `inertia_kgm2` on the plate's side of the gap
  double plate_friction_share = 0.3;   ///< [-] of Coulomb, stiction and viscous friction, and of the bristles

  // Air flow: closing torque D^3 dp C_T(angle) (placeholder shape, to be fitted to a bench).
  double bore_mm = 60.0;
  double pressure_drop_kpa = 0.0;

  bool operator==(const Throttle&) const = default;

  /// Stall torque per unit duty, g = K (V - V_drop)/R [N m].
  [[nodiscard]] double stall_torque_nm() const noexcept {
    return torque_constant_nm_per_a * (supply_v - driver_drop_v) / (resistance_ohm + driver_resistance_ohm);
  }
  /// Viscous friction and braking by the shorted motor, b = K_v + K K_e/R [N m s/rad].
  [[nodiscard]] double damping_nms_per_rad() const noexcept {
    return viscous_nms_per_rad +
           torque_constant_nm_per_a * back_emf_vs_per_rad / (resistance_ohm + driver_resistance_ohm);
  }
};

/// All numbers of a throttle, in the order of the struct.
std::span<const Field<Throttle>> fields() noexcept;
inline auto fields_of(const Throttle&) {
  return std::tuple{fields(), field<&Throttle::friction>("friction", "law of the dry friction"),
                    field<&Throttle::backlash>("backlash", "play between gear and plate")};
}

/// ParameterError naming field, value and bound: domains, limp-home inside the travel, stiction >= Coulomb, a plate
/// lighter than the whole.
void validate(const Throttle& throttle);

/// What a controller can know of it: groups of its parameters in duty, what duty and angle identify.
control::Plate plate_of(const Throttle& throttle) noexcept;

/// Coefficient C_T of that torque over the opening [-]: none closed or wide open, largest near 75 deg.
double airflow_coefficient(double angle_deg) noexcept;
/// C_T with its slope.
struct AirflowPoint {
  double coefficient, slope_per_deg;
};
AirflowPoint airflow_point(double angle_deg) noexcept;

/// Torque of the air flow [N m], closing, so <= 0: -D^3 dp C_T(angle) with C_T from a table over 0 to 90 deg.
double airflow_torque_nm(const Throttle& throttle, double angle_deg) noexcept;

}  // namespace mgdd::throttle
