// Many cycles of one record: the analysis of each, shared out over threads, and their warnings counted together.
#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/parallel.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"

namespace mgdd::engine {
namespace {

// Runs `work`; an error says the cycle, counted from 1.
template <class Work>
void naming_cycle(std::size_t cycle, Work work) {
  const std::string words = "cycle " + std::to_string(cycle + 1) + ": ";
  try {
    work();
  } catch (const DataError& error) {
    throw in_context(words, error);
  } catch (const ParameterError& error) {
    throw in_context(words, error);
  } catch (const ShapeError& error) {
    throw in_context(words, error);
  }
}

}  // namespace

std::vector<TraceAnalysis> analyze_cycles(const std::vector<double>& angle_cad,
                                          const std::vector<std::vector<double>>& pressure_bar,
                                          const Cylinder& cylinder, const OperatingPoint& point,
                                          const TraceOptions& options, std::size_t threads) {
  if (pressure_bar.empty()) throw about("pressure_bar", ShapeError("pressure_bar holds no cycle: give at least one"));
  naming_cycle(0, [&] { check_trace(angle_cad, pressure_bar.front()); });
  const TraceAnalyzer analyze(angle_cad, cylinder, point, options);
  std::vector<TraceAnalysis> out(pressure_bar.size());
  parallel_for(pressure_bar.size(), threads, [&](std::size_t cycle, std::size_t, StopRequest&) {
    naming_cycle(cycle, [&] { out[cycle] = analyze(pressure_bar[cycle]); });
  });
  return out;
}

std::vector<CycleFigures> indicate_cycles(const Indicating& indicating, std::span<const double> record,
                                          std::size_t threads) {
  const std::size_t samples = indicating.samples(), cycles = record.size() / samples;
  if (cycles == 0 || cycles * samples != record.size()) {
    throw about("pressure_bar", ShapeError("pressure_bar holds " + std::to_string(record.size()) +
                                           " samples: whole cycles of " + std::to_string(samples) + " are needed"));
  }
  std::vector<CycleFigures> out(cycles);
  const std::size_t workers = thread_count(cycles, threads);
  std::vector<Indicating::Workspace> work(workers, indicating.make_workspace());
  parallel_for(cycles, workers, [&](std::size_t cycle, std::size_t worker, StopRequest&) {
    const double* const pressure = record.data() + cycle * samples;
    out[cycle] = indicating(pressure, work[worker]);
    if (out[cycle].p_max_bar <= highest_pressure_bar) return;
    naming_cycle(cycle, [&] { check_trace(indicating.angle_cad(), {pressure, pressure + samples}); });
  });
  return out;
}

std::vector<TraceWarning> count_warnings(const std::vector<TraceAnalysis>& cycles) {
  struct Kind {
    std::string_view kind;
    std::size_t first, count;
    std::string text;
  };
  std::vector<Kind> kinds;
  for (std::size_t c = 0; c < cycles.size(); ++c) {
    for (const TraceWarning& warning : cycles[c].warnings) {
      const auto known =
          std::find_if(kinds.begin(), kinds.end(), [&](const Kind& k) { return k.kind == warning.kind; });
      if (known == kinds.end()) {
        kinds.push_back({warning.kind, c, 1, warning.text});
      } else {
        ++known->count;
      }
    }
  }
  std::vector<TraceWarning> lines;
  for (const Kind& k : kinds) {
    lines.push_back({k.kind, std::to_string(k.count) + " of " + std::to_string(cycles.size()) + " cycles: " + k.text +
                                 " (cycle " + std::to_string(k.first + 1) + ")"});
  }
  return lines;
}

}  // namespace mgdd::engine
