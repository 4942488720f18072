// One problem of the guided predictive controller: from where, to where, inside which limits; and the Gauss-Newton step
// of its three moves along the exact slopes of the prediction (Diehl et al. 2005). Angles in deg, duty -1..1.
// noexcept, heap-free, on double and float.
#pragma once

#include <array>

#include "mgdd/control/guided_predictive_settings.hpp"
#include "mgdd/control/plate_model.hpp"

namespace mgdd::control {

/// Duties of the horizon, the first one acts next.
template <class T>
using GuidedMoves = std::array<T, static_cast<std::size_t>(n_guided_moves)>;

/// One problem of the horizon: what is predicted from, to where, and where the first duty may lie.
template <class T>
struct GuidedHorizon {
  PlateState<T> ahead{};  // when the first duty acts
  std::array<T, longest_guided_horizon> target{};
  T before{0.0};  // the duty before it, without trim
  T acting{0.0};  // and with it
  T lowest{0.0}, highest{0.0};
  T aim{0.0};     // where it shall be soon
  T wanted{0.0};  // way that it shall go
};

/// Moves the duties by one step, inside the limits; gives whether they changed.
template <class T>
bool gauss_newton_step(const PlateModel<T>& model, const GuidedPredictiveSettings& settings,
                       const GuidedHorizon<T>& horizon, GuidedMoves<T>& moves) noexcept;

extern template bool gauss_newton_step(const PlateModel<double>&, const GuidedPredictiveSettings&,
                                       const GuidedHorizon<double>&, GuidedMoves<double>&) noexcept;
extern template bool gauss_newton_step(const PlateModel<float>&, const GuidedPredictiveSettings&,
                                       const GuidedHorizon<float>&, GuidedMoves<float>&) noexcept;

}  // namespace mgdd::control
