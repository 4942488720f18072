// Motor-driven linear axis with friction: mass, viscous friction per direction, Coulomb friction with a Stribeck rise,
// and an offset force that may drift. Units SI, input V, output m. step() is noexcept and heap-free.
// Friction at rest is set-valued and solved exactly by a proximal step, so the axis neither chatters nor creeps. The
// Stribeck term falls exponentially with the speed.
#pragma once

#include <array>

#include "mgdd/common/record.hpp"
#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/dynamics/dry_friction.hpp"

namespace mgdd::systems {

using dynamics::Values;

template <class T>
struct DriveState {
  T position_m{0.0};
  T speed_m_per_s{0.0};
  T time_s{0.0};  ///< since the start of the record: the drift needs it
};

/// Prepared: coefficients C on states of T, the same or plain numbers on duals.
template <class T, class C = T>
struct DriveModel {
  using Scalar = T;
  using State = DriveState<T>;
  using Input = T;
  static constexpr int n_observed = 2;

  C mass_over_h, forward, backward, coulomb, stribeck, stribeck_speed, offset, drift, stiffness, force_n_per_v, centre;
  double h;

  MGDD_INLINE void step(State& s, const T& voltage) const noexcept {
    const T drive = mass_over_h * s.speed_m_per_s + force_n_per_v * voltage - offset - drift * s.time_s -
                    stiffness * (s.position_m - centre);
    const T slowing = select(s.speed_m_per_s > T(0.0), -s.speed_m_per_s, s.speed_m_per_s);
    const T limit = coulomb + stribeck * exp_of(slowing / stribeck_speed);
    const C divisor = select(drive > T(0.0), forward, backward);
    s.speed_m_per_s = dynamics::stick_or_slide(drive, limit, limit, divisor);
    s.position_m += C(h) * s.speed_m_per_s;
    s.time_s += T(h);
  }
  MGDD_INLINE T output(const State& s) const noexcept { return s.position_m; }
  double sample_s() const noexcept { return h; }
  State at_rest(const T& position_m) const noexcept { return {position_m, T(0.0), T(0.0)}; }

  template <class U>
  DriveModel<U, C> over() const noexcept {
    return {mass_over_h, forward, backward,  coulomb,       stribeck, stribeck_speed,
            offset,      drift,   stiffness, force_n_per_v, centre,   h};
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::array{&s.position_m, &s.speed_m_per_s, &s.time_s};
  }
};

struct DriveAxis {
  static constexpr int n_parameters = 9;
  static constexpr int n_start = 3;

  static constexpr std::array<FieldInfo, 9> parameters = {{
      {"mass_kg", "kg", closed(1e-3, 1e5), "moved mass"},
      {"viscous_ns_per_m", "N s/m", closed(0.0, 1e6), "viscous friction, mean of both directions"},
      {"viscous_asymmetry_ns_per_m", "N s/m", closed(-1e6, 1e6), "added to it forward, taken off backward"},
      {"coulomb_n", "N", closed(0.0, 1e5), "Coulomb friction"},
      {"stribeck_n", "N", closed(0.0, 1e5), "rise of the friction towards rest"},
      {"stribeck_speed_m_per_s", "m/s", closed(1e-3, 1e2), "speed of that rise"},
      {"offset_n", "N", closed(-1e5, 1e5), "constant force"},
      {"offset_drift_n_per_s", "N/s", closed(-1e3, 1e3), "its drift"},
      {"stiffness_n_per_m", "N/m", closed(-1e6, 1e6), "stiffness about the centre"},
  }};
  /// time_s is the time since the start of the record: the drift needs it, a fit leaves it fixed.
  static constexpr std::array<FieldInfo, 3> start_numbers = {
      {{"position_m", "m", closed(-1e3, 1e3), "position"},
       {"speed_m_per_s", "m/s", closed(-1e3, 1e3), "speed"},
       {"time_s", "s", closed(0.0, 1e9), "time since the start"}}};

  double force_n_per_v = 1.0;  ///< actuator gain; only its ratio to the mass and the forces acts
  double centre_m = 0.0;       ///< where the stiffness exerts no force

  template <class T>
  DriveModel<T> prepare(const Values<T, 9>& p, double sample_s) const noexcept {
    const auto& [mass, viscous, asymmetry, coulomb, stribeck, stribeck_speed, offset, drift, stiffness] = p;
    const T inertia = mass * T(1.0 / sample_s);
    return {inertia,
            inertia + viscous + asymmetry,
            inertia + viscous - asymmetry,
            coulomb,
            stribeck,
            stribeck_speed,
            offset,
            drift,
            stiffness,
            T(force_n_per_v),
            T(centre_m),
            sample_s};
  }
  template <class T, class Model>
  auto start(const Model&, const Values<T, 3>& stated) const noexcept {
    return typename Model::State{stated[0], stated[1], stated[2]};
  }
};

static_assert(dynamics::DescribedFamily<DriveAxis> && dynamics::on_every_scalar<DriveAxis> &&
              dynamics::StartsAtRest<DriveModel<double>>);

}  // namespace mgdd::systems
