#include "mgdd/throttle/demand/demand_chain.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/dynamics/lag.hpp"

namespace mgdd::throttle {
namespace {

using C = DemandChain;
using T = EngineTorque;
using A = IntakeAir;
using B = ThrottleBore;
using R = ReferenceShape;
constexpr double slowest_rpm = 300.0;  // a starter turns no faster: a standing engine breathes nothing

constexpr std::array field_table{
    field<&C::torque, &T::indicated_efficiency>(
        {"indicated_efficiency", "-", above(0.0, 1.0), "indicated work over the heat of the fuel"}),
    field<&C::torque, &T::heating_value_mj_per_kg>(
        {"heating_value_mj_per_kg", "MJ/kg", above(0.0, 200.0), "lower heating value of the fuel"}),
    field<&C::torque, &T::stoichiometric_air_fuel>(
        {"stoichiometric_air_fuel", "-", above(0.0, 100.0), "stoichiometric air over fuel by mass"}),
    field<&C::torque, &T::air_fuel_ratio>({"air_fuel_ratio", "-", above(0.0, 20.0), "lambda"}),
    field<&C::torque, &T::friction_nm>({"friction_nm", "N m", closed(0.0, 1e4), "friction torque at standstill"}),
    field<&C::torque, &T::friction_nm_per_rpm>(
        {"friction_nm_per_rpm", "N m/rpm", closed(0.0, 10.0), "rise of the friction torque with the speed"}),
    field<&C::air, &A::displacement_l>({"displacement_l", "L", above(0.0, 100.0), "displacement of the engine"}),
    field<&C::air, &A::volumetric_efficiency>(
        {"volumetric_efficiency", "-", above(0.0, 2.0), "charge over what the displacement holds of manifold gas"}),
    field<&C::air, &A::manifold_l>({"manifold_l", "L", closed(0.01, 1000.0), "volume of the manifold"}),
    field<&C::air, &A::manifold_temperature_k>(
        {"manifold_temperature_k", "K", closed(150.0, 1000.0), "temperature in the manifold"}),
    field<&C::air, &A::ambient_kpa>({"ambient_kpa", "kPa", closed(10.0, 1000.0), "pressure before the throttle"}),
    field<&C::air, &A::ambient_temperature_k>(
        {"ambient_temperature_k", "K", closed(150.0, 1000.0), "temperature before the throttle"}),
    field<&C::bore, &B::bore_mm>({"bore_mm", "mm", above(0.0, 1e3), "bore of the throttle"}),
    field<&C::bore, &B::shaft_mm>({"shaft_mm", "mm", closed(0.0, 1e3), "shaft of the plate"}),
    field<&C::bore, &B::plate_closed_deg>(
        {"plate_closed_deg", "deg", closed(0.0, 45.0), "plate against the cross-section where the opening is zero"}),
    field<&C::bore, &B::leak_mm2>({"leak_mm2", "mm²", closed(0.0, 1e4), "area that is open at any angle"}),
    field<&C::bore, &B::discharge_5>(
        {"discharge_5", "-", above(0.0, 1.5), "discharge coefficient up to 5 deg of opening"}),
    field<&C::bore, &B::discharge_20>({"discharge_20", "-", above(0.0, 1.5), "discharge coefficient at 20 deg"}),
    field<&C::bore, &B::discharge_45>({"discharge_45", "-", above(0.0, 1.5), "discharge coefficient at 45 deg"}),
    field<&C::bore, &B::discharge_90>({"discharge_90", "-", above(0.0, 1.5), "discharge coefficient at 90 deg"}),
    field<&C::bore, &B::discharge_pressure_loss>(
        {"discharge_pressure_loss", "-", closed(0.0, 0.9), "share that it loses at equal pressures"}),
    field<&C::reference, &R::pressure_lag_s>(
        {"pressure_lag_s", "s", closed(0.0, 100.0), "lag of the wanted manifold pressure"}),
    field<&C::reference, &R::filling_share>(
        {"filling_share", "-", closed(0.0, 2.0), "share fed forward of the air that fills the manifold"}),
    field<&C::reference, &R::lowest_flow_function>(
        {"lowest_flow_function", "-", closed(0.01, 0.6), "the flow function is taken no lower"}),
    field<&C::reference, &R::highest_ratio>(
        {"highest_ratio", "-", closed(0.6, 0.99), "pressure ratio up to which a measured pressure counts"}),
    field<&C::reference, &R::reference_rate_deg_per_s>(
        {"reference_rate_deg_per_s", "deg/s", above(0.0, 1e7), "fastest change of the reference"}),
    field<&C::reference, &R::reference_bandwidth_per_s>(
        {"reference_bandwidth_per_s", "1/s", above(0.0, 1e6), "bandwidth of the filter of the reference"}),
    field<&C::reference, &R::widest_deg>({"widest_deg", "deg", above(0.0, 90.0), "largest reference"}),
};

constexpr double blend_ratio = 0.05;  // below the highest one, over which a measured pressure loses its say

const DemandChain& checked(const DemandChain& chain) {
  validate(chain);
  return chain;  // NOLINT(bugprone-return-const-ref-from-parameter): the caller holds it
}

double checked_sample(double sample_s) {
  require_within("sample_s", sample_s, 1e-5, 1.0, "s");
  return sample_s;
}

void keep_if_finite(std::optional<double>& kept, double value) noexcept {
  if (std::isfinite(value)) kept = value;
}

void require_not_below(std::string_view name, double value, std::string_view smaller, double bound) {
  if (value >= bound) return;
  throw ParameterError(name, value, "must be >= " + std::string(smaller) + " = " + text(bound));
}

}  // namespace

std::span<const Field<DemandChain>> demand_fields() noexcept {
  return field_table;
}

void validate(const DemandChain& chain) {
  require_fields(field_table, chain);
  const ThrottleBore& b = chain.bore;
  if (!(b.shaft_mm < b.bore_mm)) {
    throw ParameterError("shaft_mm", b.shaft_mm, "must be below bore_mm = " + text(b.bore_mm), "mm");
  }
  require_not_below("discharge_20", b.discharge_20, "discharge_5", b.discharge_5);
  require_not_below("discharge_45", b.discharge_45, "discharge_20", b.discharge_20);
  require_not_below("discharge_90", b.discharge_90, "discharge_45", b.discharge_45);
  validate(chain.pedal_map);
}

DemandModel::DemandModel(const DemandChain& chain) : chain_(checked(chain)), plate_(chain.bore) {}

double DemandModel::opening_deg(double air_kg_per_s, double pressure_pa, double wanted_pa) const noexcept {
  const GasState ambient = chain_.air.ambient();
  const ReferenceShape& shape = chain_.reference;
  const auto ratio_of = [&](double pressure) { return std::clamp(pressure / ambient.pressure_pa, 0.0, 1.0); };
  const double measured = ratio_of(pressure_pa), wanted = ratio_of(wanted_pa);
  // Near equal pressures the flow says nothing of the opening: the pressure that the demand wants does.
  const double share = std::clamp((shape.highest_ratio - measured) / blend_ratio, 0.0, 1.0);
  const double ratio = wanted + share * (measured - wanted);
  const double psi = std::max(flow_function(ratio).value, shape.lowest_flow_function) *
                     (1.0 - chain_.bore.discharge_pressure_loss * ratio);
  const double angle = plate_.angle_of_effective_rad(air_kg_per_s / (flow_per_area(ambient) * psi));
  return std::min(angle / units::rad_per_deg, shape.widest_deg);
}

Demand DemandModel::wanted(double pedal_percent, double speed_rpm) const noexcept {
  Demand out;
  out.torque_nm = chain_.pedal_map.torque_nm(pedal_percent, speed_rpm);
  const double speed = std::max(speed_rpm, slowest_rpm);
  out.air_kg_per_s = chain_.torque.air_kg_per_s(out.torque_nm, speed);
  out.pressure_pa = out.air_kg_per_s / chain_.air.pumping_kg_per_s_pa(speed);
  return out;
}

Demand DemandModel::steady(double pedal_percent, double speed_rpm) const noexcept {
  Demand out = wanted(pedal_percent, speed_rpm);
  out.opening_deg = opening_deg(out.air_kg_per_s, out.pressure_pa, out.pressure_pa);
  return out;
}

DemandTracker::DemandTracker(const DemandChain& chain, double sample_s)
    : model_(chain),
      sample_s_(checked_sample(sample_s)),
      pressure_share_(
          chain.reference.pressure_lag_s > 0.0 ? dynamics::lag_share(chain.reference.pressure_lag_s, sample_s) : 1.0),
      reference_share_(dynamics::lag_share(1.0 / chain.reference.reference_bandwidth_per_s, sample_s)),
      most_deg_(chain.reference.reference_rate_deg_per_s * sample_s) {}

TrackedDemand DemandTracker::step(double pedal_percent, double speed_rpm, double pressure_pa) noexcept {
  keep_if_finite(pedal_percent_, pedal_percent);
  keep_if_finite(speed_rpm_, speed_rpm);
  keep_if_finite(pressure_pa_, pressure_pa);
  TrackedDemand out;
  if (!pedal_percent_ || !speed_rpm_) {
    out.reference_deg = out.opening_deg = reference_deg_.value_or(0.0);
    return out;
  }
  const DemandChain& chain = model_.chain();
  const double speed = std::max(*speed_rpm_, slowest_rpm);
  const Demand steady = model_.wanted(*pedal_percent_, speed);
  const double before = wanted_pa_.value_or(steady.pressure_pa);
  const double wanted = before + pressure_share_ * (steady.pressure_pa - before);
  wanted_pa_ = wanted;
  out.torque_nm = steady.torque_nm;
  out.pressure_pa = wanted;
  out.air_kg_per_s = chain.air.pumping_kg_per_s_pa(speed) * wanted;
  const double filling = (wanted - before) / (sample_s_ * chain.air.stiffness_pa_per_kg());
  out.opening_deg = model_.opening_deg(out.air_kg_per_s + chain.reference.filling_share * filling,
                                       pressure_pa_.value_or(wanted), wanted);
  const double limited = limited_deg_.value_or(out.opening_deg);
  limited_deg_ = limited + std::clamp(out.opening_deg - limited, -most_deg_, most_deg_);
  const double reference = reference_deg_.value_or(*limited_deg_);
  reference_deg_ = reference + reference_share_ * (*limited_deg_ - reference);
  out.reference_deg = *reference_deg_;
  return out;
}

void DemandTracker::reset() noexcept {
  pedal_percent_ = speed_rpm_ = pressure_pa_ = wanted_pa_ = limited_deg_ = reference_deg_ = std::nullopt;
}

void DemandTracker::take_over(double reference_deg) noexcept {
  if (!std::isfinite(reference_deg)) return;
  limited_deg_ = reference_deg_ = std::clamp(reference_deg, 0.0, model_.chain().reference.widest_deg);
}

void DemandTracker::require_usable() const {
  if (limited_deg_.has_value() != reference_deg_.has_value()) {
    throw ParameterError("state columns 'limited_deg' and 'reference_deg' must be there or not, both");
  }
  const double widest = model_.chain().reference.widest_deg;
  require_within("state column 'limited_deg'", limited_deg_.value_or(0.0), 0.0, widest, "deg");
  require_within("state column 'reference_deg'", reference_deg_.value_or(0.0), 0.0, widest, "deg");
  require_in(closed(0.0, unbounded), "state column 'wanted_pa'", wanted_pa_.value_or(0.0), "Pa");
}

}  // namespace mgdd::throttle
