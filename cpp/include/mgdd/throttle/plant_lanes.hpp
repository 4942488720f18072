// Up to eight throttles side by side in SIMD lanes, each with the bits that it has alone. SI inside the states.
// `step` is noexcept and allocation-free.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "mgdd/math/lanes.hpp"
#include "mgdd/throttle/plant.hpp"

namespace mgdd::throttle {

/// One of several throttles: parameters and start are its own.
struct ThrottleCase {
  Throttle throttle;
  ThrottleState start;
};

/// Whether two throttles have one form of friction and one of backlash, as lanes need.
bool same_form(const Throttle& one, const Throttle& other) noexcept;

class PlantLanes {
 public:
  static constexpr int width = 8;
  using Wide = Lanes<width>;
  using Plant = BasicThrottlePlant<Wide>;
  using State = BasicThrottleState<Wide>;
  using Row = std::array<double, width>;

  /// What acts in each lane.
  struct Inputs {
    Row duty{}, supply_v{}, airflow_torque_nm{};
    Bridge bridge = Bridge::brake;
  };

  /// One to eight cases; idle lanes repeat the last. ParameterError for a bad throttle, another number, other forms.
  PlantLanes(std::span<const ThrottleCase> cases, double step_s);

  /// Advances every lane by so many steps.
  void step(const Inputs& inputs, std::size_t steps) noexcept;

  ThrottleState state(std::size_t lane) const noexcept;
  double angle_deg(std::size_t lane) const noexcept;

  const Plant& plant() const noexcept { return plant_; }
  State& states() noexcept { return states_; }

 private:
  Plant plant_;
  State states_;
};

}  // namespace mgdd::throttle
