// Binds loop/virtual_engine.hpp: the virtual engine bench and the dynamics of its sensors.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "loop/bench_columns.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/loop/cycle_fields.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {

/// Pairs of first cycle and operating point.
template <>
struct Written<std::vector<loop::ScheduledPoint>> {
  using Argument = std::vector<std::pair<std::int64_t, engine::OperatingPoint>>;

  static Argument get(const std::vector<loop::ScheduledPoint>& schedule) {
    Argument out;
    for (const loop::ScheduledPoint& entry : schedule)
      out.emplace_back(entry.cycle, entry.point);
    return out;
  }
  static void put(std::vector<loop::ScheduledPoint>& schedule, const Argument& given, const FieldInfo&, std::size_t) {
    schedule.clear();
    for (const auto& [cycle, point] : given)
      schedule.push_back({cycle, point});
  }
};

/// Names.
template <>
struct Written<std::vector<loop::BenchInput>> {
  using Argument = std::vector<std::string>;

  static Argument get(const std::vector<loop::BenchInput>& inputs) {
    Argument out;
    for (const loop::BenchInput input : inputs)
      out.emplace_back(name_of(input));
    return out;
  }
  static void put(std::vector<loop::BenchInput>& inputs, const Argument& given, const FieldInfo& info, std::size_t) {
    inputs.clear();
    for (const std::string& name : given)
      inputs.push_back(parse_name<loop::BenchInput>(info.name, name));
  }
};

namespace {

using namespace loop;
using engine::indicator_fields;

bool steers(const BenchSettings& s, BenchInput input) {
  return std::find(s.inputs.begin(), s.inputs.end(), input) != s.inputs.end();
}

py::dict to_dict(const BenchCycle& c, const BenchSettings& s) {
  py::dict out;
  out["cycle"] = c.cycle;
  for (const auto& number : bench_cycle_numbers)
    out[as_str(number.name)] = number.of(c);
  for (std::size_t i = 1; i < s.inputs.size(); ++i)
    out[as_str(name_of(s.inputs[i]))] = c.applied[i];
  if (steers(s, BenchInput::egr)) out["intake_o2_fraction"] = c.intake_o2_fraction;
  for (const BenchFlag& flag : bench_flags)
    out[as_str(flag.name)] = c.*(flag.member);
  for (const auto& field : indicator_fields<double>())
    out[as_str(field.name)] = c.indicators.*(field.member);
  const auto components = c.component_values();
  out["components"] = to_array({components.begin(), components.end()});
  py::dict limits;
  for (std::size_t i = 0; i < c.limit_count; ++i)
    limits[as_str(s.limits[i])] = c.limit_values[i];
  out["limits"] = limits;
  return out;
}

template <class T, class Of>
py::array_t<T> column_of(const std::vector<BenchCycle>& rows, Of of) {
  py::array_t<T> out(static_cast<py::ssize_t>(rows.size()));
  T* at = out.mutable_data();
  for (const BenchCycle& row : rows)
    *at++ = of(row);
  return out;
}

template <class Of>
py::array_t<double> table_of(const std::vector<BenchCycle>& rows, std::size_t width, Of of) {
  py::array_t<double> out({static_cast<py::ssize_t>(rows.size()), static_cast<py::ssize_t>(width)});
  double* at = out.mutable_data();
  for (const BenchCycle& row : rows) {
    for (const double value : of(row))
      *at++ = value;
  }
  return out;
}

}  // namespace

