// Binds engine/cylinder.hpp: the parameter records. Both are immutable in Python; `replace` makes changed copies.
#include <tuple>

#include "binding.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

using C = Cylinder;
using Op = OperatingPoint;

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
  constexpr auto fields = cylinder_fields<double>();
  bind_record<fields.size()>(
      cylinder, "Cylinder", fields,
      std::tuple{
          named("burn_shape", Path{&C::burn, &BurnParameters<double>::burn_shape}, &burn_shape_names, "burn law"),
          named("gamma_model", Path{&C::gas, &GasParameters<double>::gamma_model}, &gamma_model_names,
                "gamma against T"),
          named("wall_heat_model", Path{&C::wall_heat, &WallHeatParameters<double>::wall_heat_model},
                &wall_heat_model_names, "wall-heat correlation"),
          named("ignition_model", Path{&C::ignition, &IgnitionParameters<double>::ignition_model},
                &ignition_model_names, "ignition-delay correlation")});
  cylinder.def_property_readonly(
      "swept_volume_l", [](const Cylinder& c) { return Geometry<double>(c.geometry).swept_m3 / units::m3_per_l; },
      "Swept volume [L].");
  cylinder.def_property_readonly(
      "clearance_volume_l",
      [](const Cylinder& c) { return Geometry<double>(c.geometry).clearance_m3 / units::m3_per_l; },
      "Clearance volume [L].");

  py::class_<OperatingPoint> point(m, "OperatingPoint", R"(What changes from cycle to cycle: speed, fuel, intake state.

Keyword-only and immutable. `burn_duration_cad=None` is the cylinder's duration law. Without `trapped_mass_g` the mass
is p V/(R T) at IVC where `ivc_temperature_k` is given, else a simulation takes the volumetric efficiency, and a
measured trace p V/(R T) with the intake temperature + 40 K.

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
  constexpr auto point_fields = operating_point_fields<double>();
  bind_record<point_fields.size()>(point, "OperatingPoint", point_fields,
                                   std::tuple{open_number(burn_duration_info, &Op::burn_duration_cad),
                                              open_number(trapped_mass_info, &Op::trapped_mass_g),
                                              open_number(ivc_temperature_info, &Op::ivc_temperature_k)});
}

}  // namespace mgdd::bindings
