// A seeker that is moved goes on as if the optimum and it had been there before: J and the estimate shift alike.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

double bowl(const Inputs& x, const Inputs& centre) {
  const Inputs away = x - centre;
  return 0.5 * bend * away.squaredNorm() + 0.004 * away[0] * away[0] * away[0] / (1.0 + away.squaredNorm());
}

template <class S>
void seek(S& seeker, const Inputs& centre, int from, int cycles) {
  for (int k = from; k < from + cycles; ++k) {
    const double noise = 0.25 * random::normal(9, 3, static_cast<std::uint64_t>(k));
    cycle_of(seeker, [&](const Inputs& x) { return bowl(x, centre) + noise; });
  }
}

TEST(ShiftEstimate, MovesTheEstimateAndNothingElseOfTheSearch) {
  for (const SearchSpace& space : {space_at(scalar_input(8.0)), space_at(inputs({8.0, -6.0, 4.0}))}) {
    const Inputs still = Inputs::Zero(space.size());
    const Inputs by = space.size() == 1 ? scalar_input(-3.25) : inputs({-3.25, 2.5, 0.75});
    for (auto& [name, any] : every_seeker(space, 0.25, 3)) {
      SCOPED_TRACE(name + ", inputs " + std::to_string(space.size()));
      std::visit(
          [&](auto& moved) {
            auto plain = moved;
            seek(plain, still, 0, 123);
            seek(moved, still, 0, 123);
            moved.restart();
            plain.restart();
            moved.shift_estimate(by);
            EXPECT_LT((moved.estimate() - plain.estimate() - by).norm(), 1e-12);
            if (name == "golden_section") return;  // its bracket does not move: the whole range is searched again
            seek(plain, still, 123, 150);
            seek(moved, by, 123, 150);
            EXPECT_LT((moved.estimate() - plain.estimate() - by).norm(), 1e-9);
          },
          any);
    }
  }
}

TEST(ShiftEstimate, MovesABracketThatHasConverged) {
  GoldenSectionSettings s;
  s.space = {scalar_input(0.0), scalar_input(-40.0), scalar_input(40.0)};
  s.noise_sd = 0.25;
  GoldenSection plain(s);
  seek(plain, scalar_input(3.0), 0, 400);
  ASSERT_TRUE(plain.converged());
  GoldenSection moved = plain;
  moved.shift_estimate(scalar_input(-7.5));
  seek(plain, scalar_input(3.0), 400, 90);
  seek(moved, scalar_input(3.0 - 7.5), 400, 90);
  EXPECT_NEAR(moved.estimate()[0], plain.estimate()[0] - 7.5, 1e-9);
}

TEST(ShiftEstimate, KeepsTheRoomOfThePerturbationWithinTheBounds) {
  for (const double by : {-60.0, 55.0}) {
    for (auto& [name, any] : every_seeker(space_at(scalar_input(8.0), 20.0), 0.25, 3)) {
      SCOPED_TRACE(name);
      std::visit(
          [&](auto& seeker) {
            seeker.shift_estimate(scalar_input(by));
            EXPECT_NEAR(seeker.estimate()[0], std::copysign(18.0, by), 2.0);
            for (int k = 0; k < 40; ++k) {
              EXPECT_LE(std::abs(seeker.ask()[0]), 20.0);
              cycle_of(seeker, [](const Inputs& x) { return quadratic(x[0]); });
            }
          },
          any);
    }
  }
}

}  // namespace
}  // namespace mgdd::optimize
