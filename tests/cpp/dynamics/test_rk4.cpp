// Runge-Kutta steps, and their sensitivities.
#include "mgdd/dynamics/rk4.hpp"
#include "mgdd/dynamics/sensitivity.hpp"
#include "support/test.hpp"

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

using Pass = std::pair<std::size_t, std::size_t>;  // first direction, lanes (0: plain)

template <class T>
std::size_t lanes_of() {
  if constexpr (is_dual_v<T>) {
    return T{}.grad.size();
  } else {
    return 0;
  }
}

std::vector<Pass> passes(std::size_t n, std::size_t stop_after = 99) {
  std::vector<Pass> made;
  DefaultPasses::each(n, [&]<class T>(std::size_t first) {
    made.emplace_back(first, lanes_of<T>());
    return made.size() < stop_after;
  });
  return made;
}

TEST(Passes, AreTheNarrowestThatHoldTheRest) {
  EXPECT_EQ(passes(0), (std::vector<Pass>{{0, 0}}));
  EXPECT_EQ(passes(1), (std::vector<Pass>{{0, 4}}));
  EXPECT_EQ(passes(4), (std::vector<Pass>{{0, 4}}));
  EXPECT_EQ(passes(5), (std::vector<Pass>{{0, 8}}));
  EXPECT_EQ(passes(9), (std::vector<Pass>{{0, 12}}));
  EXPECT_EQ(passes(13), (std::vector<Pass>{{0, 16}}));
  EXPECT_EQ(passes(37), (std::vector<Pass>{{0, 16}, {16, 16}, {32, 8}}));
  EXPECT_EQ(passes(37, 2), (std::vector<Pass>{{0, 16}, {16, 16}})) << "false stops";
}

TEST(Seed, IsOneInItsOwnLaneOnly) {
  using D = Dual<4>;
  EXPECT_EQ(seed<D>(2.5, 6, 4).grad, (D{}.grad = {0.0, 0.0, 1.0, 0.0}));
  EXPECT_EQ(seed<D>(2.5, 4, 4).grad[0], 1.0);
  EXPECT_EQ(seed<D>(2.5, 3, 4).grad, D{}.grad);
  EXPECT_EQ(seed<D>(2.5, 8, 4).grad, D{}.grad);
  EXPECT_EQ(seed<D>(2.5, 6, 4).value, 2.5);
  EXPECT_EQ(seed<double>(2.5, 0, 0), 2.5);
}

// x' = p x: output after k samples x0 exp(p k h), its derivative by p is k h x.
struct Growth {
  static constexpr int n_states = 1;
  static constexpr int n_inputs = 1;
  static constexpr int n_parameters = 1;

  template <class C, class T, class U>
  std::array<T, 1> derivative(const std::array<C, 1>& p, const std::array<T, 1>& x,
                              const std::array<U, 1>&) const noexcept {
    return {p[0] * x[0]};
  }
  template <class C, class T>
  T output(const std::array<C, 1>&, const std::array<T, 1>& x) const noexcept {
    return x[0];
  }
};

TEST(Sweep, VisitsFromTheSkippedSampleOnWithExactDerivatives) {
  using D = Dual<4>;
  const auto model = Rk4<Growth>{}.prepare(std::array{seed<D>(0.3, 5, 4)}, 0.01);
  std::array<D, 1> state{D(2.0)};
  std::vector<std::size_t> seen;
  const auto still = [](std::size_t) { return std::array{0.0}; };
  EXPECT_TRUE(sweep(model, state, 12, 3, 4, still, [&](std::size_t k, const D& y) {
    seen.push_back(k);
    const double t = 0.01 * static_cast<double>(k);
    EXPECT_NEAR(y.value, 2.0 * std::exp(0.3 * t), 1e-11);
    EXPECT_NEAR(y.grad[1], t * y.value, 1e-10);
    return true;
  }));
  EXPECT_EQ(seen, (std::vector<std::size_t>{3, 4, 5, 6, 7, 8, 9, 10, 11}));
}

TEST(Sweep, StopsAtAnInfinityInTheLanesThatCount) {
  using D = Dual<4>;
  const auto run = [](const D& start, std::size_t lanes) {
    const auto model = Rk4<Growth>{}.prepare(std::array{D(0.3)}, 0.01);
    std::array<D, 1> state{start};
    std::size_t visits = 0;
    const bool whole = sweep(
        model, state, 5, 0, lanes, [](std::size_t) { return std::array{0.0}; },
        [&](std::size_t, const D&) { return ++visits < 4; });
    return std::pair(whole, visits);
  };
  D broken(1.0);
  broken.grad[2] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(run(broken, 4), std::pair(false, std::size_t{0}));
  EXPECT_EQ(run(broken, 2), std::pair(false, std::size_t{4})) << "a lane without a direction does not count";
  EXPECT_EQ(run(D(std::numeric_limits<double>::quiet_NaN()), 4), std::pair(false, std::size_t{0}));
}

}  // namespace
}  // namespace mgdd::dynamics
