// Binds include/mgdd/control/mgdd1.hpp with the models that guide it, those of Python too.
#include <map>
#include <string>
#include <variant>

#include "binding.hpp"
#include "control/python_model.hpp"
#include "loop/mgdd1_binding.hpp"
#include "mgdd/common/error.hpp"
#include "record_binding.hpp"
#include "throttle/pseudo_wiener_binding.hpp"

namespace mgdd::bindings {
namespace {

using loop::Mgdd1On;
using Numbers = std::map<std::string, double>;

/// Guided by a Python object. A step is done on a copy, so that an exception of the guide changes nothing.
struct ObjectGuidedMgdd1 {
  Mgdd1On<PythonGuide> controller;
};

control::Mgdd1Settings mgdd1_settings_of(int horizon_samples, int delay_samples, const Numbers& numbers) {
  control::Mgdd1Settings s;
  s.horizon_samples = horizon_samples;
  s.delay_samples = delay_samples;
  for (const auto& [name, value] : numbers) {
    const auto field = find_field(control::mgdd1_fields(), name);
    if (field == control::mgdd1_fields().end()) throw ParameterError("setting", name, "must be one of Mgdd1.fields()");
    field->in(s) = value;
  }
  return s;
}

double stepped(BoundMgdd1& self, double reference, double measured) {
  return std::visit([&](auto& c) { return c.step(reference, measured); }, self.controller);
}
double stepped(ObjectGuidedMgdd1& self, double reference, double measured) {
  auto copy = self.controller;
  const double duty = copy.step(reference, measured);
  copy.model().raise_if_failed();
  self.controller = copy;
  return duty;
}

template <class Work>
auto with(BoundMgdd1& self, Work work) {
  return std::visit(work, self.controller);
}
template <class Work>
auto with(ObjectGuidedMgdd1& self, Work work) {
  return work(self.controller);
}

template <class Bound>
void bind_steps(py::class_<Bound>& cls) {
  cls.def(
         "step", [](Bound& self, double reference, double measured) { return stepped(self, reference, measured); },
         py::arg("reference_deg"), py::arg("measurement_deg"))
      .def(
          "set_sent", [](Bound& self, double duty) { with(self, [=](auto& c) { c.set_sent(duty); }); }, py::arg("duty"))
      .def("reset", [](Bound& self) { with(self, [](auto& c) { c.reset(); }); })
      .def_property_readonly("duty", [](Bound& self) { return with(self, [](auto& c) { return c.duty(); }); })
      .def_property(
          "state", [](Bound& self) { return with(self, [](auto& c) { return save_state(c); }); },
          [](Bound& self, const StateColumns& columns) { with(self, [&](auto& c) { restore_state(c, columns); }); });
}

}  // namespace

void bind_mgdd1(py::module_& m) {
  py::class_<BoundMgdd1> plain(m, "Mgdd1", "The plainest model-guided controller; use mgdd.control.Mgdd1.");
  plain
      .def(py::init([](const BoundModel& guide, int horizon_samples, int delay_samples, const Numbers& numbers) {
             const auto s = mgdd1_settings_of(horizon_samples, delay_samples, numbers);
             return std::visit(
                 [&](const auto& model) -> BoundMgdd1 { return {Mgdd1On<std::decay_t<decltype(model)>>(model, s)}; },
                 throttle::prepare(guide.parameters));
           }),
           py::arg("guide"), py::kw_only(), py::arg("horizon_samples"), py::arg("delay_samples"), py::arg("numbers"))
      .def_static("fields", [] { return members_of(control::mgdd1_fields(), control::Mgdd1Settings{}).described(); });
  bind_steps(plain);
  py::class_<ObjectGuidedMgdd1> guided(m, "ObjectGuidedMgdd1",
                                       "The same guided by a Python object; use mgdd.control.Mgdd1.");
  guided.def(py::init([](const py::object& guide, int n_states, double sample_s, int horizon_samples, int delay_samples,
                         const Numbers& numbers) {
               return ObjectGuidedMgdd1{Mgdd1On<PythonGuide>(
                   PythonGuide(guide, n_states, sample_s), mgdd1_settings_of(horizon_samples, delay_samples, numbers))};
             }),
             py::arg("guide"), py::kw_only(), py::arg("n_states"), py::arg("sample_s"), py::arg("horizon_samples"),
             py::arg("delay_samples"), py::arg("numbers"));
  bind_steps(guided);
}

}  // namespace mgdd::bindings
