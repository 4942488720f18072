// Pseudo-Wiener models of a throttle behind one interface: PW-R (default), PW-W and PW-P as a variant, with free run,
// prediction of a horizon with sensitivities, and re-anchoring on a measurement. Units: deg, s, duty.
// Everything on a prepared model is noexcept and allocation-free; checks and names are desk-time.
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
#include "mgdd/throttle/models/pw_p.hpp"
#include "mgdd/throttle/models/pw_r.hpp"
#include "mgdd/throttle/models/pw_w.hpp"

namespace mgdd::throttle {

enum class PseudoWienerKind { pw_r, pw_w, pw_p };
Names<PseudoWienerKind> pseudo_wiener_names() noexcept;
Names<Switching> switching_names() noexcept;
Names<LagStart> lag_start_names() noexcept;
Names<DryFriction> dry_friction_names() noexcept;

/// What a prepared model of any kind can do.
template <class M>
concept PseudoWienerModelKind = std::is_trivially_copyable_v<typename M::State> &&
                                requires(const M& model, typename M::State& state, double value, const Anchor& anchor) {
                                  { model.advance(state, value) } noexcept;
                                  { model.output(state) } noexcept -> std::same_as<double>;
                                  { model.at_rest(value, value) } noexcept -> std::same_as<typename M::State>;
                                  { model.reanchor(state, value, anchor) } noexcept;
                                  { model.parameters() } noexcept;
                                };
static_assert(PseudoWienerModelKind<PwRModel> && PseudoWienerModelKind<PwWModel> && PseudoWienerModelKind<PwPModel>);

/// Parameters of any kind, and the states that belong to them.
using PseudoWiener = std::variant<PwR, PwW, PwP>;
using PseudoWienerState = std::variant<PwRState, PwWState, PwPState>;
using PseudoWienerModel = std::variant<PwRModel, PwWModel, PwPModel>;

PseudoWienerModel prepare(const PseudoWiener& parameters) noexcept;
void validate(const PseudoWiener& parameters);
PseudoWienerKind kind_of(const PseudoWiener& parameters) noexcept;
const PseudoWienerFrame& frame_of(const PseudoWiener& parameters) noexcept;

/// Free run: entry k is the angle [deg] at sample k; duty[k] acts until sample k + 1. `state` ends at the last sample.
template <class Model, class T>
void simulate(const Model& model, typename Model::State& state, std::span<const T> duty,
              std::span<T> angle_deg) noexcept {
  for (std::size_t k = 0; k < duty.size(); ++k) {
    angle_deg[k] = model.output(state);
    if (k + 1 < duty.size()) model.advance(state, duty[k]);
  }
}

/// The horizon ahead of `state`: entry j is the angle [deg] after duty[0..j] have acted.
template <class Model, class T>
void predict(const Model& model, typename Model::State state, std::span<const T> duty,
             std::span<T> angle_deg) noexcept {
  for (std::size_t k = 0; k < duty.size(); ++k) {
    model.advance(state, duty[k]);
    angle_deg[k] = model.output(state);
  }
}

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
template <class T>
DelayLine<T> lift(const DelayLine<double>& line) noexcept {
  return {detail::lift_all<T>(line.before)};
}
template <class T>
BasicPwRState<T> lift(const PwRState& s) noexcept {
  return {T(s.position_deg), T(s.speed_deg_per_s), T(s.bias_duty), T(s.above), lift<T>(s.line)};
}
template <class T>
BasicPwWState<T> lift(const PwWState& s) noexcept {
  return {T(s.first_duty), T(s.second_duty), T(s.offset_deg), lift<T>(s.line)};
}
template <class T>
BasicPwPState<T> lift(const PwPState& s) noexcept {
  return {T(s.first_duty), T(s.second_duty), detail::lift_all<T>(s.play_duty), T(s.offset_deg), lift<T>(s.line)};
}

/// The model of a kind over a scalar.
template <class T>
BasicPwRModel<T> model_of(const BasicPwR<T>& p) noexcept {
  return BasicPwRModel<T>(p);
}
template <class T>
BasicPwWModel<T> model_of(const BasicPwW<T>& p) noexcept {
  return BasicPwWModel<T>(p);
}
template <class T>
BasicPwPModel<T> model_of(const BasicPwP<T>& p) noexcept {
  return BasicPwPModel<T>(p);
}

/// The horizon under M moves: the duty is moves[m] for lengths[m] samples. Angle [deg] per sample and its exact
/// sensitivities d angle / d move [deg/duty]. `model` is the one over Dual<M>: prepare it once with
/// model_of(lift<Dual<M>>(parameters)).
template <int M, class DualModel, class State>
void predict_moves(const DualModel& model, const State& state,
                   const std::array<double, static_cast<std::size_t>(M)>& moves,
                   const std::array<int, static_cast<std::size_t>(M)>& lengths, std::span<double> angle_deg,
                   std::span<std::array<double, static_cast<std::size_t>(M)>> slope_deg) noexcept {
  auto s = lift<Dual<M>>(state);
  std::size_t k = 0;
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const auto duty = Dual<M>::seeded(moves[m], static_cast<int>(m));
    for (int i = 0; i < lengths[m]; ++i, ++k) {
      model.advance(s, duty);
      const Dual<M> y = model.output(s);
      angle_deg[k] = y.value;
      slope_deg[k] = y.grad;
    }
  }
}

