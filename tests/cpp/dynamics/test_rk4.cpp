// The classical Runge-Kutta step: its stability polynomial on a linear equation, its order on a curved one.
#include "mgdd/dynamics/rk4.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace mgdd::dynamics {
namespace {

// x' = a x + b u, read as c x.
struct Lag {
  static constexpr int n_states = 1;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 3;

  template <class C, class T, class U>
  std::array<T, 1> derivative(const std::array<C, 3>& p, const std::array<T, 1>& x,
                              const std::array<U, 1>& u) const noexcept {
    return {p[0] * x[0] + T(p[1] * u[0])};
  }
  template <class C, class T>
  T output(const std::array<C, 3>& p, const std::array<T, 1>& x) const noexcept {
    return T(p[2]) * x[0];
  }
};

// A model of any equation does not know a state at rest for an output.
using LagModel = decltype(Rk4<Lag>{}.prepare(std::array{1.0, 1.0, 1.0}, 1.0));
static_assert(DiscreteModel<LagModel> && !StartsAtRest<LagModel>);

TEST(Rk4, IsItsStabilityPolynomialOnALinearEquation) {
  const double a = -1.7, b = 0.6, c = 3.0, h = 0.4, u = 1.3, x0 = 0.8;
  const auto model = Rk4<Lag>{}.prepare(std::array{a, b, c}, h);
  std::array<double, 1> x{x0};
  EXPECT_DOUBLE_EQ(model.output(x), c * x0);
  model.step(x, std::array{u});
  const double z = h * a, r = 1.0 + z + z * z / 2.0 + z * z * z / 6.0 + z * z * z * z / 24.0;
  EXPECT_NEAR(x[0], r * x0 + (r - 1.0) / a * b * u, 1e-15);

  const auto finer = Rk4<Lag>{{}, 2}.prepare(std::array{a, b, c}, h);
  std::array<double, 1> y{x0};
  finer.step(y, std::array{u});
  const double half = z / 2.0,
               s = 1.0 + half + half * half / 2.0 + half * half * half / 6.0 + half * half * half * half / 24.0;
  EXPECT_NEAR(y[0], s * s * x0 + (s * s - 1.0) / a * b * u, 1e-15);
  EXPECT_EQ(finer.sample_s(), h) << "sub-steps change no sample time";
}

// x' = -x^2 from 1: x(t) = 1/(1 + t).
struct Square {
  static constexpr int n_states = 1;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 1;

  template <class C, class T, class U>
  std::array<T, 1> derivative(const std::array<C, 1>& p, const std::array<T, 1>& x,
                              const std::array<U, 1>&) const noexcept {
    return {-(p[0] * x[0] * x[0])};
  }
  template <class C, class T>
  T output(const std::array<C, 1>&, const std::array<T, 1>& x) const noexcept {
    return x[0];
  }
};

TEST(Rk4, HasOrderFourOnACurvedEquation) {
  const auto error = [](int substeps) {
    const auto model = Rk4<Square>{{}, substeps}.prepare(std::array{1.0}, 1.0);
    std::array<double, 1> x{1.0};
    model.step(x, std::array{0.0});
    return std::abs(x[0] - 0.5);
  };
  for (const int substeps : {4, 8, 16})
    EXPECT_NEAR(std::log2(error(substeps) / error(2 * substeps)), 4.0, 0.25) << substeps;
  EXPECT_LT(error(16), 1e-7);
}

}  // namespace
}  // namespace mgdd::dynamics
