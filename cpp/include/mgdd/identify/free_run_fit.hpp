// Fit of a model family to measured records by its free run: names and bounds come from the family, unknowns are named.
// Units are the model's own. Allocates and throws. The search is optimize/least_squares.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "mgdd/common/error.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/identify/output_error.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::identify {

/// What a fit of free runs gives back.
struct FreeRunFit {
  optimize::FitReport report;
  std::vector<double> parameters;            ///< all of them, the fixed ones included
  std::vector<std::vector<double>> starts;   ///< start numbers of every record
  std::vector<std::vector<double>> outputs;  ///< free run on every sample of every record
};

template <class Fields>
std::size_t field_index(const Fields& fields, std::string_view name, std::string_view what) {
  const auto found = std::ranges::find(fields, name, &FieldInfo::name);
  if (found != fields.end()) return static_cast<std::size_t>(found - fields.begin());
  std::string known;
  for (const FieldInfo& field : fields)
    known.append(known.empty() ? "" : ", ").append(field.name);
  throw ParameterError(std::string(what) + " '" + std::string(name) + "': must be one of " + known);
}

/// Throws ParameterError for an unknown name or a value outside its bounds, ShapeError for records that do not fit. An
/// empty `free` fits the free start states alone.
template <dynamics::DescribedFamily Model>
FreeRunFit fit_free_run(const Model& model, const std::vector<double>& base, const std::vector<std::string>& free,
                        std::vector<SimulationRecord> records, const optimize::LeastSquaresOptions& options) {
  Values<double, Model::n_parameters> parameters{};
  if (base.size() != parameters.size()) {
    throw about("base", ShapeError("base has " + std::to_string(base.size()) + " values: must have " +
                                   std::to_string(parameters.size())));
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const FieldInfo& domain = Model::parameters[i];
    require_in(domain, base[i]);
    parameters[i] = base[i];
  }
  std::vector<std::size_t> indices;
  std::vector<optimize::Parameter> unknowns;
  for (const std::string& name : free) {
    const std::size_t i = field_index(Model::parameters, name, "parameter");
    indices.push_back(i);
    unknowns.push_back(optimize::parameter_of(Model::parameters[i], name));
  }
  append_start_numbers<Model>(unknowns, records);
  OutputError<Model> residual(model, parameters, std::move(indices), std::move(records));
  optimize::LeastSquares search(std::move(unknowns), residual.n_residuals(), options);
  FreeRunFit fit;
  fit.report = search.solve(residual, residual.start());
  const auto found = residual.parameters(fit.report.values);
  fit.parameters.assign(found.begin(), found.end());
  for (std::size_t r = 0; r < residual.records().size(); ++r) {
    const auto start = residual.start_numbers(r, fit.report.values);
    fit.starts.emplace_back(start.begin(), start.end());
    fit.outputs.push_back(residual.simulate(r, fit.report.values));
  }
  return fit;
}

/// Free run of `input` from the start numbers `start`: the output at every sample.
template <dynamics::ModelFamily Family>
std::vector<double> free_run(const Family& family, const std::vector<double>& parameters,
                             const std::vector<double>& start, const std::vector<double>& input, double dt_s) {
  Values<double, Family::n_parameters> p{};
  Values<double, Family::n_start> stated{};
  if (parameters.size() != p.size() || start.size() != stated.size()) {
    throw ShapeError("free run: " + std::to_string(p.size()) + " parameters and " + std::to_string(stated.size()) +
                     " start values are needed");
  }
  require_positive("dt_s", dt_s, "s");
  std::ranges::copy(parameters, p.begin());
  std::ranges::copy(start, stated.begin());
  const auto model = family.template prepare<double>(p, dt_s);
  auto state = family.template start<double>(model, stated);
  std::vector<double> output(input.size());
  dynamics::simulate(model, state, std::span<const double>(input), std::span<double>(output));
  return output;
}

}  // namespace mgdd::identify
