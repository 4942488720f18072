// Binds engine/batch.hpp: many cycles at once.
#include <cstddef>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/engine/batch/batch.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

BatchCases cases_of(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
                    const std::vector<std::string>& names, const InputArray& rows) {
  if (rows.ndim() != 2 || rows.shape(1) != static_cast<py::ssize_t>(names.size())) {
    throw about("rows", ShapeError("rows has " + std::to_string(rows.ndim()) +
                                   " dimensions: must be an array of shape (cases, " + std::to_string(names.size()) +
                                   "), one column for each name"));
  }
  return {cylinder, point, soc_cad, names, {rows.data(), static_cast<std::size_t>(rows.size())}};
}

py::dict batch(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad,
               const std::vector<std::string>& names, const InputArray& rows, const std::vector<std::string>& outputs,
               double step_cad, const std::string& integrator, std::size_t threads, const std::string& form) {
  const BatchCases cases = cases_of(cylinder, point, soc_cad, names, rows);
  BatchSettings settings;
  settings.step_cad = step_cad;
  settings.integrator = parse_name<Integrator>("integrator", integrator);
  settings.threads = threads;
  settings.form = parse_name<BatchForm>("form", form);
  py::dict out;
  std::vector<IndicatorMember> members;
  std::vector<double*> columns;
  for (const std::string& name : outputs) {
    members.push_back(parse_indicator(name));
    py::array_t<double> column(static_cast<py::ssize_t>(cases.size()));
    columns.push_back(column.mutable_data());
    out[as_str(name)] = column;
  }
  without_gil([&] { return simulate_batch(cases, settings, members, columns); });
  return out;
}

}  // namespace

void bind_batch(py::module_& m) {
  using py::arg;
  m.def("batch", &batch, arg("cylinder"), arg("point"), arg("soc_cad"), arg("names"), arg("rows"), arg("outputs"),
        arg("step_cad"), arg("integrator"), arg("threads") = 0, arg("form") = "automatic",
        "Indicators of many cycles; `rows` is (cases, names). NaN where a cycle is not physical. Releases the GIL.");
  m.def(
      "batch_form",
      [](const Cylinder& cylinder, const OperatingPoint& point, double soc_cad, const std::vector<std::string>& names,
         const InputArray& rows) {
        const BatchCases cases = cases_of(cylinder, point, soc_cad, names, rows);
        return std::string(name_of(without_gil([&] { return form_of(cases, BatchForm::automatic); })));
      },
      arg("cylinder"), arg("point"), arg("soc_cad"), arg("names"), arg("rows"),
      "What `form='automatic'` stands for: pass it on where a batch is cut into pieces.");
  m.def(
      "batch_inputs",
      [] {
        py::dict out;
        for (const FieldInfo& info : batch_inputs())
          out[as_str(info.name)] = py::make_tuple(as_str(info.unit), as_str(info.meaning));
        return out;
      },
      "What may vary in a batch: unit and meaning by name.");
}

}  // namespace mgdd::bindings
