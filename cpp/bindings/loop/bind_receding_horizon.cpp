// Binds include/mgdd/control/observed_horizon.hpp on every model that Python has; behind mgdd.control.RecedingHorizon.
// It stands here because it needs the models of the throttle.
#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "control/python_model.hpp"
#include "mgdd/control/observed_horizon.hpp"
#include "mgdd/throttle/models/first_principle.hpp"
#include "record_binding.hpp"
#include "throttle/pseudo_wiener_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace control;
using dynamics::LinearModel;
using FirstPrinciple = throttle::FirstPrincipleModel<double>;

template <class M>
using OnThrottle = ObservedHorizon<RecedingHorizon<M, Eigen::Dynamic, static_cast<int>(dynamics::n_numbers<M>)>,
                                   throttle::ObserverGains>;
template <class M>
using OnAnyOrder = ObservedHorizon<RecedingHorizon<M, Eigen::Dynamic, Eigen::Dynamic>, RunTimeState>;
using AnyHorizon =
    std::variant<OnThrottle<FirstPrinciple>, OnThrottle<throttle::PwRModel>, OnThrottle<throttle::PwWModel>,
                 OnThrottle<throttle::PwPModel>, OnAnyOrder<LinearModel>, OnAnyOrder<PythonModel>>;

struct BoundHorizon {
  AnyHorizon controller;
};

HorizonSettings horizon_settings_of(int max_iterations, int max_sweeps, const std::map<std::string, double>& numbers) {
  HorizonSettings s;
  s.max_iterations = max_iterations;
  s.max_sweeps = max_sweeps;
  for (const auto& [name, value] : numbers) {
    const auto field = find_field(horizon_fields(), name);
    if (field == horizon_fields().end()) {
      throw ParameterError("setting", name, "must be one of RecedingHorizon.fields()");
    }
    field->in(s) = value;
  }
  return s;
}

template <class Observed, class M, class Gains>
BoundHorizon made(const M& model, const HorizonSettings& settings, int length, const Gains& gains) {
  using Horizon = std::remove_cvref_t<decltype(std::declval<const Observed&>().horizon())>;
  return {Observed(Horizon(model, settings, length), gains)};
}

RunTimeState gains_of(const std::vector<double>& given) {
  RunTimeState gains{};
  std::ranges::copy(given, gains.begin());
  return gains;
}

FirstPrinciple first_principle(const throttle::FirstPrinciple::Groups<double>& groups, double sample_s,
                               double closed_deg, double open_deg, int substeps, double tanh_deg_per_s) {
  throttle::FirstPrinciple family;
  family.closed_deg = closed_deg;
  family.open_deg = open_deg;
  family.substeps = substeps;
  family.friction = throttle::Friction::tanh;
  family.tanh_deg_per_s = tanh_deg_per_s;
  family.validate();
  return family.prepare(groups, sample_s);
}

// Runs `work` on a copy where the model is a Python object, so that an exception of it changes nothing.
template <class Work>
auto unchanged_by_failure(BoundHorizon& self, Work work) {
  return std::visit(
      [&]<class C>(C& controller) {
        if constexpr (std::is_same_v<C, OnAnyOrder<PythonModel>>) {
          C copy = controller;
          const auto result = work(copy);
          copy.horizon().model().raise_if_failed();
          controller = std::move(copy);
          return result;
        } else {
          return work(controller);
        }
      },
      self.controller);
}

template <class C>
typename C::State state_of(const C&, const std::vector<double>& given, std::size_t expected) {
  typename C::State state{};
  if (given.size() != expected) {
    throw about("state", ShapeError("state has " + std::to_string(given.size()) + " numbers: must have " +
                                    std::to_string(expected)));
  }
  const auto places = C::Model::numbers(state);
  for (std::size_t i = 0; i < given.size(); ++i)
    *places[i] = given[i];
  return state;
}
template <class C>
std::size_t n_states(const C& controller) {
  if constexpr (requires { controller.horizon().model().order(); }) {
    return static_cast<std::size_t>(controller.horizon().model().order());
  } else {
    return dynamics::n_numbers<typename C::Model>;
  }
}

template <class Get>
auto ask(const BoundHorizon& self, Get get) {
  return std::visit(get, self.controller);
}

std::vector<double> predicted(const BoundHorizon& self) {
  return ask(self, [](const auto& c) {
    const auto& horizon = c.horizon();
    auto state = horizon.state();
    std::vector<double> out;
    for (const double u : horizon.inputs()) {
      horizon.model().step(state, dynamics::input_of(horizon.model(), u));
      out.push_back(horizon.model().output(state));
    }
    if constexpr (requires { horizon.model().raise_if_failed(); }) horizon.model().raise_if_failed();
    return out;
  });
}

}  // namespace

