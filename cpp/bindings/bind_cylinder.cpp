// Binds engine/cylinder.hpp: the parameter records. Both are immutable in Python; `replace` makes changed copies.
#include <cstddef>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

constexpr auto fields = cylinder_fields<double>();
constexpr auto point_fields = operating_point_fields<double>();

// One keyword of __init__ per field, with the C++ default.
template <std::size_t>
using Number = double;

template <std::size_t... I>
void bind_init(py::class_<Cylinder>& cls, std::index_sequence<I...>) {
  const Cylinder d;
  cls.def(py::init([](const std::string& burn, const std::string& gamma, const std::string& wall,
                      const std::string& ignition, Number<I>... values) {
            Cylinder c;
            ((fields[I].in(c) = values), ...);
            c.burn.burn_shape = parse_burn_shape(burn);
            c.gas.gamma_model = parse_gamma_model(gamma);
            c.wall_heat.wall_heat_model = parse_wall_heat_model(wall);
            c.ignition.ignition_model = parse_ignition_model(ignition);
            validate(c);
            return c;
          }),
          py::kw_only(), py::arg("burn_shape") = std::string(to_string(d.burn.burn_shape)),
          py::arg("gamma_model") = std::string(to_string(d.gas.gamma_model)),
          py::arg("wall_heat_model") = std::string(to_string(d.wall_heat.wall_heat_model)),
          py::arg("ignition_model") = std::string(to_string(d.ignition.ignition_model)),
          (py::arg(fields[I].info.name.data()) = fields[I].in(d))...);
}

py::dict to_dict(const Cylinder& c) {
  py::dict out;
  for (const auto& f : fields)
    out[as_str(f.info.name)] = f.in(c);
  out["burn_shape"] = as_str(to_string(c.burn.burn_shape));
  out["gamma_model"] = as_str(to_string(c.gas.gamma_model));
  out["wall_heat_model"] = as_str(to_string(c.wall_heat.wall_heat_model));
  out["ignition_model"] = as_str(to_string(c.ignition.ignition_model));
  return out;
}

py::dict to_dict(const OperatingPoint& p) {
  py::dict out;
  for (const auto& f : point_fields)
    out[as_str(f.info.name)] = f.in(p);
  out["burn_duration_cad"] = p.burn_duration_cad;
  out["trapped_mass_g"] = p.trapped_mass_g;
  return out;
}

Cylinder replaced(const Cylinder& from, const py::kwargs& changes) {
  Cylinder c = from;
  for (const auto& [key, value] : changes) {
    const auto name = key.cast<std::string>();
    const auto choice = [&] { return as_name(key, value); };
    bool found = true;
    if (name == "burn_shape") {
      c.burn.burn_shape = parse_burn_shape(choice());
    } else if (name == "gamma_model") {
      c.gas.gamma_model = parse_gamma_model(choice());
    } else if (name == "wall_heat_model") {
      c.wall_heat.wall_heat_model = parse_wall_heat_model(choice());
    } else if (name == "ignition_model") {
      c.ignition.ignition_model = parse_ignition_model(choice());
    } else {
      found = false;
      for (const auto& f : fields) {
        if (f.info.name == name) f.in(c) = as_number(key, value), found = true;
      }
    }
    if (!found) unknown_field("Cylinder", key, to_dict(from));
  }
  validate(c);
  return c;
}

OperatingPoint replaced(const OperatingPoint& from, const py::kwargs& changes) {
  OperatingPoint p = from;
  for (const auto& [key, value] : changes) {
    const auto name = key.cast<std::string>();
    const auto optional = [&]() -> std::optional<double> {
      if (value.is_none()) return std::nullopt;
      return as_number(key, value);
    };
    if (name == "burn_duration_cad") {
      p.burn_duration_cad = optional();
    } else if (name == "trapped_mass_g") {
      p.trapped_mass_g = optional();
    } else {
      bool found = false;
      for (const auto& f : point_fields) {
        if (f.info.name == name) f.in(p) = as_number(key, value), found = true;
      }
      if (!found) unknown_field("OperatingPoint", key, to_dict(from));
    }
  }
  validate(p);
  return p;
}

template <class T>
void bind_record(py::class_<T>& cls, const char* name) {
  bind_parameters(
      cls, name, [](const T& self) { return to_dict(self); },
      [](const T& self, const py::kwargs& changes) { return replaced(self, changes); });
}

}  // namespace

