// Binds engine/emissions.hpp and thermal_no.hpp: NOx proxy, NOx model, soft sensor, the fit to a sweep, thermal NO.
#include <span>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/engine/emissions.hpp"
#include "mgdd/engine/thermal_no.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace engine;

NoxFit fit(const InputArray& t_max_k, const InputArray& nox_ppm, const std::string& map, double reference_k) {
  const std::vector<double> t = to_column(t_max_k, "t_max_k"), nox = to_column(nox_ppm, "nox_ppm");
  const NoxMap form = parse_name<NoxMap>("map", map);
  const py::gil_scoped_release release;
  return fit_nox_proxy(t, nox, form, reference_k);
}

void bind_proxy(py::module_& m) {
  using py::arg;
  py::class_<NoxProxy> proxy(m, "NoxProxy",
                             R"(NOx proxy from the maximum bulk gas temperature: a correlation to be fitted.

Two maps with equal slope at the reference: affine-log, NOx0 exp(b/T0^2 (T - T0)), and Arrhenius,
NOx0 exp(-b (1/T - 1/T0)). Valid at fixed intake oxygen only; the defaults are plausible, not of any engine.

Parameters
----------
reference_temperature_k : float
    T0 [K].
reference_nox_ppm : float
    NOx0, at T0 [ppm].
activation_temperature_k : float
    b [K].

Raises
------
mgdd.errors.ParameterError
    A constant that is not > 0.

Examples
--------
>>> from mgdd.engine import NoxProxy
>>> float(NoxProxy().arrhenius_ppm(1900.0))
1200.0
)");
  bind_record(proxy, "NoxProxy");
  proxy
      .def(
          "affine_log_ppm",
          [](const NoxProxy& self, const InputArray& t) {
            return elementwise([&self](double x) { return self.affine_log_ppm(x); }, t);
          },
          arg("t_max_k"), "NOx [ppm] by the affine-log map.")
      .def(
          "arrhenius_ppm",
          [](const NoxProxy& self, const InputArray& t) {
            return elementwise([&self](double x) { return self.arrhenius_ppm(x); }, t);
          },
          arg("t_max_k"), "NOx [ppm] by the Arrhenius map.");
}

py::dict thermal_no_of(const InputArray& angle, const InputArray& pressure, const InputArray& volume,
                       const InputArray& temperature, const InputArray& burned, const Cylinder& cylinder,
                       const OperatingPoint& point, const ThermalNo& model) {
  const std::vector<double> a = to_column(angle, "crank_angle_cad"), p = to_column(pressure, "pressure_bar"),
                            v = to_column(volume, "volume_l"), t = to_column(temperature, "temperature_k"),
                            b = to_column(burned, "burned_fraction");
  const ThermalNoCycle c = without_gil([&] { return thermal_no(a, p, v, t, b, cylinder, point, model); });
  py::dict out;
  out["nox_ppm"] = c.nox_ppm;
  out["nox_g_per_kwh"] = c.nox_g_per_kwh;
  out["lambda_global"] = c.lambda_global;
  out["flame_max_k"] = c.flame_max_k;
  out["no_ppm"] = to_array(c.no_ppm);
  out["flame_k"] = to_array(c.flame_k);
  out["unburned_k"] = to_array(c.unburned_k);
  return out;
}

}  // namespace

