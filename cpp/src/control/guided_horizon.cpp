#include "mgdd/control/guided_horizon.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "mgdd/control/move_qp.hpp"
#include "mgdd/dynamics/predict.hpp"

namespace mgdd::control {
template <class T>
bool gauss_newton_step(const PlateModel<T>& model, const GuidedPredictiveSettings& s, const GuidedHorizon<T>& horizon,
                       GuidedMoves<T>& moves) noexcept {
  using Moves = GuidedMoves<T>;
  constexpr auto n = static_cast<std::size_t>(n_guided_moves);
  const auto steps = static_cast<std::size_t>(s.n_steps());
  std::array<T, longest_guided_horizon> outputs;     // NOLINT(cppcoreguidelines-pro-type-member-init): filled below,
  std::array<Moves, longest_guided_horizon> slopes;  // NOLINT(cppcoreguidelines-pro-type-member-init): as far as read
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
    low[i] = std::max(T(s.duty.lower), horizon.before - room) - moves[i];
    high[i] = std::min(T(s.duty.upper), horizon.before + room) - moves[i];
    room += T(s.duty_rate_per_s * s.prediction_step_s) * T(s.move_steps[i]);
  }
  const Moves change = qp.solve(low, high, T(1.001), T(1e-6));
  T most = T(0.0);
  for (std::size_t i = 0; i < n; ++i) {
    moves[i] += change[i];
    most = std::max(most, std::abs(change[i]));
  }
  return most > T(1e-5);
}

template bool gauss_newton_step(const PlateModel<double>&, const GuidedPredictiveSettings&,
                                const GuidedHorizon<double>&, GuidedMoves<double>&) noexcept;
template bool gauss_newton_step(const PlateModel<float>&, const GuidedPredictiveSettings&, const GuidedHorizon<float>&,
                                GuidedMoves<float>&) noexcept;

}  // namespace mgdd::control
