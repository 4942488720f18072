// Binds engine/cylinder.hpp: the parameter records. Both are immutable in Python; `replace` makes changed copies.

#include "binding.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
using namespace engine;

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
  bind_record(cylinder, "Cylinder");
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
  bind_record(point, "OperatingPoint");
}

}  // namespace mgdd::bindings
