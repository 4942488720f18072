// Binds throttle/demand: the map of the pedal, the parameters of the chain with its equations over arrays, the chain
// and the manifold sample by sample.
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/throttle/demand/demand_chain.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace throttle;

constexpr double g = units::kg_per_g, kpa = units::pa_per_kpa, mm2 = units::m_per_mm * units::m_per_mm;
constexpr double deg = units::rad_per_deg;
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// An argument of an equation, with the numbers that it may take.
struct Argument {
  const char* name;
  Domain domain;
  std::string_view unit;

  double checked(double value) const {
    require_in(domain, name, value, unit);
    return value;
  }
};
constexpr Argument pedal{"pedal_percent", closed(0.0, 100.0), "%"};
constexpr Argument speed_field{"speed_rpm", above(0.0, 50000.0), "rpm"};
constexpr Argument torque_field{"torque_nm", closed(-1e5, 1e5), "N m"};
constexpr Argument air_field{"air_g_per_s", closed(0.0, 1e6), "g/s"};
constexpr Argument pressure{"pressure_kpa", closed(0.0, 1e4), "kPa"};
constexpr Argument angle_field{"angle_deg", closed(0.0, 90.0), "deg"};
constexpr Argument area{"area_mm2", closed(0.0, 1e6), "mm²"};

py::tuple as_tuple(std::span<const double> values) {
  py::tuple out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    out[i] = values[i];
  return out;
}

py::tuple rows_of(const PedalMap& map) {
  py::tuple out(map.pedal_percent.size());
  const std::size_t columns = map.speed_rpm.size();
  for (std::size_t i = 0; i < map.pedal_percent.size(); ++i)
    out[i] = as_tuple(std::span(map.wanted_nm).subspan(i * columns, columns));
  return out;
}

PedalMap checked_map(std::vector<double> pedals, std::vector<double> speeds, std::vector<double> wanted) {
  PedalMap map{std::move(pedals), std::move(speeds), std::move(wanted)};
  validate(map);
  return map;
}

PedalMap map_of_rows(const InputArray& pedal_percent, const InputArray& speed_rpm, const InputArray& wanted_nm) {
  if (wanted_nm.ndim() != 2 || wanted_nm.shape(0) != pedal_percent.size() || wanted_nm.shape(1) != speed_rpm.size()) {
    throw about("wanted_nm",
                ShapeError("wanted_nm must have a row per pedal and a column per speed, " +
                           std::to_string(pedal_percent.size()) + " x " + std::to_string(speed_rpm.size())));
  }
  return checked_map(to_column(pedal_percent, "pedal_percent"), to_column(speed_rpm, "speed_rpm"),
                     {wanted_nm.data(), wanted_nm.data() + wanted_nm.size()});
}

PedalMap map_of_full_load(const InputArray& speed_rpm, const InputArray& full_load_nm,
                          const std::optional<InputArray>& pedal_percent) {
  std::vector<double> speeds = to_column(speed_rpm, "speed_rpm");
  std::vector<double> pedals = pedal_percent ? to_column(*pedal_percent, "pedal_percent") : PedalMap{}.pedal_percent;
  std::vector<double> wanted = progressive_torque_nm(pedals, speeds, to_column(full_load_nm, "full_load_nm"));
  return checked_map(std::move(pedals), std::move(speeds), std::move(wanted));
}

