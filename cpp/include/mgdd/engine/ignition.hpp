// Ignition delay: from start of injection (SOI) to start of combustion (SOC) and back. Angles °CA aTDC, tau in ms,
// pressure in bar, temperature in K. Offline code: it allocates and throws.
#pragma once

#include "mgdd/engine/cylinder.hpp"

namespace mgdd::engine {

/// tau = 3.52 p^-1.022 exp(2100/T) (Watson, Pilley and Marzouk 1980).
double watson_delay_ms(double pressure_bar, double temperature_k) noexcept;
/// tau = 0.44 p^-1.19 exp(4650/T) (Wolfer 1938).
double wolfer_delay_ms(double pressure_bar, double temperature_k) noexcept;
/// ID [°CA] = (0.36 + 0.22 Sp) exp[E_A (1/(R T) - 1/17190) (21.2/(p - 12.4))^0.63] (Hardenberg and Hase 1979);
/// infinite where p <= 12.4 bar, outside the correlation.
double hardenberg_hase_delay_cad(double pressure_bar, double temperature_k, double cetane_number,
                                 double piston_speed_m_per_s) noexcept;

struct IgnitionTiming {
  double soi_cad = 0.0;
  double soc_cad = 0.0;    ///< NaN when the charge does not ignite before EVO
  double delay_cad = 0.0;  ///< SOC - SOI
  bool ignites = false;
  bool clipped = false;  ///< the inverse met the edge of the reachable range and returned it
};

inline constexpr double injection_lower_cad = -60.0;
inline constexpr double injection_upper_cad = 20.0;

/// SOC of an injection. Watson and Wolfer by the integral of dt/tau = 1 over the motored cycle with wall loss
/// (Livengood and Wu 1955); Hardenberg-Hase at the state of SOI; or the polynomial of measured points.
IgnitionTiming start_of_combustion(const Cylinder& cylinder, const OperatingPoint& point, double soi_cad);

/// SOI that ignites at `soc_cad`, from the reachable range of SOI in [-60, 20] CAD; its edge, marked `clipped`, beyond.
IgnitionTiming start_of_injection(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad);

}  // namespace mgdd::engine
