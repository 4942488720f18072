// Options of the analysis of a pressure trace. Angles °CA aTDC, pressure bar; "unset" means found from the trace.
#pragma once

#include <optional>
#include <string_view>

namespace mgdd::engine {

enum class Pegging { none, inlet, two_point, least_squares };
enum class AnalysisGamma { constant, split, cylinder };
enum class Smoothing { automatic, none, savitzky_golay, low_pass, angle_window };

std::string_view to_string(Pegging v) noexcept;
std::string_view to_string(AnalysisGamma v) noexcept;
std::string_view to_string(Smoothing v) noexcept;
Pegging parse_pegging(std::string_view name);
AnalysisGamma parse_analysis_gamma(std::string_view name);
Smoothing parse_smoothing(std::string_view name);

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
  bool total_at_end = false;        ///< report the heat at the window's end, not its peak; burn angles keep the peak
  bool fractions_of_gross = false;  ///< CA10/50/90 of gross heat instead of net

  Smoothing smoothing = Smoothing::automatic;  ///< of the pressure before the heat release, never of peak and work
  double smoothing_width_cad = 4.0;            ///< `savitzky_golay` and `angle_window`: whole width
  double smoothing_cutoff_hz = 3000.0;         ///< `low_pass`: the gain there is 1/2

  std::optional<double> intake_pressure_kpa;  ///< what p(IVC) is judged against
  double intake_factor = 1.5;                 ///< p(IVC) beyond this factor of it is doubted
  std::optional<double> bmep_bar;             ///< a gross IMEP that cannot reach it is refused
  std::optional<double> fuel_heat_j;          ///< of the stated fuel; a gross heat far from it is doubted
};

/// ParameterError naming the first option outside its domain.
void validate(const TraceOptions& options);

}  // namespace mgdd::engine
