// Burned gas of a fuel CHy in equilibrium, ten species, and the temperature at which it burns. Ideal gases with the
// polynomials of GRI-Mech 3.0 (Smith et al. 1999), 200 to 5000 K. Temperature K, pressure Pa, moles and joules per mole
// of carbon in the fuel. noexcept, no heap.
#pragma once

#include <array>
#include <cstddef>

namespace mgdd::engine {

enum class Species : std::size_t { n2, o2, co2, h2o, co, h2, oh, o, h, no };
inline constexpr std::size_t species_count = 10;

/// Enthalpy with that of formation [J/mol], and entropy at 1 atm [J/(mol K)].
double enthalpy_j_per_mol(Species s, double temperature_k) noexcept;
double entropy_j_per_mol_k(Species s, double temperature_k) noexcept;

/// Fuel, and what it burns in: air, or air with burned gas of the same fuel, until the oxygen is so scarce.
struct Reactants {
  double hydrogen_to_carbon = 1.86;
  double heating_value_j_per_kg = 42.5e6;  ///< lower, at 298.15 K
  double charge_o2_fraction = 0.209;       ///< by volume
  double lambda = 1.0;                     ///< oxygen of the charge over what the fuel needs

  [[nodiscard]] double fuel_kg_per_mol() const noexcept { return 1e-3 * (12.011 + 1.008 * hydrogen_to_carbon); }
  /// Charge per mole of carbon [mol].
  [[nodiscard]] double charge_mol() const noexcept {
    return lambda * (1.0 + 0.25 * hydrogen_to_carbon) / charge_o2_fraction;
  }
};

/// Mole fractions of oxygen, nitrogen (with argon), carbon dioxide and water in the charge.
struct ChargeFractions {
  double o2, n2, co2, h2o;
};
ChargeFractions charge_fractions(const Reactants& r) noexcept;

struct BurnedGas {
  std::array<double, species_count> fraction{};  ///< mole fractions, in the order of `Species`
  double moles = 0.0;
  double enthalpy_j = 0.0;

  double operator[](Species s) const noexcept { return fraction[static_cast<std::size_t>(s)]; }
};

BurnedGas burned_gas(const Reactants& r, double temperature_k, double pressure_pa) noexcept;

/// Adiabatic flame temperature at constant pressure of a charge at `charge_k`.
double flame_temperature_k(const Reactants& r, double charge_k, double pressure_pa) noexcept;

}  // namespace mgdd::engine