void bind_pedal_map(py::module_& m) {
  py::class_<PedalMap> cls(m, "PedalMap",
                           R"(What the driver wants: engine torque over pedal and speed, a table read bilinearly.

Immutable. Outside of the axes the edge holds. `of_full_load` makes a progressive one of a full-load curve.

Parameters
----------
pedal_percent : array_like, shape (n,)
    Pedal [%], two or more increasing entries in 0 to 100.
speed_rpm : array_like, shape (m,)
    Engine speed [rpm], two or more increasing entries > 0.
wanted_nm : array_like, shape (n, m)
    Torque at the crankshaft [N m], which does not fall with the pedal; negative where the released pedal brakes.

Raises
------
mgdd.errors.ParameterError, mgdd.errors.ShapeError
    An axis or entry that cannot be, by name.

Examples
--------
>>> from mgdd.throttle import PedalMap
>>> sport = PedalMap(pedal_percent=[0, 50, 100], speed_rpm=[1000, 5000], wanted_nm=[[-5, -9], [80, 70], [120, 105]])
>>> float(sport.torque_nm(75.0, 1000.0))
100.0
>>> PedalMap.of_full_load([1000.0, 6000.0], [120.0, 105.0]).torque_nm([0.0, 100.0], 6000.0).tolist()
[-10.5, 105.0]
)");
  cls.def(py::init(&map_of_rows), py::kw_only(), py::arg("pedal_percent"), py::arg("speed_rpm"), py::arg("wanted_nm"));
  cls.def_static("of_full_load", &map_of_full_load, py::arg("speed_rpm"), py::arg("full_load_nm"), py::kw_only(),
                 py::arg("pedal_percent") = py::none(),
                 "A progressive map: with M the full-load torque and p the pedal 0 to 1, ``M (0.6 p + 0.4 p²) - 0.1 M "
                 "(1 - p) N/N_last``.\n\nThe pedal's axis is that of the default map if left out.");
  cls.def_property_readonly(
      "pedal_percent", [](const PedalMap& map) { return as_tuple(map.pedal_percent); }, "Pedal [%].");
  cls.def_property_readonly("speed_rpm", [](const PedalMap& map) { return as_tuple(map.speed_rpm); }, "Speed [rpm].");
  cls.def_property_readonly("wanted_nm", &rows_of, "Torque [N m], a row per pedal.");
  bind_value(cls, "PedalMap", [](const PedalMap& map) {
    py::dict out;
    out["pedal_percent"] = as_tuple(map.pedal_percent);
    out["speed_rpm"] = as_tuple(map.speed_rpm);
    out["wanted_nm"] = rows_of(map);
    return out;
  });
  cls.def(
      "torque_nm",
      [](const PedalMap& map, const InputArray& pedals, const InputArray& speeds) {
        return elementwise([&](double p, double n) { return map.torque_nm(pedal.checked(p), speed_field.checked(n)); },
                           pedals, speeds);
      },
      py::arg("pedal_percent"), py::arg("speed_rpm"), "Wanted torque [N m]; arrays are broadcast together.");
}

/// An equation of the chain over arrays.
template <class F>
void equation(py::class_<DemandChain>& cls, const char* name, const Argument& x, F f, const char* doc) {
  cls.def(
      name,
      [x, f](const DemandChain& chain, const InputArray& first) {
        return elementwise([&, prepared = f(chain)](double a) { return prepared(x.checked(a)); }, first);
      },
      py::arg(x.name), doc);
}
template <class F>
void equation(py::class_<DemandChain>& cls, const char* name, const Argument& x, const Argument& y, F f,
              const char* doc) {
  cls.def(
      name,
      [x, y, f](const DemandChain& chain, const InputArray& first, const InputArray& second) {
        return elementwise(
            [&, prepared = f(chain)](double a, double b) { return prepared(x.checked(a), y.checked(b)); }, first,
            second);
      },
      py::arg(x.name), py::arg(y.name), doc);
}

using Chain = DemandChain;

void bind_equations(py::class_<Chain>& cls) {
  equation(
      cls, "air_g_per_s", torque_field, speed_field,
      [](const Chain& c) { return [&c](double nm, double n) { return c.torque.air_kg_per_s(nm, n) / g; }; },
      "Air that makes a torque [g/s]; 0 where friction alone brakes more.");
  equation(
      cls, "torque_nm", air_field, speed_field,
      [](const Chain& c) { return [&c](double m, double n) { return c.torque.torque_nm(m * g, n); }; },
      "Torque that an air flow makes [N m].");
  equation(
      cls, "pressure_kpa", air_field, speed_field,
      [](const Chain& c) { return [&c](double m, double n) { return m * g / c.air.pumping_kg_per_s_pa(n) / kpa; }; },
      "Manifold pressure at which the cylinders take an air flow [kPa], by speed density.");
  equation(
      cls, "cylinder_g_per_s", pressure, speed_field,
      [](const Chain& c) { return [&c](double p, double n) { return c.air.pumping_kg_per_s_pa(n) * p * kpa / g; }; },
      "Air that the cylinders take at a manifold pressure [g/s], by speed density.");
  equation(
      cls, "filling_time_s", speed_field,
      [](const Chain& c) { return [&c](double n) { return c.air.filling_time_s(n); }; },
      "Time constant of the manifold where the throttle is choked [s].");
  equation(
      cls, "area_mm2", angle_field,
      [](const Chain& c) { return [plate = PlateOpening(c.bore)](double a) { return plate.area_m2(a * deg) / mm2; }; },
      "Open area of the throttle with its leak [mm²].");
  equation(
      cls, "angle_of_area_deg", area,
      [](const Chain& c) {
        return [plate = PlateOpening(c.bore)](double a) { return plate.angle_of_area_rad(a * mm2) / deg; };
      },
      "Smallest opening of at least that area [deg]; 0 or 90 beyond its range.");
  equation(
      cls, "throttle_g_per_s", angle_field, pressure,
      [](const Chain& c) {
        return [plate = Manifold(c.air, c.bore, 1e-3)](double a, double p) {
          return plate.throttle_kg_per_s(a, p * kpa) / g;
        };
      },
      "Air through the throttle against a manifold pressure [g/s]; negative above the ambient one.");
  equation(
      cls, "opening_deg", air_field, pressure,
      [](const Chain& c) {
        return [model = DemandModel(c)](double m, double p) { return model.opening_deg(m * g, p * kpa, p * kpa); };
      },
      "Opening that lets an air flow through against a manifold pressure [deg].");
  equation(
      cls, "steady_kpa", angle_field, speed_field,
      [](const Chain& c) {
        return
            [manifold = Manifold(c.air, c.bore, 1e-3)](double a, double n) { return manifold.steady_pa({a, n}) / kpa; };
      },
      "Manifold pressure at which a held opening ends [kPa].");
}

