// Binds math/lookup_table.hpp: a table over one or two axes, read at many points at once.
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "mgdd/math/lookup_table.hpp"

namespace mgdd::bindings {
namespace {

/// Python knows the number of axes at run time only.
struct BoundTable {
  std::variant<LookupTable<1>, LookupTable<2>> table;
};

BoundTable make_table(std::vector<std::string> names, std::vector<std::vector<double>> axes, const InputArray& values) {
  if (names.size() != axes.size() || axes.empty() || axes.size() > 2) {
    throw about("axes", ShapeError("axes has " + std::to_string(axes.size()) + " entries and " +
                                   std::to_string(names.size()) + " names: must have one or two of both"));
  }
  std::vector<double> cells(values.data(), values.data() + values.size());
  TableAxis first{std::move(names[0]), std::move(axes[0])};
  if (axes.size() == 1) return {LookupTable<1>({std::move(first)}, std::move(cells))};
  return {LookupTable<2>({std::move(first), TableAxis{std::move(names[1]), std::move(axes[1])}}, std::move(cells))};
}

template <std::size_t n_axes>
py::tuple read_points(const LookupTable<n_axes>& table, const InputArray& points) {
  if (points.ndim() != 2 || points.shape(0) != static_cast<py::ssize_t>(n_axes)) {
    throw about("points", ShapeError("points: must be one row per axis, " + std::to_string(n_axes) + " in all"));
  }
  const py::ssize_t count = points.shape(1);
  py::array_t<double> values(count);
  py::array_t<bool> held(count);
  const double* from = points.data();
  double* value = values.mutable_data();
  bool* outside = held.mutable_data();
  without_gil([&] {
    for (py::ssize_t i = 0; i < count; ++i) {
      std::array<double, n_axes> point{};
      for (std::size_t a = 0; a < n_axes; ++a)
        point[a] = from[static_cast<py::ssize_t>(a) * count + i];
      const TableValue found = table.at(std::span<const double, n_axes>(point));
      value[i] = found.value;
      outside[i] = found.held_outside;
    }
  });
  return py::make_tuple(values, held);
}

}  // namespace

void bind_lookup_table(py::module_& m) {
  using py::arg;
  py::class_<BoundTable>(m, "LookupTable", "A look-up table over one or two axes; see mgdd.maps.CalibrationMap.")
      .def(py::init(&make_table), py::kw_only(), arg("names"), arg("axes"), arg("values"))
      .def(
          "at",
          [](const BoundTable& bound, const InputArray& points) {
            return std::visit([&](const auto& table) { return read_points(table, points); }, bound.table);
          },
          arg("points"),
          "Values at points, one row per axis, and which of them lie outside of the axes and are held at the edge.");
}

}  // namespace mgdd::bindings
