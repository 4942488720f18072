// Burn laws: the cumulative burned fraction X against crank angle, exact in energy for any real start and duration,
// because the heat of a step is E [X(end) - X(start)]. Angles in °CA aTDC, fractions dimensionless. noexcept, no heap.
#pragma once

#include <algorithm>
#include <cmath>

#include "mgdd/engine/cylinder.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

/// Wiebe law truncated at s = 1 and renormalised, so that X(1) = 1: [1 - exp(-a s^(m+1))]/[1 - exp(-a)] (Wiebe 1956).
/// `complete` is 1 - exp(-a): one for a whole burn.
template <class T>
T wiebe_fraction(const T& s, const T& a, const T& m, const T& complete) noexcept {
  using std::exp;
  using std::pow;
  if (value_of(s) <= 0.0) return T(0.0);
  if (value_of(s) >= 1.0) return T(1.0);
  return (1.0 - exp(-(a * pow(s, m + 1.0)))) / complete;
}
template <class T>
T wiebe_fraction(const T& s, const T& a, const T& m) noexcept {
  using std::exp;
  return wiebe_fraction(s, a, m, T(1.0 - exp(-a)));
}

/// Triangular heat release, peak 2 E / duration at half the duration. Tan 2018, eqs 2-7 to 2-10, print a slope that
/// does not release E; this is the cumulative form that does.
template <class T>
T triangle_fraction(const T& s) noexcept {
  if (value_of(s) <= 0.0) return T(0.0);
  if (value_of(s) <= 0.5) return 2.0 * s * s;
  if (value_of(s) < 1.0) return 1.0 - 2.0 * (1.0 - s) * (1.0 - s);
  return T(1.0);
}

/// One burn, ready to be evaluated: shape with its start and duration.
template <class T>
struct Burn {
  BurnShape shape;
  T soc_cad, duration_cad;
  T a, m;                                                              // Wiebe
  T complete{1.0};                                                     // 1 - exp(-a)
  T second_fraction, second_delay_cad, second_duration_cad, second_m;  // double Wiebe (Miyamoto et al. 1985)

  Burn(const BurnParameters<T>& c, const T& soc, const T& duration) noexcept
      : shape(c.burn_shape),
        soc_cad(soc),
        duration_cad(duration),
        a(c.wiebe_a),
        m(c.wiebe_m),
        second_fraction(c.second_fraction),
        second_delay_cad(c.second_delay_cad),
        second_duration_cad(c.second_duration_cad),
        second_m(c.second_wiebe_m) {
    using std::exp;
    if (shape != BurnShape::triangle) complete = 1.0 - exp(-a);
  }

  /// First and last angle with heat release.
  double start_cad() const noexcept {
    const double first = value_of(soc_cad);
    return shape == BurnShape::double_wiebe ? std::min(first, first + value_of(second_delay_cad)) : first;
  }
  double end_cad() const noexcept {
    const double first = value_of(soc_cad) + value_of(duration_cad);
    if (shape != BurnShape::double_wiebe) return first;
    return std::max(first, value_of(soc_cad) + value_of(second_delay_cad) + value_of(second_duration_cad));
  }

  T fraction(double crank_angle_cad) const noexcept { return fraction_of(T(crank_angle_cad)); }

  /// The angle may itself carry a derivative, which the implicit CA10/50/90 of the double Wiebe need.
  T fraction_of(const T& crank_angle_cad) const noexcept {
    const T s = (crank_angle_cad - soc_cad) / duration_cad;
    switch (shape) {
      case BurnShape::triangle:
        return triangle_fraction(s);
      case BurnShape::wiebe:
        return wiebe_fraction(s, a, m, complete);
      case BurnShape::double_wiebe:
        break;
    }
    const T s2 = (crank_angle_cad - soc_cad - second_delay_cad) / second_duration_cad;
    return (1.0 - second_fraction) * wiebe_fraction(s, a, m, complete) +
           second_fraction * wiebe_fraction(s2, a, second_m, complete);
  }

  /// Angle at which the fraction x in (0, 1) is burned: closed form, for the double Wiebe false position plus one
  /// Newton step in T, which carries the exact derivative (implicit function theorem).
  T angle_of(double x) const noexcept {
    using std::exp;
    using std::log;
    using std::pow;
    using std::sqrt;
    if (shape == BurnShape::triangle) {
      return soc_cad + duration_cad * (x <= 0.5 ? std::sqrt(0.5 * x) : 1.0 - std::sqrt(0.5 * (1.0 - x)));
    }
    if (shape == BurnShape::wiebe) {
      return soc_cad + duration_cad * pow(-log(1.0 - x * complete) / a, 1.0 / (m + 1.0));
    }
    const double root = double_wiebe_angle(x);
    const double slope = slope_at(root);
    if (!(slope > 0.0)) return soc_cad + (root - value_of(soc_cad));  // a plateau between two burns moves with SOC
    return T(root) + (x - fraction(root)) / slope;
  }

  /// The same for the double Wiebe as a plain number: false position between start and end (Illinois form; Dowell and
  /// Jarratt 1971), to 1e-11 of the heat.
  double double_wiebe_angle(double x) const noexcept {
    double low = start_cad(), high = end_cad();
    double below = -x, above = 1.0 - x;
    double root = low;
    for (int i = 0, side = 0; i < 100; ++i) {
      root = i < 4 ? 0.5 * (low + high) : (low * above - high * below) / (above - below);
      const double error = value_of(fraction(root)) - x;
      if (std::abs(error) < 1e-11) break;
      if (error < 0.0) {
        low = root, below = error;
        if (side == -1) above *= 0.5;
        side = -1;
      } else {
        high = root, above = error;
        if (side == 1) below *= 0.5;
        side = 1;
      }
    }
    return root;
  }

  /// dX/dphi [1/°CA], exact, through a one-direction dual in the angle.
  double slope_at(double crank_angle_cad) const noexcept {
    using One = Dual<1>;
    BurnParameters<One> c;
    c.burn_shape = shape;
    c.wiebe_a = value_of(a);
    c.wiebe_m = value_of(m);
    c.second_fraction = value_of(second_fraction);
    c.second_delay_cad = value_of(second_delay_cad);
    c.second_duration_cad = value_of(second_duration_cad);
    c.second_wiebe_m = value_of(second_m);
    const Burn<One> burn(c, One(value_of(soc_cad)), One(value_of(duration_cad)));
    return burn.fraction_of(One::seeded(crank_angle_cad, 0)).grad[0];
  }
};

}  // namespace mgdd::engine
