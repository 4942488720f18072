// One sample of a throttle from a given state: what a system description with an explicit state needs. Behind
// mgdd.throttle.to_iosystem.
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "pseudo_wiener_binding.hpp"

namespace mgdd::bindings {

namespace {

using namespace mgdd::throttle;

void require_finite(const double* state, std::size_t size, double duty) {
  for (std::size_t i = 0; i < size; ++i)
    if (!std::isfinite(state[i])) throw DataError("state holds a value that is not finite");
  if (!std::isfinite(duty)) throw DataError("duty is not finite");
}

using units::rad_per_deg;
constexpr std::size_t n_states = 7;
using Numbers = std::array<double, n_states>;

// Angles in deg, speeds in deg/s, current in A; the bristles in deg.
Numbers outside(const ThrottleState& s) {
  return {s.angle_rad / rad_per_deg,        s.speed_rad_per_s / rad_per_deg, s.current_a,
          s.bristle_rad / rad_per_deg,      s.plate_angle_rad / rad_per_deg, s.plate_speed_rad_per_s / rad_per_deg,
          s.plate_bristle_rad / rad_per_deg};
}

ThrottleState inside(const Numbers& n) {
  return {n[0] * rad_per_deg, n[1] * rad_per_deg, n[2], n[3] * rad_per_deg, n[4] * rad_per_deg,
          n[5] * rad_per_deg, n[6] * rad_per_deg};
}

struct Stepper {
  ThrottlePlant plant;
  std::size_t steps;
  double supply_v;

  Stepper(const Throttle& throttle, double sample_s, double step_s)
      : plant(throttle, step_s), steps(steps_per_sample(sample_s, step_s)), supply_v(throttle.supply_v) {}

  Numbers advance(const Numbers& state, double duty) const {
    require_finite(state.data(), state.size(), duty);
    ThrottleState s = inside(state);
    const ThrottleInput input{.duty = duty, .supply_v = supply_v};
    for (std::size_t i = 0; i < steps; ++i)
      plant.step(s, input);
    return outside(s);
  }
};

template <class M>
std::vector<double> numbers_of(const typename M::State& s) {
  std::vector<double> out;
  for (const double* number : M::numbers(s))
    out.push_back(*number);
  return out;
}

template <class M>
typename M::State state_of(const std::vector<double>& numbers) {
  typename M::State s;
  const auto places = M::numbers(s);
  if (numbers.size() != places.size()) {
    throw ShapeError("state has " + std::to_string(numbers.size()) + " values: must have " +
                     std::to_string(places.size()));
  }
  for (std::size_t i = 0; i < places.size(); ++i)
    *places[i] = numbers[i];
  return s;
}

struct PseudoWienerStepper {
  PseudoWiener parameters;
  PseudoWienerModel model;

  explicit PseudoWienerStepper(PseudoWiener p) : parameters(std::move(p)), model(prepare(parameters)) {}

  std::vector<double> at_rest(double angle_deg) const {
    return std::visit([&](const auto& m) { return numbers_of<std::decay_t<decltype(m)>>(m.at_rest(angle_deg, 0.0)); },
                      model);
  }
  std::vector<double> advance(const std::vector<double>& state, double duty) const {
    require_finite(state.data(), state.size(), duty);
    return std::visit(
        [&](const auto& m) {
          using M = std::decay_t<decltype(m)>;
          auto s = state_of<M>(state);
          m.step(s, duty);
          return numbers_of<M>(s);
        },
        model);
  }
  double output(const std::vector<double>& state) const {
    return std::visit([&](const auto& m) { return m.output(state_of<std::decay_t<decltype(m)>>(state)); }, model);
  }
};

}  // namespace

void bind_throttle_step(py::module_& m) {
  py::class_<Stepper>(m, "ThrottleStepper",
                      R"(One sample of a throttle from a given state; behind mgdd.throttle.to_iosystem.

The state is angle [deg], speed [deg/s], current [A] and bristle [deg] of motor and gear, then angle, speed and bristle
of the plate.
)")
      .def(py::init<const Throttle&, double, double>(), py::arg("throttle"), py::kw_only(), py::arg("sample_s"),
           py::arg("step_s"))
      .def_static(
          "at_rest", [](double angle_deg) { return outside(at_rest(angle_deg)); }, py::arg("angle_deg"),
          "State at rest at an angle [deg], without current.")
      .def("advance", &Stepper::advance, py::arg("state"), py::arg("duty"),
           "State after one sample under a duty [-], which is clipped to -1..1.");
  py::class_<PseudoWienerStepper>(
      m, "PseudoWienerStepper",
      "One sample of a pseudo-Wiener model from a given state; behind mgdd.throttle.to_iosystem.")
      .def(py::init([](const std::string& kind, const std::map<std::string, double>& parameters,
                       const std::string& switching, const std::string& friction) {
             return PseudoWienerStepper(make_pseudo_wiener(kind, parameters, switching, friction));
           }),
           py::arg("kind"), py::arg("parameters"), py::kw_only(), py::arg("switching") = "predicted",
           py::arg("friction") = "set_valued")
      .def("at_rest", &PseudoWienerStepper::at_rest, py::arg("angle_deg"), "State at rest at an angle [deg].")
      .def("advance", &PseudoWienerStepper::advance, py::arg("state"), py::arg("duty"),
           "State after one sample under a duty [-].")
      .def("output", &PseudoWienerStepper::output, py::arg("state"), "Angle [deg] of a state.");
}

}  // namespace mgdd::bindings