py::dict bench_columns(const std::vector<BenchCycle>& rows, const BenchSettings& s) {
  py::dict out;
  out["cycle"] = column_of<std::int64_t>(rows, [](const BenchCycle& c) { return c.cycle; });
  for (const auto& number : bench_cycle_numbers)
    out[as_str(number.name)] = column_of<double>(rows, number.of);
  for (std::size_t i = 1; i < s.inputs.size(); ++i)
    out[as_str(name_of(s.inputs[i]))] = column_of<double>(rows, [i](const BenchCycle& c) { return c.applied[i]; });
  if (steers(s, BenchInput::egr))
    out["intake_o2_fraction"] = column_of<double>(rows, [](const BenchCycle& c) { return c.intake_o2_fraction; });
  for (const BenchFlag& flag : bench_flags)
    out[as_str(flag.name)] = column_of<bool>(rows, [&flag](const BenchCycle& c) { return c.*(flag.member); });
  for (const auto& field : indicator_fields<double>()) {
    out[as_str(field.name)] =
        column_of<double>(rows, [&field](const BenchCycle& c) { return c.indicators.*(field.member); });
  }
  out["components"] = table_of(rows, s.performance.size(), [](const BenchCycle& c) { return c.component_values(); });
  out["limits"] = table_of(rows, s.limits.size(), [](const BenchCycle& c) { return c.limits(); });
  return out;
}

namespace {

/// Requests cycle by cycle: the timing, and in the order of the inputs what is asked of the others.
class Requests {
 public:
  Requests(const BenchSettings& s, const InputArray& soc_cad, const std::vector<InputArray>& further) {
    require_fitting(s, further.size());
    columns_.push_back(to_column(soc_cad, "soc_cad"));
    for (std::size_t i = 0; i < further.size(); ++i) {
      const std::string name(name_of(s.inputs[i + 1]));
      columns_.push_back(to_column(further[i], name));
      if (columns_.back().size() != size()) {
        throw ShapeError(name + " has " + std::to_string(columns_.back().size()) + " entries: give one per soc_cad, " +
                         std::to_string(size()));
      }
    }
  }
  static void require_fitting(const BenchSettings& s, std::size_t further) {
    if (further < s.inputs.size()) return;
    throw ShapeError("further has " + std::to_string(further) + " entries: the bench takes " +
                     std::to_string(s.inputs.size() - 1) + " besides soc_cad");
  }

  std::size_t size() const noexcept { return columns_[0].size(); }
  std::span<const double> at(std::size_t k) noexcept {
    for (std::size_t i = 0; i < columns_.size(); ++i)
      row_[i] = columns_[i][k];
    return {row_.data(), columns_.size()};
  }

