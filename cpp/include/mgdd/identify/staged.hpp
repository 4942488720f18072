// Fits in stages: more samples and more free parameters from stage to stage. Offline.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/identify/output_error.hpp"
#include "mgdd/optimize/least_squares/block_sandwich.hpp"
#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"
#include "mgdd/optimize/least_squares/parameter.hpp"

namespace mgdd::identify {

/// One stage of a staged fit: which parameters are free, on how many first samples of which records.
struct FitStage {
  std::vector<std::size_t> free;
  std::vector<std::size_t> records;  ///< indices; empty for all
  double fraction = 1.0;             ///< of the samples of each record
  optimize::LeastSquaresOptions search{};
};

/// The rows that each record has in a residual.
inline std::vector<optimize::ResidualRecord> residual_records(const std::vector<SimulationRecord>& records) {
  std::vector<optimize::ResidualRecord> out;
  Eigen::Index first = 0;
  for (const SimulationRecord& record : records) {
    const auto rows = static_cast<Eigen::Index>(record.output.size() - record.skip);
    out.push_back({first, rows, record.dt_s});
    first += rows;
  }
  return out;
}

/// Stages one after the other, each from where the last one ended. `parameters` describes every model parameter;
/// `values` comes in as the start and goes out as the estimate. Returns the report of the last stage; its
/// standard errors count the correlation of the residual.
template <dynamics::DescribedFamily Model>
optimize::FitReport fit_in_stages(const Model& model, const std::vector<optimize::Parameter>& parameters,
                                  const std::vector<SimulationRecord>& records, const std::vector<FitStage>& stages,
                                  Values<double, Model::n_parameters>& values) {
  if (parameters.size() != values.size()) {
    throw about("parameters", ShapeError("parameters has " + std::to_string(parameters.size()) +
                                         " entries: must have " + std::to_string(values.size())));
  }
  if (stages.empty()) throw about("stages", ShapeError("stages: must be at least one"));
  optimize::FitReport report;
  for (const FitStage& stage : stages) {
    std::vector<SimulationRecord> chosen;
    for (std::size_t r = 0; r < records.size(); ++r) {
      if (!stage.records.empty() && std::ranges::find(stage.records, r) == stage.records.end()) continue;
      SimulationRecord record = records[r];
      const auto n = static_cast<std::size_t>(std::llround(stage.fraction * static_cast<double>(record.output.size())));
      record.output.resize(n);
      record.input.resize(n * input_size<dynamics::FamilyModel<Model, double>>());
      if (!record.weight.empty()) record.weight.resize(n);
      chosen.push_back(std::move(record));
    }
    std::vector<optimize::Parameter> unknowns;
    for (const std::size_t i : stage.free)
      unknowns.push_back(parameters.at(i));
    append_start_numbers<Model>(unknowns, chosen);
    OutputError<Model> residual(model, values, stage.free, std::move(chosen));
    optimize::LeastSquares search(unknowns, residual.n_residuals(), stage.search);
    report = search.solve(residual, residual.start());
    values = residual.parameters(report.values);
    const bool interrupted = report.status == optimize::FitStatus::interrupted;
    if ((interrupted || &stage == &stages.back()) && std::isfinite(report.cost)) {
      optimize::block_sandwich(report, search.jacobian(), residual_records(residual.records()));
    }
    if (interrupted) break;
  }
  return report;
}

}  // namespace mgdd::identify
