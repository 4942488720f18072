// Analysis of a measured pressure trace of the closed part: pegging, heat release, burn angles, work, polytropic
// exponents. Angles °CA aTDC, pressure in bar at the border. Desk-time code: it allocates and throws.
// Sources: Heywood 1988, chapter 9; Randolph 1990, Brunt and Pond 1997 (pegging); Krieger and Borman 1966 (heat
// release).
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/engine/cylinder.hpp"

namespace mgdd::engine {

enum class Pegging { none, inlet, two_point, least_squares };
enum class AnalysisGamma { constant, split, cylinder };

std::string_view to_string(Pegging v) noexcept;
std::string_view to_string(AnalysisGamma v) noexcept;
Pegging parse_pegging(std::string_view name);
AnalysisGamma parse_analysis_gamma(std::string_view name);

struct TraceOptions {
  Pegging pegging = Pegging::none;
  double pegging_exponent = 1.35;   ///< [-] polytropic exponent of compression, 1.32 to 1.37 in a diesel
  double inlet_pressure_kpa = 0.0;  ///< for `inlet`: the pressure at intake bottom dead centre

  AnalysisGamma gamma_source = AnalysisGamma::constant;
  double gamma = 1.33;              ///< [-] constant over the window
  double gamma_compression = 1.37;  ///< [-] `split`: before `burn_from_cad`
  double gamma_combustion = 1.30;   ///< [-] `split`: from the burn start on

  double heat_from_cad = -10.0;  ///< window of the cumulative heat
  double heat_to_cad = 90.0;
  double burn_from_cad = -10.0;     ///< Woschni's combustion term acts from here on
  bool total_at_end = false;        ///< report the heat at the window's end, not its peak; burn angles keep the peak
  bool fractions_of_gross = false;  ///< CA10/50/90 of gross heat instead of net
};

struct TraceAnalysis {
  std::vector<double> angle_cad, pressure_bar, volume_l, temperature_k;
  std::vector<double> heat_net_j, heat_loss_j;                         ///< of the step that ends at the sample
  std::vector<double> heat_net_cumulative_j, heat_gross_cumulative_j;  ///< zero at the window's start
  double pegging_bar = 0.0;                                            ///< added to the trace
  double n_compression = undefined<double>();
  double n_expansion = undefined<double>();
  double ca10_cad = undefined<double>();
  double ca50_cad = undefined<double>();
  double ca90_cad = undefined<double>();
  double heat_net_j_total = undefined<double>();  ///< peak of the cumulative heat, or its end where options say so
  double heat_gross_j_total = undefined<double>();
  double imep_closed_bar = undefined<double>();
  double work_closed_j = undefined<double>();
  double p_max_bar = undefined<double>();
  double p_max_cad = undefined<double>();
  double dp_max_bar_per_cad = undefined<double>();
  double t_max_k = undefined<double>();
  bool motored = false;               ///< expansion runs on the compression line: no burn in this trace
  std::vector<std::string> warnings;  ///< what makes these figures doubtful

  /// Heat of each step over its length [J/°CA], zero at the first sample; gross is net and the loss to the wall.
  std::vector<double> heat_release_net_j_per_cad() const;
  std::vector<double> heat_release_gross_j_per_cad() const;
  std::vector<double> heat_loss_j_per_cad() const;
};

/// The single figures of an analysis by name.
struct TraceFigure {
  std::string_view name;
  double TraceAnalysis::* member;
};
inline constexpr std::array<TraceFigure, 14> trace_figures{{
    {"pegging_bar", &TraceAnalysis::pegging_bar},
    {"n_compression", &TraceAnalysis::n_compression},
    {"n_expansion", &TraceAnalysis::n_expansion},
    {"ca10_cad", &TraceAnalysis::ca10_cad},
    {"ca50_cad", &TraceAnalysis::ca50_cad},
    {"ca90_cad", &TraceAnalysis::ca90_cad},
    {"heat_net_j", &TraceAnalysis::heat_net_j_total},
    {"heat_gross_j", &TraceAnalysis::heat_gross_j_total},
    {"imep_closed_bar", &TraceAnalysis::imep_closed_bar},
    {"work_closed_j", &TraceAnalysis::work_closed_j},
    {"p_max_bar", &TraceAnalysis::p_max_bar},
    {"p_max_cad", &TraceAnalysis::p_max_cad},
    {"dp_max_bar_per_cad", &TraceAnalysis::dp_max_bar_per_cad},
    {"t_max_k", &TraceAnalysis::t_max_k},
}};

/// Offset to add to a relative trace [bar] (engine analysis calls it; here for use on its own). DataError where the
/// trace does not cover the angles that the method reads.
double pegging_offset_bar(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                          const Cylinder& cylinder, const TraceOptions& options);

/// Exponent of p V^n = const by regression of ln p on ln V over [from, to]; NaN with fewer than three samples there.
double polytropic_exponent(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                           const Cylinder& cylinder, double from_cad, double to_cad);

/// Analyses the samples between IVC and EVO. The trapped amount is the point's mass or eta_V p(first) V_s/(R T_in);
/// the point's intake pressure is not used for it.
TraceAnalysis analyze_trace(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                            const Cylinder& cylinder, const OperatingPoint& point, const TraceOptions& options);

}  // namespace mgdd::engine
