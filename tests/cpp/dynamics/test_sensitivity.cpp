// The one sweep with derivatives: which passes it makes, what it visits, where it stops.
#include "mgdd/dynamics/sensitivity.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

#include "mgdd/dynamics/rk4.hpp"

namespace mgdd::dynamics {
namespace {

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
  EXPECT_EQ(passes(13), (std::vector<Pass>{{0, 12}, {12, 4}}));
  EXPECT_EQ(passes(29), (std::vector<Pass>{{0, 12}, {12, 12}, {24, 8}}));
  EXPECT_EQ(passes(29, 2), (std::vector<Pass>{{0, 12}, {12, 12}})) << "false stops";
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
