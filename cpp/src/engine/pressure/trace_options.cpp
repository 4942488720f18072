#include "mgdd/engine/pressure/trace_options.hpp"

#include <string>
#include <utility>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::engine {
namespace {

void require(bool holds, const char* name, double value, const std::string& bound, const char* unit = "") {
  if (!holds) throw ParameterError(name, value, "must be " + bound, unit);
}

}  // namespace

void validate(const TraceOptions& o) {
  require(o.pegging_exponent > 1.0 && o.pegging_exponent < 1.7, "pegging_exponent", o.pegging_exponent, "in (1, 1.7)");
  require(o.pegging != Pegging::inlet || o.inlet_pressure_kpa > 0.0, "inlet_pressure_kpa", o.inlet_pressure_kpa,
          "> 0 kPa for pegging 'inlet'");
  for (const auto& [name, value] : {std::pair{"gamma", o.gamma}, std::pair{"gamma_compression", o.gamma_compression},
                                    std::pair{"gamma_combustion", o.gamma_combustion}}) {
    require(value > 1.0 && value < 1.7, name, value, "in (1, 1.7)");
  }
  if (o.heat_from_cad.has_value() != o.heat_to_cad.has_value()) {
    throw ParameterError("heat_from_cad and heat_to_cad must be given together, or neither");
  }
  if (o.heat_from_cad) {
    require(*o.heat_from_cad < *o.heat_to_cad, "heat_from_cad", *o.heat_from_cad, "before heat_to_cad");
  }
  if (o.earliest_burn_cad) {
    require(*o.earliest_burn_cad >= -180.0 && *o.earliest_burn_cad <= 90.0, "earliest_burn_cad", *o.earliest_burn_cad,
            "in [-180, 90] °CA aTDC; it is soi_cad or spark_cad of the trace");
  }
  require(o.smoothing_width_cad > 0.0 && o.smoothing_width_cad <= 30.0, "smoothing_width_cad", o.smoothing_width_cad,
          "in (0, 30] °CA");
  require(o.smoothing_cutoff_hz > 0.0 && o.smoothing_cutoff_hz <= 1e6, "smoothing_cutoff_hz", o.smoothing_cutoff_hz,
          "in (0, 1e6] Hz");
  require(o.knock_low_hz >= 100.0 && o.knock_low_hz <= 1e6, "knock_low_hz", o.knock_low_hz, "in [100, 1e6] Hz");
  require(o.knock_high_hz > 1.5 * o.knock_low_hz, "knock_high_hz", o.knock_high_hz, "above 1.5 knock_low_hz");
  require(o.knock_from_cad < o.knock_to_cad, "knock_from_cad", o.knock_from_cad, "before knock_to_cad");
  if (o.intake_pressure_kpa) {
    require(*o.intake_pressure_kpa > 0.0 && *o.intake_pressure_kpa <= 2000.0, "intake_pressure_kpa",
            *o.intake_pressure_kpa, "in (0, 2000] kPa");
  }
  if (o.bmep_bar) {
    require(*o.bmep_bar >= 0.0 && *o.bmep_bar <= 100.0, "bmep_bar", *o.bmep_bar,
            "in [0, 100] bar; a torque is brake_torque_nm", "bar");
  }
  if (o.fuel_heat_j) require(*o.fuel_heat_j > 0.0, "fuel_heat_j", *o.fuel_heat_j, "> 0 J", "J");
}

}  // namespace mgdd::engine
