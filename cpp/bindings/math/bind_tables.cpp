// Binds math/tables.hpp: where points lie in a table over one or two axes.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/math/tables.hpp"

namespace mgdd::bindings {
namespace {

struct TableAxes {
  std::vector<std::vector<double>> entries;
};

TableAxes make_axes(const std::vector<std::string>& names, std::vector<std::vector<double>> entries) {
  if (entries.empty() || entries.size() > 2) {
    throw about("axes", ShapeError("axes has " + std::to_string(entries.size()) + " entries: must have one or two"));
  }
  for (std::size_t a = 0; a < entries.size(); ++a)
    require_axis(names.at(a), entries[a]);
  return {std::move(entries)};
}

template <std::size_t corners, class Find>
py::tuple places_of(py::ssize_t count, Find find) {
  py::array_t<std::int64_t> cells({static_cast<py::ssize_t>(corners), count});
  py::array_t<double> weights({static_cast<py::ssize_t>(corners), count});
  py::array_t<bool> held(count);
  std::int64_t* cell = cells.mutable_data();
  double* weight = weights.mutable_data();
  bool* outside = held.mutable_data();
  without_gil([&] {
    for (py::ssize_t i = 0; i < count; ++i) {
      const TablePlace<corners> place = find(i);
      for (std::size_t c = 0; c < corners; ++c) {
        const py::ssize_t at = static_cast<py::ssize_t>(c) * count + i;
        cell[at] = static_cast<std::int64_t>(place.cell[c]);
        weight[at] = place.weight[c];
      }
      outside[i] = place.outside || std::isnan(place.weight[0]);
    }
  });
  return py::make_tuple(cells, weights, held);
}

py::tuple find_places(const TableAxes& axes, const InputArray& points) {
  const auto n_axes = static_cast<py::ssize_t>(axes.entries.size());
  if (points.ndim() != 2 || points.shape(0) != n_axes) {
    throw about("points", ShapeError("points: must be one row per axis, " + std::to_string(n_axes) + " in all"));
  }
  const py::ssize_t count = points.shape(1);
  const double* x = points.data();
  const std::vector<double>& first = axes.entries.front();
  if (n_axes == 1) return places_of<2>(count, [&](py::ssize_t i) { return place_in(first, x[i]); });
  const std::vector<double>& second = axes.entries.back();
  return places_of<4>(count, [&](py::ssize_t i) { return place_in(first, second, x[i], x[count + i]); });
}

}  // namespace

void bind_tables(py::module_& m) {
  using py::arg;
  py::class_<TableAxes>(m, "TableAxes", "The axes of a table, one or two; see mgdd.maps.CalibrationMap.")
      .def(py::init(&make_axes), py::kw_only(), arg("names"), arg("entries"))
      .def("places", &find_places, arg("points"),
           "Cells around points, one row per axis, their weights, and which points lie outside of the axes.");
}

}  // namespace mgdd::bindings
