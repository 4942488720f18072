// Options of the analysis of a pressure trace. Angles °CA aTDC, pressure bar; "unset" means found from the trace.
#pragma once

#include <optional>
#include <tuple>

#include "mgdd/common/record.hpp"

namespace mgdd::engine {

enum class Pegging { none, inlet, two_point, least_squares };
enum class AnalysisGamma { constant, split, cylinder };
/// What CA10, CA50 and CA90 are shares of: heat, or the pressure rise by combustion (Rassweiler and Withrow 1938).
enum class BurnFractions { net, gross, rassweiler_withrow };
enum class Smoothing { automatic, none, savitzky_golay, low_pass, angle_window };

struct TraceOptions {
  Pegging pegging = Pegging::none;
  double pegging_exponent = 1.35;   ///< [-] polytropic exponent of compression, 1.32 to 1.37 in a diesel
  double inlet_pressure_kpa = 0.0;  ///< for `inlet`: the pressure at intake bottom dead centre

  AnalysisGamma gamma_source = AnalysisGamma::constant;
  double gamma = 1.33;              ///< [-] constant over the window
  double gamma_compression = 1.37;  ///< [-] `split`: before `burn_from_cad`
  double gamma_combustion = 1.30;   ///< [-] `split`: from the burn start on

  std::optional<double> heat_from_cad;      ///< window of the cumulative heat; unset: found (`burn_window.hpp`)
  std::optional<double> heat_to_cad;        ///< goes with `heat_from_cad`
  std::optional<double> earliest_burn_cad;  ///< injection or spark: the burn is searched from here on
  std::optional<double> burn_from_cad;      ///< Woschni's combustion term acts from here; unset: the found start
  bool total_at_end = false;  ///< report the heat at the window's end, not its peak; burn angles keep the peak
  BurnFractions fractions = BurnFractions::net;

  Smoothing smoothing = Smoothing::automatic;  ///< of the pressure before the heat release, never of peak and work
  double smoothing_width_cad = 4.0;            ///< `savitzky_golay` and `angle_window`: whole width
  double smoothing_cutoff_hz = 3000.0;         ///< `low_pass`: the gain there is 1/2

  double knock_low_hz = 4000.0;    ///< band of the oscillation; half the gain at both ends
  double knock_high_hz = 20000.0;  ///< one that the sampling does not reach is left out
  double knock_from_cad = -10.0;   ///< where it is looked for, as far as the trace reaches
  double knock_to_cad = 90.0;

  std::optional<double> intake_pressure_kpa;  ///< what p(IVC) is judged against
  double intake_factor = 1.5;                 ///< p(IVC) beyond this factor of it is doubted
  std::optional<double> bmep_bar;             ///< a gross IMEP that cannot reach it is refused
  std::optional<double> fuel_heat_j;          ///< of the stated fuel; a gross heat far from it is doubted
};

constexpr auto fields_of(const TraceOptions&) {
  using O = TraceOptions;
  const auto cad = [](const char* name, const char* meaning) { return FieldInfo{name, "°CA aTDC", {}, meaning}; };
  return std::tuple{
      field<&O::pegging>("pegging", "how the absolute pressure is found"),
      field<&O::pegging_exponent>({"pegging_exponent", "-", {}, "polytropic exponent of compression"}),
      field<&O::inlet_pressure_kpa>({"inlet_pressure_kpa", "kPa", {}, "pressure at intake bottom dead centre"}),
      field<&O::gamma_source>("gamma_source", "where gamma comes from"),
      field<&O::gamma>({"gamma", "-", {}, "constant over the window"}),
      field<&O::gamma_compression>({"gamma_compression", "-", {}, "before the burn"}),
      field<&O::gamma_combustion>({"gamma_combustion", "-", {}, "from the burn start on"}),
      field<&O::heat_from_cad>(cad("heat_from_cad", "start of the cumulative heat")),
      field<&O::heat_to_cad>(cad("heat_to_cad", "its end")),
      field<&O::earliest_burn_cad>(cad("earliest_burn_cad", "the burn is searched from here on")),
      field<&O::burn_from_cad>(cad("burn_from_cad", "the combustion term of the wall heat acts from here")),
      field<&O::total_at_end>("total_at_end", "report the heat at the end of the window, not its peak"),
      field<&O::fractions>("fractions", "what the burn angles are shares of"),
      field<&O::smoothing>("smoothing", "of the pressure before the heat release"),
      field<&O::smoothing_width_cad>({"smoothing_width_cad", "°CA", {}, "whole width"}),
      field<&O::smoothing_cutoff_hz>({"smoothing_cutoff_hz", "Hz", {}, "where the gain is 1/2"}),
      field<&O::knock_low_hz>({"knock_low_hz", "Hz", {}, "lower end of the band of the oscillation"}),
      field<&O::knock_high_hz>({"knock_high_hz", "Hz", {}, "its upper end"}),
      field<&O::knock_from_cad>(cad("knock_from_cad", "start of the window of the oscillation")),
      field<&O::knock_to_cad>(cad("knock_to_cad", "its end")),
      field<&O::intake_pressure_kpa>({"intake_pressure_kpa", "kPa", {}, "what p(IVC) is judged against"}),
      field<&O::intake_factor>({"intake_factor", "-", {}, "beyond this factor of it p(IVC) is doubted"}),
      field<&O::bmep_bar>({"bmep_bar", "bar", {}, "a gross IMEP that cannot reach it is refused"}),
      field<&O::fuel_heat_j>({"fuel_heat_j", "J", {}, "heat of the stated fuel"}),
  };
}

/// ParameterError naming the first option outside its domain.
void validate(const TraceOptions& options);

}  // namespace mgdd::engine
