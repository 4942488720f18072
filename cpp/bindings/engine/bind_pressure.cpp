// Binds engine/pressure: the analysis of measured pressure, one cycle or many, and the check of a trace.
#include <algorithm>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/engine/pressure/indicating.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "mgdd/engine/pressure/trace_check.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

// The traces of an analysis over crank angle, by name.
std::vector<std::pair<const char*, std::vector<double>>> columns(const TraceAnalysis& a) {
  return {{"pressure_bar", a.pressure_bar},
          {"temperature_k", a.temperature_k},
          {"heat_release_net_j_per_cad", a.heat_release_net_j_per_cad()},
          {"heat_release_gross_j_per_cad", a.heat_release_gross_j_per_cad()},
          {"heat_loss_j_per_cad", a.heat_loss_j_per_cad()},
          {"heat_net_cumulative_j", a.heat_net_cumulative_j},
          {"heat_gross_cumulative_j", a.heat_gross_cumulative_j}};
}

// One figure of many records.
template <class Record>
py::array_t<double> column_of(const std::vector<Record>& all, const Figure<Record>& figure) {
  std::vector<double> out(all.size());
  std::transform(all.begin(), all.end(), out.begin(), [&](const Record& one) { return one.*(figure.member); });
  return to_array(out);
}

// The texts, and the kind of each.
void add_warnings(py::dict& out, const std::vector<TraceWarning>& warnings) {
  std::vector<std::string> texts, kinds;
  for (const TraceWarning& warning : warnings)
    texts.push_back(warning.text), kinds.emplace_back(warning.kind);
  out["warnings"] = texts;
  out["doubts"] = kinds;
}

// What does not differ from cycle to cycle of one record.
py::dict common_part(const TraceAnalysis& a) {
  py::dict out;
  out["crank_angle_cad"] = to_array(a.angle_cad);
  out["volume_l"] = to_array(a.volume_l);
  out["mass_source"] = a.mass_source;
  out["smoothing"] = a.smoothing;
  return out;
}

py::dict bind_analyze(const InputArray& angle, const InputArray& pressure, const Cylinder& cylinder,
                      const OperatingPoint& point, const TraceOptions& options) {
  const std::vector<double> angles = to_column(angle, "crank_angle_cad");
  const std::vector<double> pressures = to_column(pressure, "pressure_bar");
  const TraceAnalysis a = without_gil([&] { return analyze_trace(angles, pressures, cylinder, point, options); });
  py::dict out = common_part(a);
  for (const auto& [name, column] : columns(a))
    out[name] = to_array(column);
  py::dict scalars;
  for (const Figure<TraceAnalysis>& figure : trace_figures)
    scalars[as_str(figure.name)] = a.*(figure.member);
  out["scalars"] = scalars;
  out["motored"] = a.motored;
  out["window_found"] = a.window_found;
  add_warnings(out, a.warnings);
  return out;
}

// Rows are cycles.
py::dict bind_analyze_cycles(const InputArray& angle, const InputArray& pressure, const Cylinder& cylinder,
                             const OperatingPoint& point, const TraceOptions& options, bool traces,
                             std::size_t threads) {
  const std::vector<double> angles = to_column(angle, "crank_angle_cad");
  if (pressure.ndim() != 2 || static_cast<std::size_t>(pressure.shape(1)) != angles.size())
    throw about("pressure_bar", ShapeError("pressure_bar must have one row per cycle, with a sample per crank angle"));
  const std::span<const double> record{pressure.data(), static_cast<std::size_t>(pressure.size())};
  const std::vector<TraceAnalysis> all =
      without_gil([&] { return analyze_cycles(angles, record, cylinder, point, options, traces, threads); });
  py::dict out = common_part(all.front());
  const auto n = static_cast<py::ssize_t>(all.size()), samples = static_cast<py::ssize_t>(all.front().angle_cad.size());
  for (std::size_t c = 0; traces && c < all.size(); ++c) {
    for (const auto& [name, column] : columns(all[c])) {
      if (c == 0) out[name] = py::array_t<double>({n, samples});
      auto matrix = out[name].cast<py::array_t<double>>();
      std::copy(column.begin(), column.end(), matrix.mutable_data(static_cast<py::ssize_t>(c), 0));
    }
  }
  py::dict scalars;
  for (const Figure<TraceAnalysis>& figure : trace_figures) {
    scalars[as_str(figure.name)] = column_of(all, figure);
  }
  out["scalars"] = scalars;
  py::list motored, found;
  for (const TraceAnalysis& a : all)
    motored.append(a.motored), found.append(a.window_found);
  out["motored"] = motored;
  out["window_found"] = found;
  add_warnings(out, count_warnings(all));
  return out;
}

// Keeps the workspace of one stream of cycles beside the constant part.
struct Stream {
  Indicating indicating;
  Indicating::Workspace work;
};

