// Thermal NO of one cycle: the extended Zeldovich mechanism in burned gas of two zones. What burns in a step is a
// packet that starts at its adiabatic flame temperature, follows the pressure and mixes with the bulk; the unburned
// charge is compressed without heat. Angles °CA aTDC, temperatures K, NO in ppm of all gas, wet. Absolute values are
// uncertain by a factor of two through the first rate alone: `calibration` is there to be fitted.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/engine/burned_gas.hpp"
#include "mgdd/engine/cylinder.hpp"

namespace mgdd::engine {

/// Rate coefficients: Hanson and Salimian 1984; Heywood 1988, table 11.1.
enum class NoRates { hanson_salimian, heywood };

struct ThermalNo {
  double lambda_burned = 1.1;
  double mixing_time_ms = 2.0;
  double intake_o2_fraction = 0.209;
  double hydrogen_to_carbon = 1.86;
  NoRates rates = NoRates::hanson_salimian;
  double calibration = 1.0;

  bool operator==(const ThermalNo&) const = default;
};

constexpr auto fields_of(const ThermalNo&) {
  using P = ThermalNo;
  return std::tuple{
      field<&P::lambda_burned>(
          {"lambda_burned", "-", closed(0.7, 3.0), "air over the need of the fuel where it burns; the one to fit"}),
      field<&P::mixing_time_ms>(
          {"mixing_time_ms", "ms", above(0.0, 1e6), "in which burned gas takes on the bulk temperature"}),
      field<&P::intake_o2_fraction>(
          {"intake_o2_fraction", "-", closed(0.05, 0.209), "oxygen of the charge by volume; below air by burned gas"}),
      field<&P::hydrogen_to_carbon>({"hydrogen_to_carbon", "-", closed(0.0, 4.0), "atoms of the fuel"}),
      field<&P::rates>("rates", "rate coefficients"),
      field<&P::calibration>({"calibration", "-", above(0.0), "factor on the result, to be fitted"}),
  };
}

void validate(const ThermalNo& model);

struct ThermalNoCycle {
  double nox_ppm = 0.0;            ///< at the last angle
  double nox_g_per_kwh = 0.0;      ///< as NO2, over the work of the trace; NaN where that is not positive
  double lambda_global = 0.0;      ///< of all charge and fuel
  double flame_max_k = 0.0;        ///< hottest packet
  std::vector<double> no_ppm;      ///< over the angles
  std::vector<double> flame_k;     ///< of what burns in the step; NaN where nothing does
  std::vector<double> unburned_k;  ///< NaN before the burn
};

/// Of a trace from before the burn to after it, with the fraction of the fuel that has burned at each sample.
/// ParameterError for a model outside its domain, a fuel that is not > 0 or that needs more charge at `lambda_burned`
/// than there is; DataError for a trace that does not burn; ShapeError for unequal lengths.
ThermalNoCycle thermal_no(std::span<const double> angle_cad, std::span<const double> pressure_bar,
                          std::span<const double> volume_l, std::span<const double> temperature_k,
                          std::span<const double> burned_fraction, const Cylinder& cylinder,
                          const OperatingPoint& point, const ThermalNo& model);

/// Mole fraction of NO after `seconds` in burned gas of constant state; `start` is the fraction at first.
double no_after(double start, const BurnedGas& gas, double temperature_k, double pressure_pa, double seconds,
                NoRates rates) noexcept;

}  // namespace mgdd::engine
