#include "mgdd/control/guided_horizon.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "mgdd/control/move_qp.hpp"
#include "mgdd/dynamics/predict.hpp"

namespace mgdd::control {
namespace {

template <class T>
T performance(const GuidedPredictiveSettings& s, const GuidedHorizon<T>& horizon, const GuidedMoves<T>& moves,
              std::span<const T> output) noexcept {
  const T over_step = T(1.0 / s.prediction_step_s);
  T sum = T(0.0), last_output = horizon.ahead.angle_deg, last_move = horizon.before;
  for (std::size_t k = 0; k < output.size(); ++k) {
    const T error = output[k] - horizon.target[k], speed = (output[k] - last_output) * over_step;
    const T beyond = output[k] - std::clamp(output[k], T(s.lowest_deg), T(s.highest_deg));
    sum += T(s.error_weight) * error * error + T(s.speed_weight) * speed * speed +
           T(s.angle_limit_weight) * beyond * beyond;
    last_output = output[k];
  }
  for (const T move : moves) {
    sum += T(s.duty_change_weight) * (move - last_move) * (move - last_move);
    last_move = move;
  }
  return sum;
}

}  // namespace

template <class T>
bool gauss_newton_step(const PlateModel<T>& model, const GuidedPredictiveSettings& s, const GuidedHorizon<T>& horizon,
                       GuidedMoves<T>& moves) noexcept {
  using Moves = GuidedMoves<T>;
  constexpr auto n = static_cast<std::size_t>(n_guided_moves);
  const auto steps = static_cast<std::size_t>(s.n_steps());
  std::array<T, longest_guided_horizon> outputs;
  std::array<Moves, longest_guided_horizon> slopes;
  const std::span<T> output(outputs.data(), steps);
  dynamics::predict<n_guided_moves>(model, horizon.ahead, moves, s.move_steps, output,
                                    std::span<Moves>(slopes.data(), steps));
  MoveQp<T, n_guided_moves> qp;
  const T speed_weight = T(s.speed_weight / (s.prediction_step_s * s.prediction_step_s));
  for (std::size_t k = 0; k < steps; ++k) {
    qp.add(T(s.error_weight), output[k] - horizon.target[k], slopes[k]);
    if (speed_weight > T(0.0)) {
      Moves change = slopes[k];
      for (std::size_t i = 0; i < n && k > 0; ++i)
        change[i] -= slopes[k - 1][i];
      qp.add(speed_weight, output[k] - (k == 0 ? horizon.ahead.angle_deg : output[k - 1]), change);
    }
    const T beyond = output[k] - std::clamp(output[k], T(s.lowest_deg), T(s.highest_deg));
    if (beyond != T(0.0)) qp.add(T(s.angle_limit_weight), beyond, slopes[k]);
  }
  qp.add_changes(T(s.duty_change_weight), moves, horizon.before);
  Moves low, high;
  T room = T(s.duty_rate_per_s * s.sample_s);
  for (std::size_t i = 0; i < n; ++i) {
    low[i] = std::max(T(s.lower), horizon.before - room) - moves[i];
    high[i] = std::min(T(s.upper), horizon.before + room) - moves[i];
    room += T(s.duty_rate_per_s * s.prediction_step_s) * T(s.move_steps[i]);
  }
  const Moves before = moves;
  const auto moved = [&](T scale) {
    const Moves change = qp.solve(low, high, T(1.0) + T(1e-3) * scale, T(1e-6) * scale);
    T most = T(0.0);
    for (std::size_t i = 0; i < n; ++i) {
      moves[i] = before[i] + change[i];
      most = std::max(most, std::abs(change[i]));
    }
    return most > T(1e-5);
  };
  const bool changed = moved(T(1.0));
  if (s.friction_learning || s.prediction == Prediction::linear || !changed) return changed;
  // Not lower after the step: ten times the damping, once.
  const Moves after = std::exchange(moves, before);
  const T performance_before = performance<T>(s, horizon, moves, output);
  moves = after;
  auto state = horizon.ahead;
  for (std::size_t i = 0, k = 0; i < n; ++i) {
    for (int j = 0; j < s.move_steps[i]; ++j, ++k) {
      model.step(state, moves[i]);
      output[k] = state.angle_deg;
    }
  }
  if (performance<T>(s, horizon, moves, output) < performance_before) return true;
  return moved(T(10.0));
}

template bool gauss_newton_step(const PlateModel<double>&, const GuidedPredictiveSettings&,
                                const GuidedHorizon<double>&, GuidedMoves<double>&) noexcept;
template bool gauss_newton_step(const PlateModel<float>&, const GuidedPredictiveSettings&, const GuidedHorizon<float>&,
                                GuidedMoves<float>&) noexcept;

}  // namespace mgdd::control
