// Dry friction in a fixed step: the speed after a step whose momentum without dry friction is known. Set-valued forms
// stick exactly and never creep; tanh is smooth and creeps; LuGre carries a bristle. One definition for every model:
// the unit of the levels is that of the momentum. noexcept, heap-free; a branch follows the value.
// Sources: Moreau 1988 (the proximal step); Armstrong-Helouvry et al. 1994, eq. 3 (Stribeck); Karnopp 1985; Canudas de
// Wit et al. 1995 (LuGre).
#pragma once

#include <type_traits>

#include "mgdd/math/select.hpp"

namespace mgdd::dynamics {

/// Law of the dry friction; a viscous part is separate.
enum class Friction {
  coulomb,   ///< set-valued: sticks exactly, one level
  stiction,  ///< set-valued, a higher level while it sticks
  stribeck,  ///< set-valued, the level falls from stiction to Coulomb with speed
  karnopp,   ///< sticks inside a speed band (Karnopp 1985)
  tanh,      ///< smooth, for gradients only: it creeps under load
  lugre,     ///< bristles: presliding displacement (Canudas de Wit et al. 1995)
};

/// Below it a body counts as stuck; the models' units are rad/s or deg/s.
inline constexpr double rest_speed = 1e-9;

/// `magnitude` with the sign of `from`; zero counts as positive.
template <class C, class T>
MGDD_INLINE C along(const C& magnitude, const T& from) noexcept {
  const auto back = from < T(0.0);
  if constexpr (std::is_same_v<decltype(from < T(0.0)), bool>) {
    return back ? -magnitude : magnitude;  // a dual is negated only where it must be
  } else {
    return select(back, -magnitude, magnitude);
  }
}

/// The set-valued step: at rest while |momentum| <= hold, otherwise slides with the sign of the momentum against
/// `slide`. Speed = (momentum - slide sgn)/divisor.
template <class T, class H, class C, class D>
MGDD_INLINE T stick_or_slide(const T& momentum, const H& hold, const C& slide, const D& divisor) noexcept {
  const T size = larger(momentum, -momentum);
  const T zero(0.0);
  return select(size <= hold, zero, (momentum - along(slide, momentum)) / divisor);
}

/// The smooth step, linearly implicit: level tanh(speed/width) about the speed before the step.
template <class T, class C, class D>
MGDD_INLINE T creep(const T& speed, const T& momentum, const C& level, const C& over_width, const D& divisor) noexcept {
  const T t = tanh_of(speed * over_width);
  const T slope = level * over_width * (T(1.0) - t * t);
  return (momentum - level * t + slope * speed) / (divisor + slope);
}

/// Stiffness and damping of bristles: level per deflection, and per its rate.
template <class C>
struct Bristles {
  C stiffness, damping;
};

/// The LuGre step, implicit in the deflection: `level` is the sliding friction at the speed before the step. Without
/// friction the bristle stays unbent.
template <class T, class L, class C, class D>
MGDD_INLINE T bend_or_slide(const T& speed, const T& momentum, const L& level, const Bristles<C>& bristles,
                            double step_s, const D& divisor, T& bristle) noexcept {
  const T h = T(step_s);
  const C per_h = bristles.damping / C(step_s);
  const T size = larger(speed, -speed);
  const T keep = select(level > L(0.0), T(1.0) / (T(1.0) + h * bristles.stiffness * size / level), T(0.0));
  const T grip = (bristles.stiffness + per_h) * keep;
  const T moved = (momentum - (grip - per_h) * bristle) / (divisor + grip * h);
  bristle = keep * (bristle + h * moved);
  return moved;
}

template <class C>
struct FrictionLevels {
  C coulomb, stiction;
};
/// What the forms need beside the levels.
template <class C>
struct FrictionShape {
  C inverse_stribeck, karnopp, inverse_tanh;
};

/// Level at a speed that falls from stiction to Coulomb friction.
template <class T, class C>
MGDD_INLINE T stribeck_level(const FrictionLevels<C>& f, const FrictionShape<C>& shape, const T& speed) noexcept {
  const T ratio = speed * shape.inverse_stribeck;
  return f.coulomb + (f.stiction - f.coulomb) * exp_of(-ratio * ratio);
}

/// Level that must be exceeded to leave rest.
template <class C>
C breakaway_level(Friction form, const FrictionLevels<C>& f) noexcept {
  if (form == Friction::tanh) return C(0.0);
  return form == Friction::coulomb ? f.coulomb : f.stiction;
}

/// Speed after a step of `step_s` with `momentum` = inertia/h speed + all torques but dry friction, over `divisor`.
template <class T, class C, class D>
MGDD_INLINE T next_speed(Friction form, const FrictionLevels<C>& f, const FrictionShape<C>& shape,
                         const Bristles<C>& bristles, double step_s, const C& inertia_over_h, const T& speed,
                         const T& momentum, const D& divisor, T& bristle) noexcept {
  const T zero(0.0);
  const T size = larger(speed, -speed);
  const T rest = T(rest_speed);
  switch (form) {
    case Friction::coulomb:
      return stick_or_slide(momentum, f.coulomb, f.coulomb, divisor);
    case Friction::stiction:
      return stick_or_slide(momentum, select(size < rest, f.stiction, f.coulomb), f.coulomb, divisor);
    case Friction::stribeck: {
      const T curve = stribeck_level(f, shape, speed);
      return stick_or_slide(momentum, select(size < rest, T(f.stiction), curve),
                            select(size < rest, T(f.coulomb), curve), divisor);
    }
    case Friction::karnopp: {
      const T net = momentum - inertia_over_h * speed;
      const auto in_band = size < T(shape.karnopp);
      const auto holds = in_band & (larger(net, -net) <= T(f.stiction));
      const T slide = select(in_band, T(along(f.coulomb, net)), along(stribeck_level(f, shape, speed), speed));
      const T moved = (momentum - slide) / divisor;
      // A reversal inside one step stops at zero: friction never drives.
      const auto reversed = (!in_band) & (moved * speed < zero);
      return select(holds | reversed, zero, moved);
    }
    case Friction::tanh:
      return creep(speed, momentum, f.coulomb, shape.inverse_tanh, divisor);
    case Friction::lugre:
      return bend_or_slide(speed, momentum, stribeck_level(f, shape, speed), bristles, step_s, divisor, bristle);
  }
  return zero;
}

/// Hard end stops: a position that would leave [lowest, highest] ends at the bound, without speed.
template <class T, class C>
MGDD_INLINE void stop_at_ends(T& position, T& speed, const T& moved, const T& next, const C& lowest,
                              const C& highest) noexcept {
  const T held = larger(smaller(moved, widened<T>(highest)), widened<T>(lowest));
  speed = select(held == moved, next, T(0.0));
  position = held;
}

/// Duty at which a body at rest begins to move: below `down` or above `up`.
template <class T>
struct Breakaway {
  T down, up;
};

}  // namespace mgdd::dynamics
