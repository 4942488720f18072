// Vectors are handed over inside one inlined function: no calling convention is involved.
#pragma GCC diagnostic ignored "-Wpsabi"

#include "mgdd/identify/throttle/smooth_kernel.hpp"

#include <numbers>

// Vectors are handed over inside one inlined function: no calling convention is involved.
#pragma GCC diagnostic ignored "-Wpsabi"

#include "mgdd/math/dispatch.hpp"
#include "mgdd/math/fast_tanh.hpp"

namespace mgdd::identify {
namespace {

// NOLINTBEGIN(cppcoreguidelines-pro-type-member-init): every element is written before it is read

using Lanes2 = double __attribute__((vector_size(16)));
using Lanes8 = double __attribute__((vector_size(64)));

constexpr double deg_per_rad = 180.0 / std::numbers::pi;

// n columns of a sensitivity, each a vector over parameter sets.
template <class V, int n>
struct Columns {
  V c[n];
};
template <class V, int n>
MGDD_INLINE Columns<V, n> operator*(const V& a, const Columns<V, n>& b) noexcept {
  Columns<V, n> r;
  for (int i = 0; i < n; ++i)
    r.c[i] = a * b.c[i];
  return r;
}
template <class V, int n>
MGDD_INLINE Columns<V, n> operator+(const Columns<V, n>& a, const Columns<V, n>& b) noexcept {
  Columns<V, n> r;
  for (int i = 0; i < n; ++i)
    r.c[i] = a.c[i] + b.c[i];
  return r;
}

template <class V>
struct Layout {
  using Speed = Columns<V, 8>;    // parameters that act on the speed equation
  using Current = Columns<V, 2>;  // on the current equation: emf constant and resistance
};
template <>
struct Layout<double> {
  using Speed = Lanes8;
  using Current = Lanes2;
};

template <class V>
MGDD_INLINE void both_tanh(const V& a, const V& b, V& ta, V& tb) noexcept {
  ta = fast_tanh(a);
  tb = fast_tanh(b);
}
MGDD_INLINE void both_tanh(const double& a, const double& b, double& ta, double& tb) noexcept {
  const Lanes2 t = fast_tanh(Lanes2{a, b});
  ta = t[0];
  tb = t[1];
}

template <class V>
using Constants = throttle::SmoothCoefficients<V>;

// Right-hand side with its non-zero partial derivatives at one stage.
template <class V>
struct Stage {
  V d_angle, d_speed, d_current;
  V a10, a11;  // d d_speed / d angle, d speed; the other entries of A are constant
  typename Layout<V>::Speed by_speed;
  typename Layout<V>::Current by_current;
};

template <class V>
MGDD_INLINE void evaluate(const Constants<V>& c, const V& angle, const V& speed, const V& current, const V& drive,
                          Stage<V>& f) noexcept {
  const V deflection = angle - c.limp_home;
  const V s = speed * c.over_width;
  const V z = deflection * c.over_preload_width;
  V friction, preload;
  both_tanh(s, z, friction, preload);
  f.d_angle = speed;
  f.d_speed = throttle::SmoothPlant::acceleration<V, V>(c, speed, current, {deflection, friction, preload});
  f.d_current = throttle::SmoothPlant::current_rise<V, V, V>(c, speed, current, drive);
  const V friction_slope = c.coulomb * c.over_width * (1.0 - friction * friction);
  const V preload_slope = c.preload * c.over_preload_width * (1.0 - preload * preload);
  f.a10 = -(c.spring + preload_slope);
  f.a11 = -(c.viscous + friction_slope);
  f.by_speed = typename Layout<V>::Speed{
      c.current_to_speed * current, -c.over_inertia * speed,   -c.over_inertia * friction, friction_slope * s,
      -c.over_inertia * deflection, -c.over_inertia * preload, preload_slope * z,          -f.a10};
  f.by_current = typename Layout<V>::Current{-c.speed_to_current * speed, -c.over_inductance * current};
}

template <class V>
struct Matrix3 {
  V m[3][3];
};

// w A for A = [0 1 0; a10 a11 torque; 0 -emf -resistance].
template <class V>
MGDD_INLINE Matrix3<V> times_a(const Matrix3<V>& w, const Stage<V>& f, const Constants<V>& c) noexcept {
  Matrix3<V> r;
  for (int i = 0; i < 3; ++i) {
    r.m[i][0] = w.m[i][1] * f.a10;
    r.m[i][1] = w.m[i][0] + w.m[i][1] * f.a11 - w.m[i][2] * c.emf;
    r.m[i][2] = w.m[i][1] * c.torque - w.m[i][2] * c.resistance;
  }
  return r;
}

template <class V>
MGDD_INLINE Matrix3<V> plus_identity(double diagonal, double factor, const Matrix3<V>& a) noexcept {
  Matrix3<V> r;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      r.m[i][j] = factor * a.m[i][j];
    r.m[i][i] += diagonal;
  }
  return r;
}

// J'J, J'r and r'r of one set: the row is one vector of eight and one of two.
struct SumsOfOne {
  Lanes8 aa[8]{}, ab[2]{}, ar{};
  Lanes2 bb[2]{}, br{};
  double rr = 0.0;

