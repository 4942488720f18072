#include "mgdd/throttle/stepper.hpp"

#include <cmath>
#include <span>
#include <string>
#include <type_traits>
#include <variant>

#include "mgdd/common/error.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/throttle/simulation.hpp"

namespace mgdd::throttle {
namespace {

using units::rad_per_deg;

void require_finite(std::span<const double> state, double duty) {
  for (const double number : state)
    if (!std::isfinite(number)) throw about("state", DataError("state holds a value that is not finite"));
  if (!std::isfinite(duty)) throw about("duty", DataError("duty is not finite"));
}

ThrottleStepper::Numbers outside(const ThrottleState& s) {
  return {s.angle_rad / rad_per_deg,        s.speed_rad_per_s / rad_per_deg, s.current_a,
          s.bristle_rad / rad_per_deg,      s.plate_angle_rad / rad_per_deg, s.plate_speed_rad_per_s / rad_per_deg,
          s.plate_bristle_rad / rad_per_deg};
}

ThrottleState inside(const ThrottleStepper::Numbers& n) {
  return {n[0] * rad_per_deg, n[1] * rad_per_deg, n[2], n[3] * rad_per_deg, n[4] * rad_per_deg,
          n[5] * rad_per_deg, n[6] * rad_per_deg};
}

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
    throw about("state", ShapeError("state has " + std::to_string(numbers.size()) + " values: must have " +
                                    std::to_string(places.size())));
  }
  for (std::size_t i = 0; i < places.size(); ++i)
    *places[i] = numbers[i];
  return s;
}

}  // namespace

ThrottleStepper::ThrottleStepper(const Throttle& throttle, double sample_s, double step_s)
    : plant_(throttle, step_s), steps_(steps_per_sample(sample_s, step_s)), supply_v_(throttle.supply_v) {}

ThrottleStepper::Numbers ThrottleStepper::at_rest(double angle_deg) {
  return outside(throttle::at_rest(angle_deg));
}

ThrottleStepper::Numbers ThrottleStepper::advance(const Numbers& state, double duty) const {
  require_finite(state, duty);
  ThrottleState s = inside(state);
  const ThrottleInput input{.duty = duty, .supply_v = supply_v_};
  for (std::size_t i = 0; i < steps_; ++i)
    plant_.step(s, input);
  return outside(s);
}

std::vector<double> PseudoWienerStepper::at_rest(double angle_deg) const {
  return std::visit([&](const auto& m) { return numbers_of<std::decay_t<decltype(m)>>(m.at_rest(angle_deg, 0.0)); },
                    model_);
}

std::vector<double> PseudoWienerStepper::advance(const std::vector<double>& state, double duty) const {
  require_finite(state, duty);
  return std::visit(
      [&](const auto& m) {
        using M = std::decay_t<decltype(m)>;
        auto s = state_of<M>(state);
        m.step(s, duty);
        return numbers_of<M>(s);
      },
      model_);
}

double PseudoWienerStepper::output(const std::vector<double>& state) const {
  return std::visit([&](const auto& m) { return m.output(state_of<std::decay_t<decltype(m)>>(state)); }, model_);
}

}  // namespace mgdd::throttle
