// What cooled external exhaust gas recirculation makes of a charge of given mass: excess air, intake oxygen, and the
// ratio of specific heats. The exhaust is that of the same cycle at rest, complete products and what air was left.
// Definitions: Heywood 1988, chapters 3 and 4; Müller 2010 for lean engines. noexcept, no heap.
#pragma once

#include "mgdd/engine/burned_gas.hpp"

namespace mgdd::engine {

inline constexpr double air_hydrogen_to_carbon = 1.86;  ///< of the fuel; as `ThermalNo` has it
inline constexpr double egr_gamma_temperature_k = 1000.0;

struct Recirculation {
  double lambda = 0.0;              ///< fresh air over what the fuel needs
  double intake_o2_fraction = 0.0;  ///< of the charge, by volume
  double gamma_change = 0.0;        ///< of the charge against that of air, at 1000 K
};

/// `egr`: share of the charge's mass, in [0, 1). Below lambda 1 the recirculated gas holds no oxygen.
Recirculation recirculation(double egr, double charge_g, double fuel_mg) noexcept;

/// cp / cv of a charge, from the mean cp within 50 K.
double charge_gamma(const ChargeFractions& x, double temperature_k) noexcept;

}  // namespace mgdd::engine