void bind_chain(py::module_& m) {
  py::class_<Chain> cls(m, "DemandChain", "Parameters of the chain; see mgdd.throttle.DemandChain.");
  bind_record(cls, "DemandChain");
  bind_equations(cls);
  cls.def(
      "_steady",
      [](const Chain& chain, const InputArray& pedals, const InputArray& speeds) {
        const std::vector<double> p = to_column(pedals, "pedal_percent"), n = to_column(speeds, "speed_rpm");
        if (p.size() != n.size()) throw ShapeError("pedal_percent and speed_rpm have different lengths");
        const DemandModel model(chain);
        std::vector<double> torques, flows, pressures, openings;
        for (std::size_t i = 0; i < p.size(); ++i) {
          const Demand demand = model.steady(pedal.checked(p[i]), speed_field.checked(n[i]));
          torques.push_back(demand.torque_nm);
          flows.push_back(demand.air_kg_per_s / g);
          pressures.push_back(demand.pressure_pa / kpa);
          openings.push_back(demand.opening_deg);
        }
        return py::make_tuple(to_array(torques), to_array(flows), to_array(pressures), to_array(openings));
      },
      py::arg("pedal_percent"), py::arg("speed_rpm"), "Torque, air, pressure and opening of steady demands.");
}

void bind_tracker(py::module_& m) {
  py::class_<DemandTracker>(m, "DemandTracker", "The chain sample by sample; see mgdd.throttle.DemandChain.tracker.")
      .def(py::init<const Chain&, double>(), py::arg("chain"), py::kw_only(), py::arg("sample_s"))
      .def(
          "step",
          [](DemandTracker& tracker, double pedal_percent, double speed_rpm, double pressure_kpa) {
            const TrackedDemand out = tracker.step(pedal_percent, speed_rpm, pressure_kpa * kpa);
            py::dict named;
            named["torque_nm"] = out.torque_nm;
            named["pressure_kpa"] = out.pressure_pa / kpa;
            named["air_g_per_s"] = out.air_kg_per_s / g;
            named["opening_deg"] = out.opening_deg;
            named["reference_deg"] = out.reference_deg;
            return named;
          },
          py::arg("pedal_percent"), py::arg("speed_rpm"), py::arg("pressure_kpa") = unknown,
          "Demand and reference of this sample, by name.\n\nNaN repeats the last value; without any measured pressure "
          "yet it is the wanted one. The first demand is taken as steady.")
      .def("take_over", &DemandTracker::take_over, py::arg("reference_deg"),
           "The next reference goes on from this angle, at the allowed rate.\n\nIgnored if it is not finite.")
      .def("reset", &DemandTracker::reset, "As made: no demand yet.")
      .def_property_readonly("sample_s", &DemandTracker::sample_s, "Time between samples [s].")
      .def_property(
          "state", [](const DemandTracker& tracker) { return save_state(tracker); },
          [](DemandTracker& tracker, const StateColumns& columns) { restore_state(tracker, columns); },
          "What a run needs to go on bit for bit.");
}

void bind_manifold(py::module_& m) {
  m.def(
      "fill_manifold",
      [](const Chain& chain, double pressure_kpa, double angle_deg, double speed_rpm, double sample_s) {
        Manifold::State state{pressure_kpa * kpa};
        const ManifoldFlows flows = Manifold(chain.air, chain.bore, sample_s).flows(state, {angle_deg, speed_rpm});
        return std::tuple(state.pressure_pa / kpa, flows.throttle_kg_per_s / g, flows.cylinder_kg_per_s / g);
      },
      py::arg("chain"), py::arg("pressure_kpa"), py::arg("angle_deg"), py::arg("speed_rpm"), py::kw_only(),
      py::arg("sample_s"), "Pressure [kPa] after a sample, and the mean flows through throttle and cylinders [g/s].");
}

}  // namespace

void bind_demand(py::module_& m) {
  bind_pedal_map(m);
  bind_chain(m);
  bind_tracker(m);
  bind_manifold(m);
}

}  // namespace mgdd::bindings
