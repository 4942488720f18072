// PW-W, the strict Wiener model of a throttle: two lags, then a monotone piecewise-linear map of seven knots.
// Units: deg, s, duty. Nine parameters. Every step is noexcept and allocation-free; T is double, Dual<N> or Lanes<N>.
// Memoryless behind the lags, so it cannot know where friction left the plate: correct it by the measurement.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <type_traits>

#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"

namespace mgdd::throttle {

inline constexpr int wiener_knots = 7;

/// ParameterError for settings of PW-W outside their domain.
void check_pw_w(const PseudoWienerFrame& frame, double knot_lower_duty, double knot_upper_duty);

template <class T>
struct BasicPwW {
  T first_s{0.05};
  T second_s{0.5};
  T base_deg{0.0};                                                       ///< output at the lowest knot
  std::array<T, static_cast<std::size_t>(wiener_knots - 1)> rise_deg{};  ///< from knot to knot, >= 0
  T limp_home_deg{8.0};  ///< not part of the law; unused; kept for a common interface
  double knot_lower_duty = -0.2;
  double knot_upper_duty = 0.6;
  LagStart lag_start = LagStart::rest;
  PseudoWienerFrame frame{};

  bool operator==(const BasicPwW&) const = default;

  /// ParameterError naming field, value and bound; on double only.
  void validate() const;
  void validate_settings() const { check_pw_w(frame, knot_lower_duty, knot_upper_duty); }

  /// The numbers in the order of `fields`.
  template <class Self>
  static auto numbers(Self& p) noexcept {
    return std::apply(
        [&](auto&... rise) { return std::array{&p.first_s, &p.second_s, &p.base_deg, &rise..., &p.limp_home_deg}; },
        p.rise_deg);
  }
};
using PwW = BasicPwW<double>;

template <class T>
struct BasicPwWState {
  T offset_deg{0.0};  ///< what an observer adds to the output
  T first_duty{0.0};
  T second_duty{0.0};
  DutyLine<T> line{};
};

/// Coefficients C on states of T: the same, or plain numbers on duals.
template <class T, class C = T>
class BasicPwWModel {
 public:
  using Scalar = T;
  using Parameters = BasicPwW<C>;
  using State = BasicPwWState<T>;
  using Input = T;
  static constexpr int n_observed = 1;

  /// ParameterError for settings that no model can work with (`validate_settings`); bounds of numbers are a search's.
  explicit BasicPwWModel(const Parameters& parameters)
      : BasicPwWModel((parameters.validate_settings(), parameters), unchecked) {}
  BasicPwWModel(const Parameters& parameters, Unchecked) noexcept
      : p_(parameters),
        delay_(parameters.frame.delay()),
        lags_(parameters.first_s, parameters.second_s, parameters.frame.sample_s),
        width_((parameters.knot_upper_duty - parameters.knot_lower_duty) / (wiener_knots - 1)) {}

  MGDD_INLINE void step(State& s, const T& duty) const noexcept {
    lags_.step(s.first_duty, s.second_duty, s.line.pass(duty, delay_));
  }

  MGDD_INLINE T output(const State& s) const noexcept { return map(s.second_duty) + s.offset_deg; }
  double sample_s() const noexcept { return p_.frame.sample_s; }

  /// The static map; constant beyond the outer knots.
  MGDD_INLINE T map(const T& x) const noexcept {
    T y(p_.base_deg);
    const T place = (x - T(p_.knot_lower_duty)) * T(1.0 / width_);
    for (std::size_t i = 0; i < p_.rise_deg.size(); ++i) {
      y += p_.rise_deg[i] * larger(smaller(place - T(static_cast<double>(i)), T(1.0)), T(0.0));
    }
    return y;
  }

  /// Start of a free run at an angle, `duty` in the delay line.
  State at_rest(const T& angle_deg, const T& duty = T(0.0)) const noexcept {
    State s;
    if (p_.lag_start == LagStart::inverse_map) s.first_duty = s.second_duty = inverse_map(angle_deg);
    s.line.fill(duty);
    return s;
  }

  /// With `offset_gain` 1 the prediction is y_measured(k) + sim(k + H) - sim(k).
  MGDD_INLINE void correct(State& s, const T& angle_deg, const ObserverGains& gains) const noexcept {
    s.offset_deg += T(gains.offset_gain) * (angle_deg - output(s));
  }

  const Parameters& parameters() const noexcept { return p_; }
  template <class U>
  BasicPwWModel<U, C> over() const noexcept {
    return BasicPwWModel<U, C>(*this);
  }
  template <class S>
  static auto numbers(S& s) noexcept {
    return std::apply(
        [&](auto&... before) { return std::array{&s.offset_deg, &s.first_duty, &s.second_duty, &before...}; },
        s.line.before);
  }

 private:
  template <class, class>
  friend class BasicPwWModel;
  template <class V>
  explicit BasicPwWModel(const BasicPwWModel<V, C>& o) noexcept
      : p_(o.p_), delay_(o.delay_), lags_(o.lags_), width_(o.width_) {}

  // Bisection for the place, one Newton step for the derivatives; the lowest such place where the map is flat, its end
  // for an angle beyond it.
  T inverse_map(const T& angle_deg) const noexcept {
    constexpr double edge = std::is_same_v<T, float> ? 1e-3 : 1e-6;
    T low = T(p_.knot_lower_duty);
    T high = T(p_.knot_upper_duty);
    for (int i = 0; i < 50; ++i) {
      const T middle = T(0.5) * (low + high);
      const auto below = map(middle) < angle_deg;
      low = select(below, middle, low);
      high = select(below, high, middle);
    }
    const T slope = (map(low + T(edge)) - map(low - T(edge))) * T(0.5 / edge);
    const T safe = larger(slope, T(1.0));
    const T place = low + (angle_deg - map(low)) / safe;
    return select(slope > T(1.0), larger(smaller(place, T(p_.knot_upper_duty)), T(p_.knot_lower_duty)), low);
  }

  Parameters p_;
  dynamics::Delay delay_;
  LagPair<C> lags_;
  double width_;
};
using PwWState = BasicPwWState<double>;
using PwWModel = BasicPwWModel<double>;

}  // namespace mgdd::throttle