 private:
  std::vector<std::vector<double>> columns_;
  BenchInputs row_{};
};

py::dict step(BoundBench& bound, double soc_cad, const std::vector<double>& further) {
  const BenchSettings& s = bound.constant().settings();
  Requests::require_fitting(s, further.size());
  BenchInputs row{soc_cad};
  std::copy(further.begin(), further.end(), row.begin() + 1);
  return to_dict(bound.use()->step({row.data(), further.size() + 1}), s);
}

py::dict run_columns(BoundBench& bound, const InputArray& soc_cad, const std::vector<InputArray>& further) {
  Requests requests(bound.constant().settings(), soc_cad, further);
  std::vector<BenchCycle> rows;
  rows.reserve(requests.size());
  {
    const auto bench = bound.use();
    const py::gil_scoped_release release;
    for (std::size_t k = 0; k < requests.size(); ++k)
      rows.push_back(bench->step(requests.at(k)));
  }
  return bench_columns(rows, bound.constant().settings());
}

py::array_t<double> noise_free_limits(BoundBench& bound, const InputArray& soc_cad,
                                      const std::vector<std::int64_t>& cycles, const std::vector<InputArray>& further) {
  Requests requests(bound.constant().settings(), soc_cad, further);
  if (cycles.size() != requests.size()) {
    throw ShapeError("cycle has " + std::to_string(cycles.size()) + " entries: give one per soc_cad, " +
                     std::to_string(requests.size()));
  }
  for (const std::int64_t cycle : cycles) {
    if (cycle < 0) throw ParameterError("cycle", cycle, "must be >= 0");
  }
  const std::size_t width = bound.constant().settings().limits.size();
  py::array_t<double> out({static_cast<py::ssize_t>(requests.size()), static_cast<py::ssize_t>(width)});
  double* at = out.mutable_data();
  const auto bench = bound.use();
  const py::gil_scoped_release release;
  for (std::size_t k = 0; k < requests.size() && width > 0; ++k)
    at = std::copy_n(bench->noise_free_limits(cycles[k], requests.at(k)).begin(), width, at);
  return out;
}

double checked_speed(double speed_rpm) {
  require_within("speed_rpm", speed_rpm, 0.0, 1e5, "rpm");
  return speed_rpm;
}

void bind_dynamics(py::module_& m) {
  using py::arg;
  py::class_<SensorDynamics> dynamics(m, "SensorDynamics",
                                      R"(Transport delay, first-order lag and noise of a gas sensor.

Parameters
----------
delay_s : float
    Transport delay of the sample line [s], in [0, 60].
lag_s : float
    Time constant [s], in [0, 60]; t10-90 is 2.2 times it.
noise_fraction : float
    Standard deviation of a reading over the reading [-], in [0, 0.2].
delay_cycles : int, optional
    Delay in engine cycles instead; it does not follow the speed.
lag_cycles : float, optional
    Time constant in engine cycles instead.

Raises
------
mgdd.errors.ParameterError
    A value outside its domain.

Examples
--------
>>> from mgdd.loop import SensorDynamics
>>> SensorDynamics(delay_s=3.0, lag_s=2.0).delay_at(1500.0)
38
)");
  bind_record(dynamics, "SensorDynamics", [](const SensorDynamics& made) { validate("sensor", made); });
  dynamics
      .def(
          "delay_at",
          [](const SensorDynamics& self, double speed_rpm) { return self.delay_at(checked_speed(speed_rpm)); },
          arg("speed_rpm"), "Delay in whole cycles at a speed.")
      .def(
          "gain_at",
          [](const SensorDynamics& self, double speed_rpm) { return self.gain_at(checked_speed(speed_rpm)); },
          arg("speed_rpm"), "Gain of the lag filter per cycle [-].");
}

}  // namespace

