// What one step of the throttle plant needs of its parameters: prepared once per throttle and step, in SI, on any
// scalar. Offline code, but for the numbers themselves.
#pragma once

#include <cstddef>

#include "mgdd/dynamics/dry_friction.hpp"
#include "mgdd/dynamics/limp_home_spring.hpp"
#include "mgdd/throttle/throttle.hpp"

namespace mgdd::throttle {

template <class C>
struct FrictionCoefficients {
  C viscous;
  dynamics::FrictionLevels<C> levels;
  dynamics::Bristles<C> bristles;
};

/// What one step needs of the parameters, in SI. Every member is a C, so that lanes are packed as columns.
template <class C>
struct PlantCoefficients {
  FrictionCoefficients<C> whole, motor_side, plate_side;
  dynamics::FrictionShape<C> shape;
  C inertia_over_h, motor_inertia_over_h, plate_inertia_over_h;
  C torque_constant, back_emf, resistance, inverse_impedance, inductance_over_h;
  C drop, dead_band;
  C limp_home;
  dynamics::SpringSide<C> above, below;
  C inverse_ramp;
  C closed, open, stop, stop_implicit;
  C half_gap, gear, gear_damping, gear_implicit;
  C air_torque;  ///< -D^3 dp
  C supply;
};
inline constexpr std::size_t n_plant_coefficients = sizeof(PlantCoefficients<double>) / sizeof(double);

PlantCoefficients<double> plant_coefficients(const Throttle& throttle, double step_s) noexcept;

}  // namespace mgdd::throttle
