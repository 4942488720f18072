// One sample of a throttle from a given state: what a system description with an explicit state needs. Behind
// mgdd.throttle.to_iosystem.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/throttle/simulation.hpp"

namespace mgdd::bindings {

namespace {

using namespace mgdd::throttle;

constexpr double rad_per_deg = 0.017453292519943295;
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
    for (const double value : state)
      if (!std::isfinite(value)) throw DataError("state holds a value that is not finite");
    if (!std::isfinite(duty)) throw DataError("duty is not finite");
    ThrottleState s = inside(state);
    const ThrottleInput input{.duty = duty, .supply_v = supply_v};
    for (std::size_t i = 0; i < steps; ++i)
      plant.step(s, input);
    return outside(s);
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
}

}  // namespace mgdd::bindings
