// Binds loop/function_plant.hpp: the address of a compiled function as a plant.
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "loop/function_plant_binding.hpp"
#include "nouns.hpp"

namespace mgdd::bindings {
namespace {

using B = BoundFunctionPlant;

B make(std::uintptr_t address, std::uintptr_t user_data, std::size_t inputs, std::size_t values,
       std::vector<std::string> limits, double noise_sd, std::uint64_t seed) {
  // NOLINTBEGIN(performance-no-int-to-ptr): Python holds addresses as numbers
  const auto function = reinterpret_cast<loop::PlantFunction>(address);
  auto* const data = reinterpret_cast<void*>(user_data);
  // NOLINTEND(performance-no-int-to-ptr)
  return {"FunctionPlant", loop::FunctionPlant(function, data, {inputs, values, std::move(limits), noise_sd, seed})};
}

std::optional<std::vector<double>> measure(B& bound, const std::vector<double>& inputs) {
  if (inputs.size() != bound.constant().settings().inputs) throw ShapeError("inputs: one number for each");
  const auto plant = bound.use();
  const py::gil_scoped_release release;
  const std::span<const double> outputs = plant->measure(inputs);
  if (outputs.empty()) return std::nullopt;
  return std::vector<double>(outputs.begin(), outputs.end());
}

}  // namespace

void bind_function_plant(py::module_& m) {
  using py::arg;
  py::class_<B> cls(m, "FunctionPlant", "A compiled function as a plant; use mgdd.loop.FunctionPlant.");
  cls.def(py::init(&make), arg("address"), arg("user_data"), py::kw_only(), arg("inputs"), arg("values"), arg("limits"),
          arg("noise_sd"), arg("seed"))
      .def("measure", &measure, arg("inputs"), "Run one cycle without the GIL: its outputs, None where it failed.")
      .def(
          "__deepcopy__", [](const B& b, const py::dict&) { return B("FunctionPlant", *b.use()); }, arg("memo"),
          "The same function and data at the same cycle.")
      .def_property_readonly("cycle", [](const B& b) { return b.use()->cycle(); }, "Index of the next cycle.");
  m.def("plant_noise", &loop::plant_noise, arg("seed"), arg("cycle"), "Standard normal noise of a cycle.");
}

}  // namespace mgdd::bindings
