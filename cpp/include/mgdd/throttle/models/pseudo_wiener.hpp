// Pseudo-Wiener models of a throttle behind one interface: PW-R (default), PW-W and PW-P as a variant; what runs on
// them (free run, prediction, observer) stands in dynamics/. Units: deg, s, duty.
// Everything on a prepared model is noexcept and allocation-free; checks and names are not real-time safe.
// "Pseudo": a true Wiener model is linear and then memoryless, which friction and preload are not.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/dynamics/discrete_model.hpp"
#include "mgdd/throttle/models/pw_p.hpp"
#include "mgdd/throttle/models/pw_r.hpp"
#include "mgdd/throttle/models/pw_w.hpp"

namespace mgdd::throttle {

enum class PseudoWienerKind { pw_r, pw_w, pw_p };
/// The forms that PW-R has: "set_valued" and "tanh".
Names<Friction> dry_friction_names() noexcept;

/// What a controller and an observer ask of a prepared model of any kind.
template <class M>
concept ThrottleModel =
    dynamics::StartsAtRest<M> &&
    requires(const M& model, typename M::State& state, const typename M::Scalar& value, const ObserverGains& gains) {
      { model.at_rest(value, value) } noexcept -> std::same_as<typename M::State>;
      { model.correct(state, value, gains) } noexcept;
    };

/// Parameters of any kind, and the states that belong to them.
using PseudoWiener = std::variant<PwR, PwW, PwP>;
using PseudoWienerState = std::variant<PwRState, PwWState, PwPState>;
using PseudoWienerModel = std::variant<PwRModel, PwWModel, PwPModel>;

/// ParameterError for settings that no model can work with.
PseudoWienerModel prepare(const PseudoWiener& parameters);
void validate(const PseudoWiener& parameters);
PseudoWienerKind kind_of(const PseudoWiener& parameters) noexcept;
const PseudoWienerFrame& frame_of(const PseudoWiener& parameters) noexcept;

namespace detail {

/// The same numbers with another scalar, derivatives zero.
template <class T, std::size_t n>
std::array<T, n> lift_all(const std::array<double, n>& a) noexcept {
  std::array<T, n> out{};
  for (std::size_t i = 0; i < n; ++i)
    out[i] = T(a[i]);
  return out;
}

}  // namespace detail

template <class T>
BasicPwRSide<T> lift(const PwRSide& s) noexcept {
  return {T(s.tau_s),        T(s.gain_deg_per_s2_per_duty), T(s.preload_duty), T(s.spring_duty_per_deg),
          T(s.coulomb_duty), T(s.square_per_deg),           T(s.cube_per_deg2)};
}
template <class T>
BasicPwR<T> lift(const PwR& p) noexcept {
  return {lift<T>(p.above), lift<T>(p.below), T(p.limp_home_deg), p.frame,   p.ramp_deg,
          p.tanh_deg_per_s, p.dead_band_deg,  p.switching,        p.friction};
}
template <class T>
BasicPwW<T> lift(const PwW& p) noexcept {
  return {T(p.first_s),
          T(p.second_s),
          T(p.base_deg),
          detail::lift_all<T>(p.rise_deg),
          T(p.limp_home_deg),
          p.knot_lower_duty,
          p.knot_upper_duty,
          p.lag_start,
          p.frame};
}
template <class T>
BasicPwP<T> lift(const PwP& p) noexcept {
  return {T(p.first_s),
          T(p.second_s),
          T(p.offset_deg),
          detail::lift_all<T>(p.radius_duty),
          detail::lift_all<T>(p.gain_deg_per_duty),
          T(p.limp_home_deg),
          p.plays,
          p.lag_start,
          p.frame};
}
/// The model of a kind, checked (ParameterError) or, for on-line code, with settings that were checked before.
template <class T, class... Checked>
BasicPwRModel<T> model_of(const BasicPwR<T>& p, Checked... checked) noexcept(sizeof...(Checked) == 1) {
  return BasicPwRModel<T>(p, checked...);
}
template <class T, class... Checked>
BasicPwWModel<T> model_of(const BasicPwW<T>& p, Checked... checked) noexcept(sizeof...(Checked) == 1) {
  return BasicPwWModel<T>(p, checked...);
}
template <class T, class... Checked>
BasicPwPModel<T> model_of(const BasicPwP<T>& p, Checked... checked) noexcept(sizeof...(Checked) == 1) {
  return BasicPwPModel<T>(p, checked...);
}

// --- parameters by name ---------------------------------------------------------------------------------------

/// All numbers of a kind in a fixed order, their domains as the bounds of a search. `plays` matters for PW-P only.
std::span<const FieldInfo> fields(PseudoWienerKind kind) noexcept;

/// Numbers in the order of `fields`; PW-P lists all eight plays, those beyond `plays` zero.
inline constexpr std::size_t n_pw_r = 15;
inline constexpr std::size_t n_pw_w = 10;
inline constexpr std::size_t n_pw_p = 20;

/// Pointers to the numbers of a parameter set in the order of `fields`.
template <class P>
auto numbers(P&& parameters) noexcept {
  return std::remove_cvref_t<P>::numbers(parameters);
}

/// The models of a kind with the settings of `base`, which must be valid; a free run starts at a measured angle.
template <class P>
struct PseudoWienerFamily {
  static constexpr int n_parameters = static_cast<int>(decltype(numbers(std::declval<P&>())){}.size());
  static constexpr int n_start = 1;

  P base{};

  template <class T>
  auto prepare(const dynamics::Values<T, n_parameters>& values, double sample_s) const noexcept {
    auto p = lift<T>(base);
    p.frame.sample_s = sample_s;
    const auto places = numbers(p);
    for (std::size_t i = 0; i < values.size(); ++i)
      *places[i] = values[i];
    return model_of(p, unchecked);
  }
  template <class T, class Model>
  auto start(const Model& model, const dynamics::Values<T, 1>& angle_deg) const noexcept {
    return model.at_rest(angle_deg[0], T(0.0));
  }
};

}  // namespace mgdd::throttle