void bind_emissions(py::module_& m) {
  using py::arg;
  bind_proxy(m);

  py::class_<NoxModel> model(m, "NoxModel",
                             R"(NOx of one cycle from its maximum bulk gas temperature and the intake oxygen.

NOx = map(T_max) (x_O2 / 0.209)^n: a `NoxProxy` with the map that is used.

Parameters
----------
proxy : NoxProxy
    Constants of the map.
map : {"affine_log", "arrhenius"}
    Form of the map.
intake_o2_fraction : float
    Oxygen in the intake by volume [-]; 0.209 is air without exhaust gas recirculation.
o2_exponent : float
    n [-], 2 to 4, to be fitted.

Raises
------
mgdd.errors.ParameterError
    An unknown map, or a value outside its domain.

Examples
--------
>>> from mgdd.engine import NoxModel
>>> float(NoxModel(intake_o2_fraction=0.1045).ppm(1900.0))
150.0
)");
  bind_record(model, "NoxModel");
  model.def(
      "ppm",
      [](const NoxModel& self, const InputArray& t) {
        return elementwise([&self](double x) { return self.ppm(x); }, t);
      },
      arg("t_max_k"), "NOx [ppm].");

  py::class_<SoftSensor> sensor(m, "SoftSensor",
                                R"(Soft NOx sensor: the value of each cycle at once, its level held to a slow analyser.

``b += c (ln(analyser / delayed) - b)`` once per cycle, where ``delayed`` is the uncorrected soft value after the
analyser's own delay and lag: b approaches the log-ratio of the two at the rate c, however late the analyser is.

Parameters
----------
model : NoxModel
    NOx from the maximum bulk gas temperature.
correction_gain : float
    c per cycle [-], in [0, 1]; 0 never corrects.

Raises
------
mgdd.errors.ParameterError
    A value outside its domain.

Examples
--------
>>> from mgdd.engine import SoftSensor
>>> sensor = SoftSensor(correction_gain=0.5)
>>> bias = sensor.next_bias(0.0, analyser_ppm=1320.0, delayed_soft_ppm=1200.0)
>>> round(float(sensor.ppm(1900.0, ln_bias=bias)), 1)
1258.6
)");
  bind_record(sensor, "SoftSensor");
  sensor
      .def(
          "ppm",
          [](const SoftSensor& self, const InputArray& t, double ln_bias) {
            return elementwise([&](double x) { return self.corrected_ppm(x, ln_bias); }, t);
          },
          arg("t_max_k"), py::kw_only(), arg("ln_bias") = 0.0, "NOx [ppm] at the log-bias b.")
      .def("next_bias", &SoftSensor::next_bias, arg("ln_bias"), py::kw_only(), arg("analyser_ppm"),
           arg("delayed_soft_ppm"), "The log-bias after one reading; values that are not positive leave it alone.");

  py::class_<NoxFit>(m, "NoxFit", R"(A NOx proxy fitted to a sweep, with its spread: what `fit_nox_proxy` returns.

Attributes
----------
proxy : NoxProxy
    The fitted constants.
map : str
    Name of the map.
points : int
    Number of points.
residual_ln : float
    Standard deviation of ln NOx about the fit [-].
reference_nox_stderr_ppm : float
    Standard error of NOx0 [ppm], delta method.
activation_temperature_stderr_k : float
    Standard error of b [K].

Examples
--------
>>> from mgdd.engine import NoxProxy, fit_nox_proxy
>>> t = [1800.0, 1850.0, 1900.0, 1950.0, 2000.0]
>>> fit_nox_proxy(t, NoxProxy().affine_log_ppm(t)).points
5
)")
      .def_property_readonly(
          "proxy", [](const NoxFit& self) { return self.proxy; }, "The fitted constants.")
      .def_property_readonly(
          "map", [](const NoxFit& self) { return as_str(name_of(self.map)); }, "Name of the map.")
      .def_readonly("points", &NoxFit::points, "Number of points.")
      .def_readonly("residual_ln", &NoxFit::residual_ln, "Standard deviation of ln NOx about the fit [-].")
      .def_readonly("reference_nox_stderr_ppm", &NoxFit::reference_nox_stderr_ppm, "Standard error of NOx0 [ppm].")
      .def_readonly("activation_temperature_stderr_k", &NoxFit::activation_temperature_stderr_k,
                    "Standard error of b [K].")
      .def("__repr__", [](const NoxFit& self) {
        py::dict keywords;
        keywords["proxy"] = self.proxy;
        keywords["map"] = as_str(name_of(self.map));
        keywords["points"] = self.points;
        keywords["residual_ln"] = self.residual_ln;
        keywords["reference_nox_stderr_ppm"] = self.reference_nox_stderr_ppm;
        keywords["activation_temperature_stderr_k"] = self.activation_temperature_stderr_k;
        return representation("NoxFit", keywords);
      });

  py::class_<ThermalNo> no(m, "ThermalNoModel");
  bind_keywords<ThermalNo>(no, members_of(fields_of(ThermalNo{}), ThermalNo{}), [](ThermalNo made) { return made; });
  m.def("thermal_no", &thermal_no_of, arg("crank_angle_cad"), arg("pressure_bar"), arg("volume_l"),
        arg("temperature_k"), arg("burned_fraction"), arg("cylinder"), arg("point"), arg("model"),
        "Thermal NO of one cycle.");

  m.def("fit_nox_proxy", &fit, arg("t_max_k"), arg("nox_ppm"), arg("map"), arg("reference_temperature_k"),
        "Least squares on ln NOx; use mgdd.engine.fit_nox_proxy.");
}

}  // namespace mgdd::bindings
