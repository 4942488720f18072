// Names of what a cycle and a run consist of, for whoever writes them out: files, tables, bindings.
#pragma once

#include <array>
#include <string_view>

#include "mgdd/loop/engine_loop.hpp"

namespace mgdd::loop {

/// A number of a record; flags and counts read as numbers.
template <class Record>
struct NamedNumber {
  std::string_view name;
  double (*of)(const Record&) noexcept;
};

/// Scalars of one cycle that are not indicators.
inline constexpr std::array<NamedNumber<BenchCycle>, 9> bench_cycle_numbers{{
    {"soc_requested_cad", [](const BenchCycle& c) noexcept { return c.soc_requested_cad; }},
    {"soc_applied_cad", [](const BenchCycle& c) noexcept { return c.soc_applied_cad; }},
    {"soc_cad", [](const BenchCycle& c) noexcept { return c.soc_cad; }},
    {"nox_true_ppm", [](const BenchCycle& c) noexcept { return c.nox_true_ppm; }},
    {"nox_analyser_ppm", [](const BenchCycle& c) noexcept { return c.nox_analyser_ppm; }},
    {"nox_fast_ppm", [](const BenchCycle& c) noexcept { return c.nox_fast_ppm; }},
    {"nox_soft_ppm", [](const BenchCycle& c) noexcept { return c.nox_soft_ppm; }},
    {"nox_soft_corrected_ppm", [](const BenchCycle& c) noexcept { return c.nox_soft_corrected_ppm; }},
    {"j", [](const BenchCycle& c) noexcept { return c.j; }},
}};

struct BenchFlag {
  std::string_view name;
  bool BenchCycle::* member;
};
inline constexpr std::array<BenchFlag, 4> bench_flags{{
    {"misfire", &BenchCycle::misfire},
    {"clamped", &BenchCycle::clamped},
    {"unphysical", &BenchCycle::unphysical},
    {"operating_point_changed", &BenchCycle::operating_point_changed},
}};

/// What a run came to, the number of its cycles apart.
inline constexpr std::array<NamedNumber<LoopSummary>, 14> loop_summary_numbers{{
    {"final_cad", [](const LoopSummary& s) noexcept { return s.final_cad; }},
    {"mean_cad", [](const LoopSummary& s) noexcept { return s.mean_cad; }},
    {"rms_cad", [](const LoopSummary& s) noexcept { return s.rms_cad; }},
    {"cycles_to", [](const LoopSummary& s) noexcept { return s.cycles_to; }},
    {"cycles_stays", [](const LoopSummary& s) noexcept { return s.cycles_stays; }},
    {"exceeded_fraction", [](const LoopSummary& s) noexcept { return s.exceeded_fraction; }},
    {"mean_applied_cad", [](const LoopSummary& s) noexcept { return s.mean_applied_cad; }},
    {"mean_j", [](const LoopSummary& s) noexcept { return s.mean_j; }},
    {"mean_efficiency_percent", [](const LoopSummary& s) noexcept { return s.mean_efficiency_percent; }},
    {"mean_nox_ppm", [](const LoopSummary& s) noexcept { return s.mean_nox_ppm; }},
    {"lowest_cad", [](const LoopSummary& s) noexcept { return s.lowest_cad; }},
    {"highest_cad", [](const LoopSummary& s) noexcept { return s.highest_cad; }},
    {"misfires", [](const LoopSummary& s) noexcept { return static_cast<double>(s.misfires); }},
    {"judged_from", [](const LoopSummary& s) noexcept { return static_cast<double>(s.judged_from); }},
}};

/// Of one limit; written out as NAME_LIMIT. A share of no cycle is NaN.
inline constexpr std::array<NamedNumber<LimitFigures>, 7> limit_figure_numbers{{
    {"limit", [](const LimitFigures& f) noexcept { return f.limit; }},
    {"worst", [](const LimitFigures& f) noexcept { return f.worst; }},
    {"worst_cycle", [](const LimitFigures& f) noexcept { return f.worst_cycle; }},
    {"above_cycles", [](const LimitFigures& f) noexcept { return static_cast<double>(f.above_cycles); }},
    {"above_fraction",
     [](const LimitFigures& f) noexcept {
       return static_cast<double>(f.above_cycles) / static_cast<double>(f.read_cycles);
     }},
    {"judged_above_cycles", [](const LimitFigures& f) noexcept { return static_cast<double>(f.judged_above_cycles); }},
    {"judged_above_fraction",
     [](const LimitFigures& f) noexcept {
       return static_cast<double>(f.judged_above_cycles) / static_cast<double>(f.judged_read_cycles);
     }},
}};

}  // namespace mgdd::loop
