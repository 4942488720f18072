#include "mgdd/engine/batch/batch.hpp"

#include <algorithm>
#include <string>

#include "batch_worker.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/parallel.hpp"
#include "mgdd/engine/sensitivity.hpp"

namespace mgdd::engine {
namespace {

constexpr std::size_t job_size = 4096;  ///< cases that one thread takes at a time
constexpr double shared_pays = 30.0;    ///< cases of an operating point that make up for its tables

/// Runs every case; the number of those that are not physical.
template <class T>
std::size_t run_all(const CaseReader& reader, const BatchSettings& settings, const BatchOutput& output,
                    const std::string& along = {}) {
  const std::size_t n = reader.size(), jobs = (n + job_size - 1) / job_size;
  std::vector<BatchWorker<T>> workers(thread_count(jobs, settings.threads),
                                      BatchWorker<T>(reader, settings, output, along));
  static_cast<void>(parallel_for(jobs, settings.threads, [&](std::size_t job, std::size_t worker, StopRequest&) {
    workers[worker].run(job * job_size, std::min(n, (job + 1) * job_size));
  }));
  std::size_t failed = 0;
  for (const BatchWorker<T>& worker : workers)
    failed += worker.failed();
  return failed;
}

/// Derivatives that need other tables or gamma of temperature: cycle by cycle.
void differentiate_alone(const CaseReader& reader, const BatchSettings& settings, const BatchOutput& output,
                         const std::string& along) {
  const std::size_t n = reader.size(), jobs = (n + job_size - 1) / job_size;
  static_cast<void>(parallel_for(jobs, settings.threads, [&](std::size_t job, std::size_t, StopRequest&) {
    CycleInputs<double> inputs = reader.start();
    for (std::size_t row = job * job_size; row < std::min(n, (job + 1) * job_size); ++row) {
      static_cast<void>(reader.read(row, CaseReader::no_row, inputs));
      output.write(row, sensitivities(inputs.cylinder, inputs.point, inputs.soc_cad, {along}, settings.step_cad,
                                      settings.integrator)
                            .indicators.front());
    }
  }));
}

}  // namespace

void validate(const BatchCases& cases) {
  CaseReader(cases).require_valid();
}

IndicatorMember parse_indicator(std::string_view name) {
  std::string valid;
  for (const auto& field : indicator_fields<double>()) {
    if (field.name == name) return field.member;
    valid.append(valid.empty() ? "" : ", ").append(field.name);
  }
  throw ParameterError("outputs", name, "must be one of " + valid);
}

BatchForm form_of(const BatchCases& cases, BatchForm wanted) {
  if (cases.cylinder.gas.gamma_model != GammaModel::constant) return BatchForm::single;
  if (wanted != BatchForm::automatic) return wanted;
  const CaseReader reader(cases);
  return reader.cases_per_point() >= shared_pays ? BatchForm::shared : BatchForm::lanes;
}

std::size_t simulate_batch(const BatchCases& cases, const BatchSettings& settings,
                           std::span<const IndicatorMember> outputs, std::span<double* const> columns) {
  const CaseReader reader(cases);
  reader.require_valid();
  static_cast<void>(crank_grid(cases.cylinder, settings.step_cad));  // refuses a step before any work
  BatchSettings known = settings;
  known.form = form_of(cases, settings.form);
  return run_all<double>(reader, known, {outputs, columns});
}

void differentiate_batch(const BatchCases& cases, const BatchSettings& settings,
                         std::span<const IndicatorMember> outputs, const std::vector<std::string>& along,
                         std::span<double* const> columns) {
  const CaseReader reader(cases);
  CycleInputs<double> first = reader.start();
  for (const std::string& name : along)
    static_cast<void>(input(first, name));  // refuses an unknown one
  reader.require_valid();
  static_cast<void>(crank_grid(cases.cylinder, settings.step_cad));
  const std::vector<BatchColumn> all = batch_columns();
  for (std::size_t i = 0; i < along.size(); ++i) {
    const BatchOutput output(outputs, columns.subspan(i * outputs.size(), outputs.size()));
    const auto column = std::ranges::find(all, along[i], [](const BatchColumn& c) { return c.info.name; });
    BatchSettings known = settings;
    known.form = form_of(cases, BatchForm::lanes);
    if (known.form == BatchForm::lanes && column->changes < BatchColumn::Changes::tables) {
      static_cast<void>(run_all<Dual<1>>(reader, known, output, along[i]));
    } else {
      differentiate_alone(reader, known, output, along[i]);
    }
  }
}

}  // namespace mgdd::engine
