// Air of an engine between throttle and torque: speed density, filling of the manifold, and the torque that the air
// makes at a given mixture. Parameters in field units, equations in SI, speed in rpm. noexcept, heap-free.
// Speed density and filling: Hendricks and Sorenson 1990; friction and efficiency are our placeholders of a 2 L engine.
#pragma once

#include <array>
#include <concepts>

#include "mgdd/common/units.hpp"
#include "mgdd/throttle/demand/bore.hpp"
#include "mgdd/throttle/demand/orifice.hpp"

namespace mgdd::throttle {

inline constexpr double air_gas_constant = units::gas_constant_j_per_molk / units::air_molar_mass_kg_per_mol;

struct IntakeAir {
  double displacement_l = 2.0;
  double volumetric_efficiency = 0.85;  ///< [-] against the state in the manifold
  double manifold_l = 3.0;
  double manifold_temperature_k = 310.0;
  double ambient_kpa = 101.325;
  double ambient_temperature_k = 298.15;

  GasState ambient() const noexcept { return {ambient_kpa * units::pa_per_kpa, ambient_temperature_k}; }
  /// Pressure per mass in the manifold, R T/V [Pa/kg].
  double stiffness_pa_per_kg() const noexcept {
    return air_gas_constant * manifold_temperature_k / (manifold_l * units::m3_per_l);
  }
  /// Flow into the cylinders per manifold pressure [kg/(s Pa)].
  double pumping_kg_per_s_pa(double speed_rpm) const noexcept {
    return volumetric_efficiency * displacement_l * units::m3_per_l * speed_rpm /
           (120.0 * air_gas_constant * manifold_temperature_k);
  }
  /// Time constant of the manifold where the throttle is choked [s].
  double filling_time_s(double speed_rpm) const noexcept {
    return 1.0 / (stiffness_pa_per_kg() * pumping_kg_per_s_pa(speed_rpm));
  }

  bool operator==(const IntakeAir&) const = default;
};

struct EngineTorque {
  double indicated_efficiency = 0.33;
  double heating_value_mj_per_kg = 42.5;
  double stoichiometric_air_fuel = 14.7;
  double air_fuel_ratio = 1.0;  ///< lambda [-]
  double friction_nm = 15.0;    ///< at standstill
  double friction_nm_per_rpm = 0.003;

  /// Air flow that makes a torque; zero where friction alone would brake more.
  double air_kg_per_s(double torque_nm, double speed_rpm) const noexcept;
  /// Torque that an air flow makes, fuelled to lambda.
  double torque_nm(double air_kg_per_s, double speed_rpm) const noexcept;

  bool operator==(const EngineTorque&) const = default;

 private:
  double work_j_per_kg() const noexcept {
    return indicated_efficiency * heating_value_mj_per_kg * 1e6 / (air_fuel_ratio * stoichiometric_air_fuel);
  }
};

/// Flows that were, on the mean of a sample; what came in and did not go out is in the manifold.
struct ManifoldFlows {
  double throttle_kg_per_s = 0.0;
  double cylinder_kg_per_s = 0.0;
};

/// The manifold as a model of sampled input: dp/dt = R T/V (m_throttle - m_cylinder). Exponential Rosenbrock-Euler
/// steps (Hochbruck and Ostermann 2010): exact where the throttle is choked, stable where it is wide open. A step is
/// cut so that none carries the pressure by more than 1 % of the ambient one.
class Manifold {
 public:
  struct State {
    double pressure_pa = 0.0;
    double angle_deg = 0.0;  ///< last finite inputs
    double speed_rpm = 0.0;
  };
  struct Input {
    double angle_deg = 0.0;
    double speed_rpm = 0.0;
  };
  using Scalar = double;
  static constexpr int n_observed = 1;

  Manifold(const IntakeAir& air, const ThrottleBore& bore, double sample_s) noexcept;

  void step(State& state, const Input& input) const noexcept { (void)flows(state, input); }
  /// One sample, and the flows of it. Inputs that are not finite repeat the last ones, a negative speed is
  /// standstill.
  ManifoldFlows flows(State& state, const Input& input) const noexcept;
  /// Manifold pressure [Pa].
  double output(const State& state) const noexcept { return state.pressure_pa; }
  double sample_s() const noexcept { return sample_s_; }

  /// Through the throttle at a pressure [kg/s].
  double throttle_kg_per_s(double angle_deg, double pressure_pa) const noexcept;
  /// Where both flows are equal [Pa]; the ambient pressure at standstill.
  double steady_pa(const Input& input) const noexcept;

  template <class S>
  static auto numbers(S& state) noexcept {
    return std::array{&state.pressure_pa, &state.angle_deg, &state.speed_rpm};
  }

 private:
  IntakeAir air_;
  PlateOpening plate_;
  double pressure_loss_, sample_s_;
};

}  // namespace mgdd::throttle
