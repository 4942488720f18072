// PW-P, a Wiener model whose output block remembers: two lags, then a play operator (or a Prandtl-Ishlinskii sum of up
// to eight) and a gain. Units: deg, s, duty. Five parameters with one play. Every step is noexcept and allocation-free;
// T is double, Dual<N> or Lanes<N>. A massless spring with dry friction is a play, so the
// model is right for slow motion and wrong where inertia matters.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <type_traits>

#include "mgdd/dynamics/dry_friction.hpp"
#include "mgdd/dynamics/play.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"

namespace mgdd::throttle {

inline constexpr int max_plays = 8;

/// ParameterError for settings of PW-P outside their domain.
void check_pw_p(const PseudoWienerFrame& frame, int plays);

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

  /// ParameterError naming field, value and bound; on double only.
  void validate() const;
  void validate_settings() const { check_pw_p(frame, plays); }

  /// The numbers in the order of `fields`; all eight plays, those beyond `plays` do nothing.
  template <class Self>
  static auto numbers(Self& p) noexcept {
    auto& r = p.radius_duty;
    auto& g = p.gain_deg_per_duty;
    return std::array{&p.first_s, &p.second_s, &p.offset_deg, &r[0], &g[0], &r[1],           &g[1],
                      &r[2],      &g[2],       &r[3],         &g[3], &r[4], &g[4],           &r[5],
                      &g[5],      &r[6],       &g[6],         &r[7], &g[7], &p.limp_home_deg};
  }
};
using PwP = BasicPwP<double>;

template <class T>
struct BasicPwPState {
  T offset_deg{0.0};  ///< what an observer adds to the output
  T first_duty{0.0};
  T second_duty{0.0};
  typename BasicPwP<T>::Column play_duty{};
  DutyLine<T> line{};
};

/// Coefficients C on states of T: the same, or plain numbers on duals.
template <class T, class C = T>
class BasicPwPModel {
 public:
  using Scalar = T;
  using Parameters = BasicPwP<C>;
  using State = BasicPwPState<T>;
  using Input = T;
  static constexpr int n_observed = 1;

  /// ParameterError for settings that no model can work with (`validate_settings`); bounds of numbers are a search's.
  explicit BasicPwPModel(const Parameters& parameters)
      : BasicPwPModel((parameters.validate_settings(), parameters), unchecked) {}
  BasicPwPModel(const Parameters& parameters, Unchecked) noexcept
      : p_(parameters),
        delay_(parameters.frame.delay()),
        lags_(parameters.first_s, parameters.second_s, parameters.frame.sample_s) {}

  MGDD_INLINE void step(State& s, const T& duty) const noexcept {
    lags_.step(s.first_duty, s.second_duty, s.line.pass(duty, delay_));
    for (std::size_t i = 0; i < plays(); ++i)
      s.play_duty[i] = dynamics::play(s.second_duty, T(p_.radius_duty[i]), s.play_duty[i]);
  }

  /// Clipped to the travel.
  MGDD_INLINE T output(const State& s) const noexcept {
    return larger(smaller(unclipped(s) + s.offset_deg, T(p_.frame.open_deg)), T(p_.frame.closed_deg));
  }
  double sample_s() const noexcept { return p_.frame.sample_s; }

  /// Start of a free run at an angle, every play in the middle of its gap, `duty` in the delay line.
  State at_rest(const T& angle_deg, const T& duty = T(0.0)) const noexcept {
    State s;
    if (p_.lag_start == LagStart::inverse_map) {
      C gain(0.0);
      for (std::size_t i = 0; i < plays(); ++i)
        gain += p_.gain_deg_per_duty[i];
      const C safe = larger(gain, C(1.0));
      const T place = (angle_deg - p_.limp_home_deg - p_.offset_deg) / safe;
      s.first_duty = s.second_duty = larger(smaller(place, T(1.0)), T(-1.0));
      for (std::size_t i = 0; i < plays(); ++i)
        s.play_duty[i] = s.second_duty;
    }
    s.line.fill(duty);
    return s;
  }

  /// With `offset_gain` 1 the prediction is y_measured(k) + sim(k + H) - sim(k).
  MGDD_INLINE void correct(State& s, const T& angle_deg, const ObserverGains& gains) const noexcept {
    s.offset_deg += T(gains.offset_gain) * (angle_deg - output(s));
  }

  /// Whether every play rests inside its gap.
  auto stuck(const State& s) const noexcept {
    const dynamics::Breakaway<T> edge = breakaway(s);
    return (edge.down < s.second_duty) & (s.second_duty < edge.up);
  }
  /// Held duty at which the first play begins to move.
  dynamics::Breakaway<T> breakaway(const State& s) const noexcept {
    dynamics::Breakaway<T> edge{s.play_duty[0] - p_.radius_duty[0], s.play_duty[0] + p_.radius_duty[0]};
    for (std::size_t i = 1; i < plays(); ++i) {
      edge.down = larger(edge.down, T(s.play_duty[i] - p_.radius_duty[i]));
      edge.up = smaller(edge.up, T(s.play_duty[i] + p_.radius_duty[i]));
    }
    return edge;
  }

  const Parameters& parameters() const noexcept { return p_; }
  template <class U>
  BasicPwPModel<U, C> over() const noexcept {
    return BasicPwPModel<U, C>(*this);
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::apply(
        [&](auto&... play) {
          return std::apply(
              [&](auto&... before) {
                return std::array{&s.offset_deg, &s.first_duty, &s.second_duty, &play..., &before...};
              },
              s.line.before);
        },
        s.play_duty);
  }

 private:
  template <class, class>
  friend class BasicPwPModel;
  template <class V>
  explicit BasicPwPModel(const BasicPwPModel<V, C>& o) noexcept : p_(o.p_), delay_(o.delay_), lags_(o.lags_) {}

  std::size_t plays() const noexcept { return static_cast<std::size_t>(p_.plays); }
  MGDD_INLINE T unclipped(const State& s) const noexcept {
    T y(p_.limp_home_deg + p_.offset_deg);
    for (std::size_t i = 0; i < plays(); ++i)
      y += p_.gain_deg_per_duty[i] * s.play_duty[i];
    return y;
  }

  Parameters p_;
  dynamics::Delay delay_;
  LagPair<C> lags_;
};
using PwPState = BasicPwPState<double>;
using PwPModel = BasicPwPModel<double>;

}  // namespace mgdd::throttle
