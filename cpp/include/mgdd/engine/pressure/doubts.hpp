// What makes an analysed trace doubtful or impossible: level, top dead centre, mass, window, work.
#pragma once

#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/pressure/burn_window.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"

namespace mgdd::engine {

/// ParameterError for a mass that makes the charge colder than 100 K or hotter than 1500 K at IVC; DataError for a
/// gross work that cannot reach the stated brake work.
void refuse_impossible(const TraceAnalysis& analysis, const Cylinder& cylinder, const OperatingPoint& point,
                       const TraceOptions& options);

/// Fills `warnings`.
void add_warnings(TraceAnalysis& analysis, const Cylinder& cylinder, const TraceOptions& options,
                  const BurnWindow& burn);

/// Gross IMEP is at most closed IMEP plus this [bar]: exhaust pressure held from EVO to bottom dead centre, less 0.7 of
/// p(IVC) from bottom dead centre to IVC.
double open_part_at_most_bar(const TraceAnalysis& analysis, const Cylinder& cylinder);

/// And at least this: exhaust pressure at 1 bar, the whole of p(IVC) up to IVC.
double open_part_at_least_bar(const TraceAnalysis& analysis, const Cylinder& cylinder);

}  // namespace mgdd::engine
