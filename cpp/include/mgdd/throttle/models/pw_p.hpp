// PW-P, a Wiener model whose output block remembers: two lags, then a play operator (or a Prandtl-Ishlinskii sum of up
// to eight) and a gain. Units: deg, s, duty. Five parameters with one play. Every step is noexcept and allocation-free;
// T is double, Dual<N> or Lanes<N>. A massless spring with dry friction is a play, so the
// model is right for slow motion and wrong where inertia matters.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "mgdd/dynamics/play.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"

namespace mgdd::throttle {

inline constexpr int max_plays = 8;

template <class T>
struct BasicPwP {
  using Column = std::array<T, static_cast<std::size_t>(max_plays)>;

  T first_s{0.05};
  T second_s{0.5};
  T offset_deg{0.0};           ///< c0: output at zero play, from limp-home
  Column radius_duty{};        ///< r of each play, half its width
  Column gain_deg_per_duty{};  ///< c of each play
  T limp_home_deg{8.0};
  int plays = 1;
  LagStart lag_start = LagStart::rest;
  PseudoWienerFrame frame{};

  bool operator==(const BasicPwP&) const = default;

  void validate() const
    requires std::is_same_v<T, double>;
};
using PwP = BasicPwP<double>;

template <class T>
struct BasicPwPState {
  T first_duty{0.0};
  T second_duty{0.0};
  typename BasicPwP<T>::Column play_duty{};
  T offset_deg{0.0};  ///< what re-anchoring adds to the output
  DelayLine<T> line{};
};

template <class T>
class BasicPwPModel {
 public:
  using Parameters = BasicPwP<T>;
  using State = BasicPwPState<T>;

  explicit BasicPwPModel(const Parameters& parameters) noexcept
      : p_(parameters), lags_(parameters.first_s, parameters.second_s, parameters.frame.sample_s) {}

  MGDD_INLINE void advance(State& s, const T& duty) const noexcept {
    lags_.step(s.first_duty, s.second_duty, s.line.pass(duty, p_.frame.delay_samples));
    for (std::size_t i = 0; i < plays(); ++i)
      s.play_duty[i] = dynamics::play(s.second_duty, p_.radius_duty[i], s.play_duty[i]);
  }

  /// Clipped to the travel.
  MGDD_INLINE T output(const State& s) const noexcept {
    return larger(smaller(unclipped(s) + s.offset_deg, T(p_.frame.open_deg)), T(p_.frame.closed_deg));
  }

  /// Start of a free run at an angle, every play in the middle of its gap, `duty` in the delay line.
  State at_rest(const T& angle_deg, const T& duty) const noexcept {
    State s;
    if (p_.lag_start == LagStart::inverse_map) {
      T gain(0.0);
      for (std::size_t i = 0; i < plays(); ++i)
        gain += p_.gain_deg_per_duty[i];
      const T safe = larger(gain, T(1.0));
      const T place = (angle_deg - p_.limp_home_deg - p_.offset_deg) / safe;
      s.first_duty = s.second_duty = larger(smaller(place, T(1.0)), T(-1.0));
      for (std::size_t i = 0; i < plays(); ++i)
        s.play_duty[i] = s.second_duty;
    }
    s.line.fill(duty);
    return s;
  }

  /// With `offset_gain` 1 the prediction is y_measured(k) + sim(k + H) - sim(k).
  MGDD_INLINE void reanchor(State& s, const T& angle_deg, const Anchor& a) const noexcept {
    s.offset_deg += T(a.offset_gain) * (angle_deg - output(s));
  }

  const Parameters& parameters() const noexcept { return p_; }

 private:
  std::size_t plays() const noexcept { return static_cast<std::size_t>(p_.plays); }
  MGDD_INLINE T unclipped(const State& s) const noexcept {
    T y = p_.limp_home_deg + p_.offset_deg;
    for (std::size_t i = 0; i < plays(); ++i)
      y += p_.gain_deg_per_duty[i] * s.play_duty[i];
    return y;
  }

  Parameters p_;
  LagPair<T> lags_;
};
using PwPState = BasicPwPState<double>;
using PwPModel = BasicPwPModel<double>;

}  // namespace mgdd::throttle