void bind_virtual_engine(py::module_& m) {
  using py::arg;
  bind_dynamics(m);
  py::list limits;
  for (const BenchLimit& limit : bench_limits)
    limits.append(as_str(limit.name));
  m.attr("bench_limits") = py::tuple(limits);  // besides indicators and the COV of IMEP
  py::list inputs;
  for (const auto& [input, name] : names<BenchInput>())
    inputs.append(as_str(name));
  m.attr("bench_inputs") = py::tuple(inputs);
  using B = BoundBench;
  py::class_<B> cls(m, "VirtualEngine", "The virtual engine bench; use mgdd.loop.VirtualEngine.");
  const Members& members = members_of(fields_of(BenchSettings{}), BenchSettings{});
  bind_keywords<BenchSettings>(cls, members,
                               [](const BenchSettings& s) { return B("VirtualEngine", VirtualEngine(s)); });
  cls.def_static(
         "fields", [&members] { return members.described(); },
         "Every setting by name: unit, bounds or choices, meaning, default.")
      .def(
          "step", &step, arg("soc_cad"), arg("further") = py::tuple(),
          "Run one cycle: what was measured, by name. `further` are the other inputs in their order; what is left out\n"
          "stays.")
      .def("run_columns", &run_columns, arg("soc_cad"), arg("further") = py::tuple(),
           "Run one cycle per request, without the GIL: columns by name. `further` are columns of the other inputs.")
      .def(
          "noise_free_limits", &noise_free_limits, arg("soc_cad"), arg("cycle"), arg("further") = py::tuple(),
          "Limited quantities without scatter, noise and misfire, drift included: one row per request and its cycle, "
          "in\n"
          "the order of limit_names; the true steady NOx for every sensor. NaN for the COV of IMEP, which has no such\n"
          "value. The bench itself does not run. `further` are columns of the other inputs.")
      .def(
          "reset",
          [](B& b, std::optional<std::uint64_t> seed) {
            const auto bench = b.use();
            bench->reset(seed.value_or(bench->seed()));
          },
          arg("seed") = py::none(), "Back to cycle 0, with another seed if given.")
      .def(
          "pressure_columns",
          [](B& b) {
            const auto bench = b.use();
            const loop::PressureTrace trace = bench->pressure();
            return std::pair(to_array({trace.angle_cad.begin(), trace.angle_cad.end()}),
                             to_array({trace.pressure_bar.begin(), trace.pressure_bar.end()}));
          },
          "Angles and pressure of the last cycle as the sensor reads them; both empty before the first.")
      .def_property(
          "state", [](const B& b) { return save_state(*b.use()); },
          [](B& b, const StateColumns& state) { restore_state(*b.use(), state); },
          "State of the run between two cycles: named lists of numbers, JSON-able. Setting it continues that\n"
          "run bit for bit; a state of another bench raises ParameterError and changes nothing.")
      .def(
          "point_at", [](const B& b, std::int64_t cycle) { return b.constant().point_at(cycle); }, arg("cycle"),
          "Operating point of a cycle.")
      .def_property_readonly(
          "point", [](const B& b) { return b.use()->point(); }, "Operating point of the next cycle.")
      .def_property_readonly(
          "cycle", [](const B& b) { return b.use()->cycle(); }, "Index of the next cycle.")
      .def_property_readonly(
          "operating_point_changes",
          [](const B& b) {
            const auto bench = b.use();
            return bench->point_changes_at(bench->cycle());
          },
          "Whether speed or fuel of the next cycle differ by more than 5 % from those of the last one.")
      .def_property_readonly(
          "seed", [](const B& b) { return b.use()->seed(); }, "Seed of the run.")
      .def_property_readonly(
          "window_cad", [](const B& b) { return b.constant().window_cad(); },
          "Earliest and latest SOC that is not clamped.")
      .def_property_readonly(
          "input_bounds",
          [](const B& b) {
            const VirtualEngine& bench = b.constant();
            py::dict out;
            for (std::size_t i = 0; i < bench.windows().size(); ++i) {
              const auto [least, greatest] = bench.windows()[i];
              out[as_str(name_of(bench.settings().inputs[i]))] = py::make_tuple(least, greatest);
            }
            return out;
          },
          "Least and greatest value of each input that is not clamped, by name.")
      .def_property_readonly(
          "analyser_delay_cycles", [](const B& b) { return b.use()->analyser_delay_cycles(); },
          "Delay of the analyser at the next cycle.")
      .def_property_readonly(
          "analyser_gain", [](const B& b) { return b.use()->analyser_gain(); },
          "Gain of the analyser's lag filter at the next cycle [-].")
      .def_property_readonly(
          "settings", [&members](const B& b) { return members.to_dict(&b.constant().settings()); },
          "Constructor keywords as a new dict.")
      .def("__repr__",
           [](const B& b) {
             const std::int64_t cycle = b.use()->cycle();
             return py::str("<VirtualEngine at cycle {}, {!r}>").format(cycle, b.constant().point_at(cycle));
           })
      .def(py::pickle(
          [&members](const B& b) {
            const StateColumns state = save_state(*b.use());
            return py::make_tuple(1, members.to_dict(&b.constant().settings()), state);
          },
          [](const py::tuple& state) {
            require_pickle_version(state);
            const auto columns = state[2].cast<StateColumns>();
            const py::object made = py::type::of<B>()(**state[1].cast<py::dict>());
            B& bench = made.cast<B&>();
            restore_state(*bench.use(), columns);
            return std::move(bench);
          }));
}

}  // namespace mgdd::bindings
