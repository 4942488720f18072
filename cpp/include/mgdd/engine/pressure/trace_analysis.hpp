// Analysis of a measured pressure trace of the closed part: pegging, heat release, burn angles, work, polytropic
// exponents. Angles °CA aTDC, pressure in bar at the border. Offline code: it allocates and throws.
// Sources: Heywood 1988, chapter 9; Randolph 1990, Brunt and Pond 1997 (pegging); Krieger and Borman 1966 (heat
// release).
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/pressure/indicating.hpp"
#include "mgdd/engine/pressure/trace_options.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

/// What makes the figures of a trace doubtful. Warnings of one kind are counted together over many cycles.
struct TraceWarning {
  std::string_view kind;  ///< "pegging", "tdc", "spike" ...
  std::string text;

  bool operator==(const TraceWarning&) const = default;
};

/// The burn angles and the heat are those of the smoothed pressure in the window that was found.
struct TraceAnalysis : CycleFigures {
  std::vector<double> angle_cad, pressure_bar, volume_l, temperature_k;
  std::vector<double> net_step_j, loss_step_j;  ///< of the step that ends at the sample
  std::vector<double> pressure_step_bar;        ///< by combustion; filled for fractions of it only
  std::vector<double> heat_net_cumulative_j, heat_gross_cumulative_j;  ///< zero at the window's start
  double heat_from_cad = undefined<double>();                          ///< window of the cumulative heat
  double heat_to_cad = undefined<double>();                            ///< its end
  double heat_gross_j = undefined<double>();  ///< peak of the cumulative heat, or its end where options say so
  double work_closed_j = undefined<double>();
  double t_max_k = undefined<double>();
  double trapped_mass_g = undefined<double>();
  double tdc_offset_cad = undefined<double>();          ///< motored: what the angles are too large by, good to 1.4 CAD
  double compression_offset_bar = undefined<double>();  ///< what p + offset = C V^-n would still add to the trace
  bool motored = false;                                 ///< expansion runs on the compression line: no burn
  bool window_found = false;                            ///< the window is from the trace, not from the options
  std::string mass_source;                              ///< "given", or the temperature at IVC it was computed with
  std::string smoothing;                                ///< what acted on the pressure before the heat release
  std::vector<TraceWarning> warnings;

  /// Heat of each step over its length [J/°CA], zero at the first sample; gross is net and the loss to the wall.
  std::vector<double> heat_release_net_j_per_cad() const;
  std::vector<double> heat_release_gross_j_per_cad() const;
  std::vector<double> heat_loss_j_per_cad() const;
};

/// The single figures of an analysis by name.
inline constexpr auto trace_figures = [] {
  using A = TraceAnalysis;
  std::array<Figure<A>, cycle_figures.size() + 8> all{};
  std::size_t n = 0;
  for (const Figure<CycleFigures>& figure : cycle_figures)
    all[n++] = {figure.name, figure.member};
  for (const Figure<A>& figure : {Figure<A>{"heat_from_cad", &A::heat_from_cad},
                                  {"heat_to_cad", &A::heat_to_cad},
                                  {"heat_gross_j", &A::heat_gross_j},
                                  {"work_closed_j", &A::work_closed_j},
                                  {"t_max_k", &A::t_max_k},
                                  {"trapped_mass_g", &A::trapped_mass_g},
                                  {"tdc_offset_cad", &A::tdc_offset_cad},
                                  {"compression_offset_bar", &A::compression_offset_bar}})
    all[n++] = figure;
  return all;
}();

/// Analyses the samples between IVC and EVO. The trapped amount is that of `measured_gas_j_per_k`. ParameterError for
/// an option, a mass or a speed that cannot be; DataError for a trace that cannot be analysed, or whose work is below
/// the stated brake work.
TraceAnalysis analyze_trace(const std::vector<double>& angle_cad, const std::vector<double>& pressure_bar,
                            const Cylinder& cylinder, const OperatingPoint& point, const TraceOptions& options);

/// What all cycles on the same angles share: geometry, tables of the wall heat, weights of the smoothing. Constant
/// after construction; several threads may use one.
class TraceAnalyzer {
 public:
  /// `angle_cad` must have passed `check_trace`. Throws as `analyze_trace`.
  TraceAnalyzer(const std::vector<double>& angle_cad, const Cylinder& cylinder, const OperatingPoint& point,
                const TraceOptions& options);
  TraceAnalysis operator()(const std::vector<double>& pressure_bar) const;

 private:
  struct Shared;
  std::shared_ptr<const Shared> shared_;
};

/// Every cycle of a record on the same angles, one below the other, shared out over `threads` (0: one per core).
/// Without `columns` only the first keeps its angles and volumes, and none another column: a long record is small then.
/// An error names its cycle, counted from 1; ShapeError for another length than a whole number of cycles. Of the
/// warnings only those of single samples are kept: bounds on one look judge the mean cycle, not each of many.
std::vector<TraceAnalysis> analyze_cycles(const std::vector<double>& angle_cad, std::span<const double> record,
                                          const Cylinder& cylinder, const OperatingPoint& point,
                                          const TraceOptions& options, bool columns = true, std::size_t threads = 0);

/// One line per kind of warning, in the order of their first cycle: "12 of 60 cycles: ... (cycle 3)".
std::vector<TraceWarning> count_warnings(const std::vector<TraceAnalysis>& cycles);

}  // namespace mgdd::engine