  MGDD_INLINE void add(const Lanes8& a, const Lanes2& b, double r) noexcept {
    for (int i = 0; i < 8; ++i)
      aa[i] += a[i] * a;
    for (int i = 0; i < 2; ++i) {
      ab[i] += b[i] * a;
      bb[i] += b[i] * b;
    }
    ar += r * a;
    br += r * b;
    rr += r * r;
  }
};

template <class V>
struct SumsOfLanes {
  V jj[55]{}, jr[10]{}, rr{};

  MGDD_INLINE void add(const Columns<V, 8>& a, const Columns<V, 2>& b, const V& r) noexcept {
    V row[10];
    for (int i = 0; i < 8; ++i)
      row[i] = a.c[i];
    row[8] = b.c[0];
    row[9] = b.c[1];
    int at = 0;
    for (int i = 0; i < 10; ++i) {
      for (int j = 0; j <= i; ++j)
        jj[at++] += row[i] * row[j];
      jr[i] += r * row[i];
    }
    rr += r * r;
  }
};

template <class V, class Sums>
MGDD_INLINE void sweep(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                       const V (&p)[10], Sums& sums) noexcept {
  using Speed = typename Layout<V>::Speed;
  using Current = typename Layout<V>::Current;
  const double h = record.dt_s;
  const V zero{};
  std::array<V, 10> numbers{};
  for (std::size_t i = 0; i < 10; ++i)
    numbers[i] = p[i];
  const Constants<V> c = plant.coefficients(numbers);

  V angle = zero + record.start[0], speed = zero + record.start[1], current = zero + record.start[2];
  Speed angle_by_s{}, speed_by_s{}, current_by_s{};
  Current angle_by_c{}, speed_by_c{}, current_by_c{};
  Stage<V> f1{}, f2{}, f3{}, f4{};
  for (std::size_t k = 0; k < n_samples; ++k) {
    sums.add(angle_by_s, angle_by_c, angle - record.angle_deg[k] * (1.0 / deg_per_rad));
    const V drive = record.duty[k] * c.supply;
    evaluate(c, angle, speed, current, drive, f1);
    evaluate<V>(c, angle + 0.5 * h * f1.d_angle, speed + 0.5 * h * f1.d_speed, current + 0.5 * h * f1.d_current, drive,
                f2);
    evaluate<V>(c, angle + 0.5 * h * f2.d_angle, speed + 0.5 * h * f2.d_speed, current + 0.5 * h * f2.d_current, drive,
                f3);
    evaluate<V>(c, angle + h * f3.d_angle, speed + h * f3.d_speed, current + h * f3.d_current, drive, f4);
    angle += h / 6.0 * (f1.d_angle + 2.0 * (f2.d_angle + f3.d_angle) + f4.d_angle);
    speed += h / 6.0 * (f1.d_speed + 2.0 * (f2.d_speed + f3.d_speed) + f4.d_speed);
    current += h / 6.0 * (f1.d_current + 2.0 * (f2.d_current + f3.d_current) + f4.d_current);

    // w_s: what a change of the right-hand side at stage s does to the step. Their sum with A is the transition matrix.
    Matrix3<V> w4{}, w3;
    for (int i = 0; i < 3; ++i)
      w4.m[i][i] = zero + h / 6.0;
    const Matrix3<V> p4 = times_a(w4, f4, c);
    w3 = plus_identity(h / 3.0, h, p4);
    const Matrix3<V> p3 = times_a(w3, f3, c);
    const Matrix3<V> w2 = plus_identity(h / 3.0, 0.5 * h, p3);
    const Matrix3<V> p2 = times_a(w2, f2, c);
    const Matrix3<V> w1 = plus_identity(h / 6.0, 0.5 * h, p2);
    const Matrix3<V> p1 = times_a(w1, f1, c);
    Matrix3<V> t;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j)
        t.m[i][j] = (p1.m[i][j] + p2.m[i][j]) + (p3.m[i][j] + p4.m[i][j]);
      t.m[i][i] += 1.0;
    }
    const auto next = [&](int i, const auto& a, const auto& s, const auto& q, const auto& b1, const auto& b2,
                          const auto& b3, int column) MGDD_INLINE_LAMBDA {
      return ((t.m[i][0] * a + t.m[i][1] * s) + (t.m[i][2] * q + w1.m[i][column] * b1)) +
             (w2.m[i][column] * b2 + w3.m[i][column] * b3);
    };
    const Speed sa = next(0, angle_by_s, speed_by_s, current_by_s, f1.by_speed, f2.by_speed, f3.by_speed, 1);
    const Speed ss = next(1, angle_by_s, speed_by_s, current_by_s, f1.by_speed, f2.by_speed, f3.by_speed, 1) +
                     w4.m[1][1] * f4.by_speed;
    const Speed sc = next(2, angle_by_s, speed_by_s, current_by_s, f1.by_speed, f2.by_speed, f3.by_speed, 1);
    angle_by_s = sa;
    speed_by_s = ss;
    current_by_s = sc;
    const Current ca = next(0, angle_by_c, speed_by_c, current_by_c, f1.by_current, f2.by_current, f3.by_current, 2);
    const Current cs = next(1, angle_by_c, speed_by_c, current_by_c, f1.by_current, f2.by_current, f3.by_current, 2);
    const Current cc = next(2, angle_by_c, speed_by_c, current_by_c, f1.by_current, f2.by_current, f3.by_current, 2) +
                       w4.m[2][2] * f4.by_current;
    angle_by_c = ca;
    speed_by_c = cs;
    current_by_c = cc;
  }
}