std::span<const double> samples_of(const Indicating& indicating, const InputArray& pressure) {
  const auto width = static_cast<std::size_t>(pressure.ndim() > 0 ? pressure.shape(pressure.ndim() - 1) : 0);
  if (width != indicating.samples()) {
    throw about("pressure_bar", ShapeError("pressure_bar has " + std::to_string(width) + " samples per cycle, and " +
                                           std::to_string(indicating.samples()) + " angles were given"));
  }
  return {pressure.data(), static_cast<std::size_t>(pressure.size())};
}

py::dict one_cycle(Stream& s, const InputArray& pressure) {
  const std::span<const double> samples = samples_of(s.indicating, pressure);
  if (pressure.ndim() != 1) throw about("pressure_bar", ShapeError("pressure_bar must be the samples of one cycle"));
  const CycleFigures figures = s.indicating(samples.data(), s.work);
  if (!(figures.p_max_bar <= highest_pressure_bar))
    check_trace(s.indicating.angle_cad(), {samples.begin(), samples.end()});
  py::dict out;
  for (const Figure<CycleFigures>& figure : cycle_figures)
    out[as_str(figure.name)] = figures.*(figure.member);
  return out;
}

py::dict many_cycles(const Stream& s, const InputArray& pressure, std::size_t threads) {
  const std::span<const double> samples = samples_of(s.indicating, pressure);
  const std::vector<CycleFigures> all = without_gil([&] { return indicate_cycles(s.indicating, samples, threads); });
  const std::vector<py::ssize_t> shape(pressure.shape(), pressure.shape() + pressure.ndim() - 1);
  py::dict out;
  for (const Figure<CycleFigures>& figure : cycle_figures)
    out[as_str(figure.name)] = column_of(all, figure).reshape(shape);
  return out;
}

py::dict oscillation(Stream& s, const InputArray& pressure) {
  const std::span<const double> samples = samples_of(s.indicating, pressure);
  const auto [first, last] = s.indicating.knock_samples();
  const std::size_t cycles = samples.size() / s.indicating.samples();
  py::array_t<double> sound({static_cast<py::ssize_t>(cycles), static_cast<py::ssize_t>(last - first)});
  for (std::size_t c = 0; c < cycles; ++c) {
    const auto one = s.indicating.oscillation(samples.data() + c * s.indicating.samples(), s.work);
    std::copy(one.begin(), one.end(), sound.mutable_data() + c * (last - first));
  }
  const auto& angle = s.indicating.angle_cad();
  py::dict out;
  out["crank_angle_cad"] =
      to_array({angle.begin() + static_cast<std::ptrdiff_t>(first), angle.begin() + static_cast<std::ptrdiff_t>(last)});
  out["pressure_bar"] = sound;
  return out;
}

}  // namespace

void bind_pressure(py::module_& m) {
  using py::arg;
  using O = TraceOptions;
  py::class_<O> options(m, "TraceOptions");
  bind_keywords<O>(options, members_of(fields_of(O{}), O{}), [](O made) { return made; });
  m.def("analyze", &bind_analyze, arg("crank_angle_cad"), arg("pressure_bar"), arg("cylinder"), arg("point"),
        arg("options"), "Pegging, heat release, burn angles, work.");
  m.def("analyze_cycles", &bind_analyze_cycles, arg("crank_angle_cad"), arg("pressure_bar"), arg("cylinder"),
        arg("point"), arg("options"), arg("traces") = true, arg("threads") = 0,
        "The same of every row; warnings counted together.");
  py::class_<Stream>(m, "Indicating")
      .def(py::init([](const InputArray& angle, const Cylinder& cylinder, double speed_rpm, const O& how) {
             const std::vector<double> angles = to_column(angle, "crank_angle_cad");
             check_trace(angles, std::vector<double>(angles.size(), 1.0));
             Indicating made(angles, cylinder, speed_rpm, how);
             Indicating::Workspace work = made.make_workspace();
             return Stream{std::move(made), std::move(work)};
           }),
           arg("crank_angle_cad"), arg("cylinder"), arg("speed_rpm"), arg("options"))
      .def("one", &one_cycle, arg("pressure_bar"), "Figures of one cycle.")
      .def("many", &many_cycles, arg("pressure_bar"), arg("threads") = 0,
           "Figures of cycles, the last axis its angles.")
      .def("oscillation", &oscillation, arg("pressure_bar"), "Pressure in the band of knock.");
  m.def(
      "check_trace",
      [](const InputArray& angle, const InputArray& pressure) {
        const std::vector<double> angles = to_column(angle, "crank_angle_cad");
        const std::vector<double> pressures = to_column(pressure, "pressure_bar");
        const py::gil_scoped_release release;
        check_trace(angles, pressures);
      },
      arg("crank_angle_cad"), arg("pressure_bar"), "DataError unless the trace can be analysed.");
}

}  // namespace mgdd::bindings
