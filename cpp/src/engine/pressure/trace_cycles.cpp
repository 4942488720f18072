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

std::size_t cycles_in(std::span<const double> record, std::size_t samples) {
  const std::size_t cycles = samples == 0 ? 0 : record.size() / samples;
  if (cycles == 0 || cycles * samples != record.size()) {
    throw about("pressure_bar", ShapeError("pressure_bar holds " + std::to_string(record.size()) +
                                           " samples: whole cycles of " + std::to_string(samples) + " are needed"));
  }
  return cycles;
}

void drop_columns(TraceAnalysis& a, bool keep_grid) {
  for (std::vector<double>* column : {&a.pressure_bar, &a.temperature_k, &a.net_step_j, &a.loss_step_j,
                                      &a.pressure_step_bar, &a.heat_net_cumulative_j, &a.heat_gross_cumulative_j})
    *column = std::vector<double>();
  if (!keep_grid) a.angle_cad = std::vector<double>(), a.volume_l = std::vector<double>();
}

}  // namespace

std::vector<TraceAnalysis> analyze_cycles(const std::vector<double>& angle_cad, std::span<const double> record,
                                          const Cylinder& cylinder, const OperatingPoint& point,
                                          const TraceOptions& options, bool columns, std::size_t threads) {
  const std::size_t samples = angle_cad.size(), cycles = cycles_in(record, samples);
  const auto row = [&](std::size_t cycle) {
    const auto part = record.subspan(cycle * samples, samples);
    return std::vector<double>(part.begin(), part.end());
  };
  naming_cycle(0, [&] { check_trace(angle_cad, row(0)); });
  const TraceAnalyzer analyze(angle_cad, cylinder, point, options);
  std::vector<TraceAnalysis> out(cycles);
  parallel_for(cycles, threads, [&](std::size_t cycle, std::size_t, StopRequest&) {
    naming_cycle(cycle, [&] { out[cycle] = analyze(row(cycle)); });
    std::erase_if(out[cycle].warnings, [](const TraceWarning& w) { return w.kind != "spike"; });
    if (!columns) drop_columns(out[cycle], cycle == 0);
  });
  return out;
}

std::vector<CycleFigures> indicate_cycles(const Indicating& indicating, std::span<const double> record,
                                          std::size_t threads) {
  const std::size_t samples = indicating.samples(), cycles = cycles_in(record, samples);
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