constexpr double squared_deg = deg_per_rad * deg_per_rad;

MGDD_INLINE void one(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                     const std::array<double, 10>& parameters, NormalSums& out) noexcept {
  double p[10];
  for (std::size_t i = 0; i < 10; ++i)
    p[i] = parameters[i];
  SumsOfOne sums;
  sweep<double>(plant, record, n_samples, p, sums);
  for (std::size_t i = 0; i < 8; ++i) {
    for (std::size_t j = 0; j < 8; ++j)
      out.jacobian_squared[i][j] = squared_deg * sums.aa[i][j];
    for (std::size_t j = 0; j < 2; ++j)
      out.jacobian_squared[i][8 + j] = out.jacobian_squared[8 + j][i] = squared_deg * sums.ab[j][i];
    out.gradient[i] = squared_deg * sums.ar[i];
  }
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t j = 0; j < 2; ++j)
      out.jacobian_squared[8 + i][8 + j] = squared_deg * sums.bb[i][j];
    out.gradient[8 + i] = squared_deg * sums.br[i];
  }
  out.sum_squares = squared_deg * sums.rr;
}

MGDD_INLINE void lanes(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                       const std::array<double, 10>* parameters, NormalSums* out) noexcept {
  Lanes8 p[10];
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t lane = 0; lane < 8; ++lane)
      p[i][lane] = parameters[lane][i];
  }
  SumsOfLanes<Lanes8> sums;
  sweep<Lanes8>(plant, record, n_samples, p, sums);
  for (std::size_t lane = 0; lane < 8; ++lane) {
    std::size_t at = 0;
    for (std::size_t i = 0; i < 10; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        out[lane].jacobian_squared[i][j] = out[lane].jacobian_squared[j][i] = squared_deg * sums.jj[at++][lane];
      }
      out[lane].gradient[i] = squared_deg * sums.jr[i][lane];
    }
    out[lane].sum_squares = squared_deg * sums.rr[lane];
  }
}

// NOLINTEND(cppcoreguidelines-pro-type-member-init)

}  // namespace

void accumulate(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                const std::array<double, 10>& parameters, NormalSums& sums) noexcept {
  dispatch([&]() MGDD_INLINE_LAMBDA { one(plant, record, n_samples, parameters, sums); });
}

void accumulate(const throttle::SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
                std::span<const std::array<double, 10>, smooth_throttle_lanes> parameters,
                std::span<NormalSums, smooth_throttle_lanes> sums) noexcept {
  dispatch([&]() MGDD_INLINE_LAMBDA { lanes(plant, record, n_samples, parameters.data(), sums.data()); });
}

}  // namespace mgdd::identify