// --- parameters by name ---------------------------------------------------------------------------------------

/// One number of a model: as a table row and as the bounds of a search.
struct PseudoWienerField {
  std::string_view name;
  std::string_view unit;
  double lower;
  double upper;
  bool log_scaled;
  std::string_view meaning;
};

/// All numbers of a kind in a fixed order. `plays` matters for PW-P only.
std::span<const PseudoWienerField> fields(PseudoWienerKind kind) noexcept;

/// Numbers in the order of `fields`; PW-P lists all eight plays, those beyond `plays` zero.
inline constexpr std::size_t n_pw_r = 15;
inline constexpr std::size_t n_pw_w = 10;
inline constexpr std::size_t n_pw_p = 20;

template <class T>
using PwRNumbers = std::array<T, n_pw_r>;
template <class T>
using PwWNumbers = std::array<T, n_pw_w>;
template <class T>
using PwPNumbers = std::array<T, n_pw_p>;

/// References to the numbers of a parameter set in the order of `fields`.
template <class T, class Self>
auto numbers_of_pw_r(Self& p) noexcept {
  using P = std::conditional_t<std::is_const_v<Self>, const T*, T*>;
  return std::array<P, n_pw_r>{&p.above.tau_s,
                               &p.above.gain_deg_per_s2_per_duty,
                               &p.above.preload_duty,
                               &p.above.spring_duty_per_deg,
                               &p.above.coulomb_duty,
                               &p.above.square_per_deg,
                               &p.above.cube_per_deg2,
                               &p.below.tau_s,
                               &p.below.gain_deg_per_s2_per_duty,
                               &p.below.preload_duty,
                               &p.below.spring_duty_per_deg,
                               &p.below.coulomb_duty,
                               &p.below.square_per_deg,
                               &p.below.cube_per_deg2,
                               &p.limp_home_deg};
}
template <class T>
auto numbers(BasicPwR<T>& p) noexcept {
  return numbers_of_pw_r<T>(p);
}
template <class T>
auto numbers(const BasicPwR<T>& p) noexcept {
  return numbers_of_pw_r<T>(p);
}
template <class T, class Self>
auto numbers_of_pw_w(Self& p) noexcept {
  using P = std::conditional_t<std::is_const_v<Self>, const T*, T*>;
  std::array<P, n_pw_w> out{&p.first_s, &p.second_s, &p.base_deg};
  for (std::size_t i = 0; i < p.rise_deg.size(); ++i)
    out[3 + i] = &p.rise_deg[i];
  out[9] = &p.limp_home_deg;
  return out;
}
template <class T>
auto numbers(BasicPwW<T>& p) noexcept {
  return numbers_of_pw_w<T>(p);
}
template <class T>
auto numbers(const BasicPwW<T>& p) noexcept {
  return numbers_of_pw_w<T>(p);
}
template <class T, class Self>
auto numbers_of_pw_p(Self& p) noexcept {
  using P = std::conditional_t<std::is_const_v<Self>, const T*, T*>;
  std::array<P, n_pw_p> out{&p.first_s, &p.second_s, &p.offset_deg};
  for (std::size_t i = 0; i < p.radius_duty.size(); ++i) {
    out[3 + 2 * i] = &p.radius_duty[i];
    out[4 + 2 * i] = &p.gain_deg_per_duty[i];
  }
  out[19] = &p.limp_home_deg;
  return out;
}
template <class T>
auto numbers(BasicPwP<T>& p) noexcept {
  return numbers_of_pw_p<T>(p);
}
template <class T>
auto numbers(const BasicPwP<T>& p) noexcept {
  return numbers_of_pw_p<T>(p);
}

}  // namespace mgdd::throttle
