// Scalars of one cycle: work, efficiency, peaks and burn angles, in the units of the field.
// Definitions: Heywood 1988, chapters 2, 9 and 15; ringing intensity: Eng 2002.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/dual.hpp"
#include "mgdd/math/select.hpp"

namespace mgdd::engine {

template <class T>
struct Indicators {                     // every value starts as NaN: nothing has been computed yet
  T imep_closed_bar = undefined<T>();   ///< trapezoid of p dV from IVC to EVO over the swept volume
  T imep_gross_bar = undefined<T>();    ///< closed plus the ideal remainder of -180..180 CAD
  T efficiency_gross = undefined<T>();  ///< gross work over fuel heat; NaN when motored
  T p_max_bar = undefined<T>();
  T p_max_cad = undefined<T>();
  T dp_max_bar_per_cad = undefined<T>();
  T dp_max_cad = undefined<T>();
  T t_max_k = undefined<T>();
  T t_max_cad = undefined<T>();
  T ca10_cad = undefined<T>();  ///< burn angles of the burn law; NaN when motored
  T ca50_cad = undefined<T>();
  T ca90_cad = undefined<T>();
  T heat_loss_j = undefined<T>();
  T heat_loss_fraction = undefined<T>();
  T work_closed_j = undefined<T>();
  T work_gross_j = undefined<T>();
  T ringing_intensity_mw_per_m2 = undefined<T>();
};

template <class T>
struct IndicatorField {
  std::string_view name, unit;
  T Indicators<T>::* member;
};

template <class T>
constexpr auto indicator_fields() {
  using I = Indicators<T>;
  using F = IndicatorField<T>;
  return std::array{F{"imep_closed_bar", "bar", &I::imep_closed_bar},
                    F{"imep_gross_bar", "bar", &I::imep_gross_bar},
                    F{"efficiency_gross", "-", &I::efficiency_gross},
                    F{"p_max_bar", "bar", &I::p_max_bar},
                    F{"p_max_cad", "°CA aTDC", &I::p_max_cad},
                    F{"dp_max_bar_per_cad", "bar/°CA", &I::dp_max_bar_per_cad},
                    F{"dp_max_cad", "°CA aTDC", &I::dp_max_cad},
                    F{"t_max_k", "K", &I::t_max_k},
                    F{"t_max_cad", "°CA aTDC", &I::t_max_cad},
                    F{"ca10_cad", "°CA aTDC", &I::ca10_cad},
                    F{"ca50_cad", "°CA aTDC", &I::ca50_cad},
                    F{"ca90_cad", "°CA aTDC", &I::ca90_cad},
                    F{"heat_loss_j", "J", &I::heat_loss_j},
                    F{"heat_loss_fraction", "-", &I::heat_loss_fraction},
                    F{"work_closed_j", "J", &I::work_closed_j},
                    F{"work_gross_j", "J", &I::work_gross_j},
                    F{"ringing_intensity_mw_per_m2", "MW/m²", &I::ringing_intensity_mw_per_m2}};
}

/// A peak among the samples of a trace, with its neighbours; the angles are plain numbers. One without two neighbours
/// stands for all three.
template <class T>
struct PeakSamples {
  using Angle = typename PlainScalar<T>::type;
  Angle before_cad, at_cad, after_cad;
  T before, at, after;
};

template <class T>
struct Peak {
  T angle_cad, value;  ///< vertex of the parabola
};

/// Vertex of the parabola through the samples; the middle one itself on a plateau.
template <class T>
MGDD_INLINE Peak<T> parabola_peak(const PeakSamples<T>& s) noexcept {
  const auto left = s.at_cad - s.before_cad, right = s.after_cad - s.at_cad;
  const T rise = (s.at - s.before) / left;
  const T fall = (s.after - s.at) / right;
  const T bend = (fall - rise) / (left + right);
  const auto curved = bend < T(0.0);
  const T offset = (rise / bend) * -0.5 + 0.5 * left;  // from the left neighbour to the vertex
  return {select(curved, T(offset + s.before_cad), T(s.at_cad)),
          select(curved, T(s.before + rise * offset + bend * offset * (offset - left)), s.at)};
}

/// Sample k and its neighbours; `sample(k)` gives the values.
template <class T, class Sample>
PeakSamples<T> samples_around(std::span<const double> angle_cad, std::size_t k, const Sample& sample) noexcept {
  const T at = sample(k);
  if (k == 0 || k + 1 >= angle_cad.size()) return {angle_cad[k] - 1.0, angle_cad[k], angle_cad[k] + 1.0, at, at, at};
  return {angle_cad[k - 1], angle_cad[k], angle_cad[k + 1], sample(k - 1), at, sample(k + 1)};
}

/// RI = (beta dp/dt)^2 / (2 gamma p_max) sqrt(gamma R T_max), beta = 0.05 ms (Eng 2002), in MW/m2.
template <class T>
MGDD_INLINE T ringing_intensity_mw_per_m2(const T& gamma, const T& dp_dt_pa_per_s, const T& p_max_pa,
                                          const T& t_max_k) noexcept {
  using std::sqrt;
  constexpr double beta_s = 0.05e-3;
  constexpr double air_gas_constant_j_per_kgk = 287.05;
  const T pulse = dp_dt_pa_per_s * beta_s;
  return pulse * pulse / (2.0 * gamma * p_max_pa) * sqrt(gamma * air_gas_constant_j_per_kgk * t_max_k) * 1e-6;
}

}  // namespace mgdd::engine