void bind_cylinder(py::module_& m) {
  py::class_<Cylinder> cylinder(
      m, "Cylinder", R"(Parameters of one cylinder: geometry, charge, gas, wall heat, burn law, ignition delay.

Keyword-only and immutable; units stand in the names. Defaults are the preset `puma_single`.
`Cylinder.fields()` lists every field with unit, bounds, meaning and default.

Raises
------
mgdd.errors.ParameterError
    A field outside its domain, naming field, value and bound.

Examples
--------
>>> from mgdd.engine import Cylinder
>>> c = Cylinder(bore_mm=128.0, stroke_mm=144.0, connecting_rod_mm=241.5)
>>> round(c.swept_volume_l, 4)
1.853
>>> c.replace(burn_shape="wiebe").burn_shape
'wiebe'
)");
  bind_init(cylinder, std::make_index_sequence<fields.size()>{});
  for (const auto& f : fields) {
    cylinder.def_property_readonly(
        f.info.name.data(), [f](const Cylinder& c) { return f.in(c); },
        (std::string(f.info.meaning) + " [" + std::string(f.info.unit) + "]").c_str());
  }
  cylinder.def_property_readonly("burn_shape",
                                 [](const Cylinder& c) { return std::string(to_string(c.burn.burn_shape)); });
  cylinder.def_property_readonly("gamma_model",
                                 [](const Cylinder& c) { return std::string(to_string(c.gas.gamma_model)); });
  cylinder.def_property_readonly("wall_heat_model",
                                 [](const Cylinder& c) { return std::string(to_string(c.wall_heat.wall_heat_model)); });
  cylinder.def_property_readonly("ignition_model",
                                 [](const Cylinder& c) { return std::string(to_string(c.ignition.ignition_model)); });
  cylinder.def_property_readonly(
      "swept_volume_l", [](const Cylinder& c) { return Geometry<double>(c.geometry).swept_m3 / units::m3_per_l; },
      "Swept volume [L].");
  cylinder.def_property_readonly(
      "clearance_volume_l",
      [](const Cylinder& c) { return Geometry<double>(c.geometry).clearance_m3 / units::m3_per_l; },
      "Clearance volume [L].");
  cylinder.def_static(
      "fields",
      [] {
        const Cylinder d;
        py::dict out;
        for (const auto& f : fields)
          out[as_str(f.info.name)] = describe(f.info, py::float_(f.in(d)));
        out["burn_shape"] = describe_choice("triangle", {"triangle", "wiebe", "double_wiebe"}, "burn law");
        out["gamma_model"] = describe_choice("constant", {"constant", "linear", "polynomial"}, "gamma against T");
        out["wall_heat_model"] = describe_choice("woschni", {"woschni", "hohenberg"}, "wall-heat correlation");
        out["ignition_model"] = describe_choice("watson", {"watson", "wolfer", "hardenberg_hase", "polynomial"},
                                                "ignition-delay correlation");
        return out;
      },
      "Every field by name: unit, bounds or choices, meaning, default.");
  bind_record(cylinder, "Cylinder");

  py::class_<OperatingPoint> point(m, "OperatingPoint", R"(What changes from cycle to cycle: speed, fuel, intake state.

Keyword-only and immutable. `burn_duration_cad=None` is the cylinder's duration law; `trapped_mass_g=None` its
volumetric efficiency.

Raises
------
mgdd.errors.ParameterError
    A field outside its domain, naming field, value and bound.

Examples
--------
>>> from mgdd.engine import OperatingPoint
>>> OperatingPoint(speed_rpm=2000.0, fuel_mg=12.0)
OperatingPoint(speed_rpm=2000.0, fuel_mg=12.0)
)");
  const OperatingPoint d;
  point.def(py::init([](double speed, double fuel, double pressure, double temperature, std::optional<double> duration,
                        std::optional<double> mass) {
              const OperatingPoint p{speed, fuel, pressure, temperature, duration, mass};
              validate(p);
              return p;
            }),
            py::kw_only(), py::arg("speed_rpm") = d.speed_rpm, py::arg("fuel_mg") = d.fuel_mg,
            py::arg("intake_pressure_kpa") = d.intake_pressure_kpa,
            py::arg("intake_temperature_k") = d.intake_temperature_k, py::arg("burn_duration_cad") = py::none(),
            py::arg("trapped_mass_g") = py::none());
  for (const auto& f : point_fields) {
    point.def_property_readonly(
        f.info.name.data(), [f](const OperatingPoint& p) { return f.in(p); },
        (std::string(f.info.meaning) + " [" + std::string(f.info.unit) + "]").c_str());
  }
  point.def_property_readonly("burn_duration_cad", [](const OperatingPoint& p) { return p.burn_duration_cad; });
  point.def_property_readonly("trapped_mass_g", [](const OperatingPoint& p) { return p.trapped_mass_g; });
  point.def_static(
      "fields",
      [] {
        const OperatingPoint standard;
        py::dict out;
        for (const auto& f : point_fields) {
          out[as_str(f.info.name)] = describe(f.info, py::float_(f.in(standard)));
        }
        out[as_str(burn_duration_info.name)] = describe(burn_duration_info, py::none());
        out[as_str(trapped_mass_info.name)] = describe(trapped_mass_info, py::none());
        return out;
      },
      "Every field by name: unit, bounds, meaning, default.");
  bind_record(point, "OperatingPoint");
}

}  // namespace mgdd::bindings
