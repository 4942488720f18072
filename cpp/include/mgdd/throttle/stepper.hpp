// One sample of a throttle from a state given as plain numbers in conventional units: what a system description with an
// explicit state (x[k+1] = f(x[k], u[k])) needs. Offline code: input is checked at every call.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/plant.hpp"

namespace mgdd::throttle {

/// Of the first-principle plant. State: angle [deg], speed [deg/s], current [A] and bristle [deg] of motor and gear,
/// then angle, speed and bristle of the plate.
class ThrottleStepper {
 public:
  using Numbers = std::array<double, 7>;

  ThrottleStepper(const Throttle& throttle, double sample_s, double step_s);

  /// Without current.
  static Numbers at_rest(double angle_deg);
  /// After one sample under a duty, which is clipped to -1..1. DataError for a number that is not finite.
  Numbers advance(const Numbers& state, double duty) const;

 private:
  ThrottlePlant plant_;
  std::size_t steps_;
  double supply_v_;
};

/// Of a pseudo-Wiener model; the state in the order of the model's `numbers`.
class PseudoWienerStepper {
 public:
  explicit PseudoWienerStepper(const PseudoWiener& parameters) : model_(prepare(parameters)) {}

  std::vector<double> at_rest(double angle_deg) const;
  /// After one sample under a duty. DataError for a number that is not finite, ShapeError for a wrong count.
  std::vector<double> advance(const std::vector<double>& state, double duty) const;
  /// Angle [deg] of a state.
  double output(const std::vector<double>& state) const;

 private:
  PseudoWienerModel model_;
};

}  // namespace mgdd::throttle
