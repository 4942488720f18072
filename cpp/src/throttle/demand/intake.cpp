#include "mgdd/throttle/demand/intake.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/math/monotone_inverse.hpp"

namespace mgdd::throttle {
namespace {

constexpr double share_per_step = 0.01;  // of the ambient pressure
constexpr double most_steps = 64.0;

double rad_per_s(double speed_rpm) noexcept {
  return units::cad_per_s_per_rpm * units::rad_per_deg * speed_rpm;
}

// (e^z - 1)/z and (e^z - 1 - z)/z^2 for z <= 0.
double phi_1(double z) noexcept {
  return z == 0.0 ? 1.0 : std::expm1(z) / z;
}
double phi_2(double z) noexcept {
  return std::abs(z) < 1e-4 ? 0.5 + z / 6.0 : (phi_1(z) - 1.0) / z;
}

}  // namespace

double EngineTorque::air_kg_per_s(double torque, double speed_rpm) const noexcept {
  const double indicated_nm = torque + friction_nm + friction_nm_per_rpm * speed_rpm;
  return std::max(indicated_nm, 0.0) * rad_per_s(speed_rpm) / work_j_per_kg();
}

double EngineTorque::torque_nm(double air, double speed_rpm) const noexcept {
  return air * work_j_per_kg() / rad_per_s(speed_rpm) - friction_nm - friction_nm_per_rpm * speed_rpm;
}

Manifold::Manifold(const IntakeAir& air, const ThrottleBore& bore, double sample_s) noexcept
    : air_(air), plate_(bore), pressure_loss_(bore.discharge_pressure_loss), sample_s_(sample_s) {}

double Manifold::throttle_kg_per_s(double angle_deg, double pressure_pa) const noexcept {
  return orifice_flow(plate_.effective_m2(angle_deg * units::rad_per_deg), air_.ambient(),
                      {pressure_pa, air_.manifold_temperature_k}, pressure_loss_)
      .kg_per_s;
}

ManifoldFlows Manifold::flows(State& state, const Input& input) const noexcept {
  if (std::isfinite(input.angle_deg)) state.angle_deg = input.angle_deg;
  if (std::isfinite(input.speed_rpm)) state.speed_rpm = std::max(input.speed_rpm, 0.0);
  const double effective = plate_.effective_m2(state.angle_deg * units::rad_per_deg);
  const double pumping = air_.pumping_kg_per_s_pa(state.speed_rpm);
  const double stiffness = air_.stiffness_pa_per_kg();
  const GasState ambient = air_.ambient();
  const auto through = [&](double pressure) noexcept {
    return orifice_flow(effective, ambient, {pressure, air_.manifold_temperature_k}, pressure_loss_);
  };
  const double most = share_per_step * ambient.pressure_pa;
  double p = state.pressure_pa, left_s = sample_s_, pressure_s = 0.0;
  for (double steps = most_steps; left_s > 0.0; steps -= 1.0) {
    const OrificeFlow in = through(p);
    const double rate = stiffness * (in.kg_per_s - pumping * p);
    const double slope = stiffness * (in.per_downstream_pa - pumping);
    // The last step takes what is left, so that no input can make the work grow.
    const double needed = std::ceil(std::min(std::abs(rate) * left_s / most, most_steps));
    const double h = steps > 1.0 && needed > 1.0 ? left_s / needed : left_s;
    pressure_s += h * (p + h * phi_2(slope * h) * rate);
    p += h * phi_1(slope * h) * rate;
    left_s = h < left_s ? left_s - h : 0.0;
  }
  const double stored = (p - state.pressure_pa) / stiffness;
  state.pressure_pa = p;
  const double out = pumping * pressure_s / sample_s_;
  return {stored / sample_s_ + out, out};
}

double Manifold::steady_pa(const Input& input) const noexcept {
  const double pumping = air_.pumping_kg_per_s_pa(input.speed_rpm);
  const auto lacking = [&](double pressure) noexcept {
    return pumping * pressure - throttle_kg_per_s(input.angle_deg, pressure);
  };
  return monotone_inverse(lacking, 0.0, 0.0, air_.ambient().pressure_pa);
}

}  // namespace mgdd::throttle