void bind_receding_horizon(py::module_& m) {
  using py::arg;
  using Numbers = std::map<std::string, double>;
  py::class_<BoundHorizon> cls(m, "RecedingHorizon", "Receding-horizon control; use mgdd.control.RecedingHorizon.");
  cls.def_static(
         "of_pseudo_wiener",
         [](const BoundModel& model, int length, int max_iterations, int max_sweeps, const Numbers& numbers) {
           const HorizonSettings s = horizon_settings_of(max_iterations, max_sweeps, numbers);
           return std::visit(
               [&]<class M>(const M& prepared) {
                 return made<OnThrottle<M>>(prepared, s, length, throttle::ObserverGains{});
               },
               throttle::prepare(model.parameters));
         },
         arg("model"), py::kw_only(), arg("horizon_samples"), arg("max_iterations"), arg("max_sweeps"), arg("numbers"))
      .def_static(
          "of_first_principle",
          [](const throttle::FirstPrinciple::Groups<double>& groups, double sample_s, double closed_deg,
             double open_deg, int substeps, double tanh_deg_per_s, int length, int max_iterations, int max_sweeps,
             const Numbers& numbers) {
            return made<OnThrottle<FirstPrinciple>>(
                first_principle(groups, sample_s, closed_deg, open_deg, substeps, tanh_deg_per_s),
                horizon_settings_of(max_iterations, max_sweeps, numbers), length, throttle::ObserverGains{});
          },
          arg("groups"), py::kw_only(), arg("sample_s"), arg("closed_deg"), arg("open_deg"), arg("substeps"),
          arg("tanh_deg_per_s"), arg("horizon_samples"), arg("max_iterations"), arg("max_sweeps"), arg("numbers"))
      .def_static(
          "of_matrices",
          [](const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& c, double sample_s,
             const std::vector<double>& gain, int length, int max_iterations, int max_sweeps, const Numbers& numbers) {
            return made<OnAnyOrder<LinearModel>>(LinearModel(a, b, c, sample_s),
                                                 horizon_settings_of(max_iterations, max_sweeps, numbers), length,
                                                 gains_of(gain));
          },
          arg("a"), arg("b"), arg("c"), py::kw_only(), arg("sample_s"), arg("observer_gain"), arg("horizon_samples"),
          arg("max_iterations"), arg("max_sweeps"), arg("numbers"))
      .def_static(
          "of_object",
          [](const py::object& model, int n, double sample_s, const std::vector<double>& gain, int length,
             int max_iterations, int max_sweeps, const Numbers& numbers) {
            return made<OnAnyOrder<PythonModel>>(PythonModel(model, n, sample_s),
                                                 horizon_settings_of(max_iterations, max_sweeps, numbers), length,
                                                 gains_of(gain));
          },
          arg("model"), py::kw_only(), arg("n_states"), arg("sample_s"), arg("observer_gain"), arg("horizon_samples"),
          arg("max_iterations"), arg("max_sweeps"), arg("numbers"))
      .def_static("fields", [] { return members_of(horizon_fields(), HorizonSettings{}).described(); })
      .def(
          "step",
          [](BoundHorizon& self, const InputArray& reference, double measured) {
            const auto wanted = to_column(reference, "reference");
            return unchanged_by_failure(self, [&](auto& c) { return c.step(wanted, measured); });
          },
          arg("reference"), arg("measured"))
      .def(
          "step_from",
          [](BoundHorizon& self, const InputArray& reference, const std::vector<double>& state) {
            const auto wanted = to_column(reference, "reference");
            return unchanged_by_failure(self,
                                        [&](auto& c) { return c.step_from(wanted, state_of(c, state, n_states(c))); });
          },
          arg("reference"), arg("state"))
      .def(
          "start",
          [](BoundHorizon& self, const std::vector<double>& state, double applied) {
            std::visit([&](auto& c) { c.start(state_of(c, state, n_states(c)), applied); }, self.controller);
          },
          arg("state"), arg("applied"))
      .def("reset", [](BoundHorizon& self) { std::visit([](auto& c) { c.reset(); }, self.controller); })
      .def(
          "applied",
          [](BoundHorizon& self, double input) { std::visit([&](auto& c) { c.applied(input); }, self.controller); },
          arg("input"))
      .def_property_readonly(
          "n_states", [](const BoundHorizon& self) { return ask(self, [](const auto& c) { return n_states(c); }); })
      .def_property_readonly(
          "status",
          [](const BoundHorizon& self) { return as_str(name_of(ask(self, [](const auto& c) { return c.status(); }))); })
      .def_property_readonly(
          "sweeps",
          [](const BoundHorizon& self) { return ask(self, [](const auto& c) { return c.horizon().sweeps(); }); })
      .def_property_readonly(
          "iterations",
          [](const BoundHorizon& self) { return ask(self, [](const auto& c) { return c.horizon().iterations(); }); })
      .def_property_readonly(
          "last_input",
          [](const BoundHorizon& self) { return ask(self, [](const auto& c) { return c.horizon().last_input(); }); })
      .def_property_readonly("inputs",
                             [](const BoundHorizon& self) {
                               return to_array(ask(self, [](const auto& c) { return c.horizon().inputs(); }));
                             })
      .def_property_readonly("predicted", [](const BoundHorizon& self) { return to_array(predicted(self)); })
      .def_property(
          "state", [](const BoundHorizon& self) { return ask(self, [](const auto& c) { return save_state(c); }); },
          [](BoundHorizon& self, const StateColumns& columns) {
            std::visit([&](auto& c) { restore_state(c, columns); }, self.controller);
          });
}

}  // namespace mgdd::bindings
