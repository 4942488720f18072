#include "mgdd/engine/recirculation.hpp"

#include <algorithm>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/emissions.hpp"

namespace mgdd::engine {

double charge_gamma(const ChargeFractions& x, double temperature_k) noexcept {
  const auto enthalpy = [&x](double t) {
    return x.o2 * enthalpy_j_per_mol(Species::o2, t) + x.n2 * enthalpy_j_per_mol(Species::n2, t) +
           x.co2 * enthalpy_j_per_mol(Species::co2, t) + x.h2o * enthalpy_j_per_mol(Species::h2o, t);
  };
  constexpr double reach_k = 50.0;
  const double cp = (enthalpy(temperature_k + reach_k) - enthalpy(temperature_k - reach_k)) / (2.0 * reach_k);
  return cp / (cp - units::gas_constant_j_per_molk);
}

Recirculation recirculation(double egr, double charge_g, double fuel_mg) noexcept {
  Reactants r;
  r.hydrogen_to_carbon = air_hydrogen_to_carbon;
  r.charge_o2_fraction = air_o2_fraction;
  const double air_g_per_mol = 1e3 * units::air_molar_mass_kg_per_mol, fuel_g_per_mol = 1e3 * r.fuel_kg_per_mol();
  const double stoichiometric = r.charge_mol() * air_g_per_mol / fuel_g_per_mol;  // air over fuel, by mass
  Recirculation out;
  out.lambda = (1.0 - egr) * charge_g * 1e3 / (stoichiometric * fuel_mg);
  // Complete products in the exhaust, and with them in the charge, by mass: (1 + L)/(1 + lambda L) whatever the EGR,
  // since recirculation does not change what leaves the engine at rest.
  const double burned = egr * std::min(1.0, (1.0 + stoichiometric) / (1.0 + out.lambda * stoichiometric));
  const double needed = 1.0 + 0.25 * r.hydrogen_to_carbon;
  const double product_mol = needed * (1.0 - air_o2_fraction) / air_o2_fraction + 1.0 + 0.5 * r.hydrogen_to_carbon;
  const double product_g_per_mol = (fuel_g_per_mol + r.charge_mol() * air_g_per_mol) / product_mol;
  const double by_volume = burned / product_g_per_mol / (burned / product_g_per_mol + (1.0 - burned) / air_g_per_mol);
  out.intake_o2_fraction = air_o2_fraction * (1.0 - by_volume);
  r.charge_o2_fraction = out.intake_o2_fraction;
  Reactants air = r;
  air.charge_o2_fraction = air_o2_fraction;
  out.gamma_change = charge_gamma(charge_fractions(r), egr_gamma_temperature_k) -
                     charge_gamma(charge_fractions(air), egr_gamma_temperature_k);
  return out;
}

}  // namespace mgdd::engine
