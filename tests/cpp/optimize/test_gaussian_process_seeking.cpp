// Seeking with Gaussian processes: few readings to the best of several inputs, limits, drift, restarts, cycles that
// fail.
#include "mgdd/common/random.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "support/coupled_map.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

using test_support::AllocationCounter;

TEST(GaussianProcessSeeking, ArrivesInAboutTenReadingsAndStays) {
  std::vector<int> arrivals;
  double late = 0.0, within = 0.0;
  constexpr int seeds = 20, cycles = 120, from = 60;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    int arrived = cycles;
    for (int k = 0; k < cycles; ++k) {
      if (arrived == cycles && lost(seeker.estimate()) < 0.06) arrived = k;
      const double j[] = {50.0 - lost(seeker.ask()) + noise(seed, k)};
      ASSERT_EQ(seeker.tell({j, {}}), TellStatus::accepted);
      if (k >= from) late += lost(seeker.applied()) / (seeds * (cycles - from));
    }
    arrivals.push_back(arrived);
    const double off = std::abs(seeker.expected() - (50.0 - lost(seeker.estimate())));
    within += off < 2.0 * seeker.expected_sd() + 0.02 ? 1.0 : 0.0;
    EXPECT_NEAR(seeker.noise_sd(), 0.3, 0.12) << seed;
  }
  std::sort(arrivals.begin(), arrivals.end());
  EXPECT_LE(arrivals[seeds / 2], 12);
  EXPECT_LT(arrivals[seeds - 1], cycles) << "one run never arrived";
  EXPECT_LT(late, 0.1);
  EXPECT_GE(within / seeds, 0.75) << "the stated expectation";
}

// One reading of twenty noises in fifty, on either side; and one wrong by far before anything is known.
TEST(GaussianProcessSeeking, BearsReadingsThatAreFarOut) {
  constexpr int seeds = 8, cycles = 150, half = 75;
  double late = 0.0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    for (int k = 0; k < cycles; ++k) {
      const double at = random::uniform(seed, 70, static_cast<std::uint64_t>(k));
      const double spike = at < 0.01 ? -6.0 : at < 0.02 ? 6.0 : 0.0;
      const double j[] = {50.0 - lost(seeker.ask()) + noise(seed, k) + spike};
      seeker.tell({j, {}});
      if (k >= half) late += lost(seeker.applied()) / (seeds * (cycles - half));
    }
  }
  EXPECT_LT(late, 0.12);
  for (const double wrong : {0.0, 1e6}) {
    for (const int when : {0, 2}) {
      double way = 0.0;
      for (std::uint64_t seed = 0; seed < 4; ++seed) {
        GaussianProcessSeeking seeker(two_inputs(seed));
        for (int k = 0; k < 60; ++k) {
          const double answer = 50.0 - lost(seeker.ask()) + noise(seed, k), j[] = {k == when ? wrong : answer};
          seeker.tell({j, {}});
          way += lost(seeker.applied()) / (60 * 4);
        }
      }
      EXPECT_LT(way, 1.0) << wrong << " in cycle " << when;
    }
  }
}

TEST(GaussianProcessSeeking, ReseedingIsBeginningWithThatSeedAlsoWhereCyclesFail) {
  GaussianProcessSeeking made(two_inputs(5)), other(two_inputs(0));
  other.reseed(5);
  for (int k = 0; k < 60; ++k) {
    ASSERT_EQ(made.ask(), other.ask()) << k;
    const double j[] = {-lost(made.ask()) + noise(5, k)};
    const bool fails = made.ask()[1] < 0.22;
    made.tell({j, {}, fails});
    other.tell({j, {}, fails});
  }
  EXPECT_EQ(save_state(made), save_state(other));
}

// Two limits that cross obliquely hold three inputs back, one of them to be known by its logarithm, one through zero.
// J = 40 - 20 d'A d + (10 a + 8 b) d and both edges convex: by Karush, Kuhn and Tucker their corner d = 0 is the best.
TEST(GaussianProcessSeeking, SlidesAlongTwoLimitsToTheirCorner) {
  const Eigen::Vector3d corner(0.5, 0.4, 0.6), a(0.6, -0.64, 0.48), b(0.8, 0.0, 0.6);
  const auto j_of = [&](const Inputs& x) {
    const Eigen::Vector3d d = x - corner;
    return 40.0 - 14.0 * d.squaredNorm() - 6.0 * d.sum() * d.sum() + (10.0 * a + 8.0 * b).dot(d);
  };
  const auto nox_of = [&](const Inputs& x) { return 150.0 * std::exp(3.0 * a.dot(x - corner)); };
  const auto ca50_of = [&](const Inputs& x) { return 4.0 + 25.0 * b.dot(x - corner); };
  double above = 0.0, end = 0.0;
  constexpr int seeds = 6, cycles = 80;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeekingSettings s;
    s.space.inputs.assign(3, {.name = "x", .lower = 0.0, .upper = 1.0});
    for (std::size_t i = 0; i < 3; ++i)
      s.space.inputs[i].name += std::to_string(i);
    s.space.start = Eigen::Vector3d(0.07, 0.54, 0.585);
    s.limits = {{.name = "nox_ppm", .upper = 150.0}, {.name = "ca50_cad", .upper = 4.0, .scale = 12.0}};
    s.seed = seed;
    GaussianProcessSeeking seeker(s);
    for (int k = 0; k < cycles; ++k) {
      const Inputs x = seeker.ask();
      const double j[] = {j_of(x) + noise(seed, k)};
      const double limits[] = {nox_of(x) * (1.0 + noise(seed, 1000 + k, 0.03)), ca50_of(x) + noise(seed, 2000 + k)};
      seeker.tell({j, limits});
      above += nox_of(x) > 151.5 || ca50_of(x) > 4.12 ? 1.0 / (seeds * cycles) : 0.0;
    }
    EXPECT_EQ(seeker.limit_state(0), LimitState::active) << seed;
    EXPECT_EQ(seeker.limit_state(1), LimitState::active) << seed;
    end += (40.0 - j_of(seeker.estimate())) / seeds;
  }
  EXPECT_LE(above, 0.005);
  EXPECT_LT(end, 0.1) << "it rests beside the corner";
}

// J is best at +8 by 0.1; a limit of 100 + 2 x + 60 egr holds the timing back and is read wrong once, or in one cycle
// of fifty.
TEST(GaussianProcessSeeking, KeepsALimitThatIsReadWrong) {
  constexpr int seeds = 5, cycles = 100;
  for (const bool often : {false, true}) {
    double above = 0.0, end = 0.0;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
      auto s = two_inputs(seed);
      s.space.start << -18.0, 0.3;
      s.limits = {{.name = "p_max_bar", .upper = 110.0}};
      GaussianProcessSeeking seeker(s);
      for (int k = 0; k < cycles; ++k) {
        const Inputs x = seeker.ask();
        const double value = 100.0 + 2.0 * x[0] + 60.0 * x[1];
        const bool wrong = often ? random::uniform(seed, 70, static_cast<std::uint64_t>(k)) < 0.02 : k == 2;
        const double j[] = {-lost(x, 8.0) + noise(seed, k)};
        const double limits[] = {wrong ? 0.0 : value + noise(seed, 1000 + k, 0.5)};
        seeker.tell({j, limits});
        above += value > 111.0 ? 1.0 / (seeds * cycles) : 0.0;
      }
      end += lost(seeker.estimate(), 8.0) / seeds;
    }
    EXPECT_LE(above, 0.02) << often;
    EXPECT_LT(end, 9.0) << often << ", the limit leaves some 5 to lose";
  }
}

// NOx = 900 exp(-soc/8 - 8 egr) ppm, read to 3 %: from 60 at the start to 20,000 in a corner. J is best far beyond 150.
TEST(GaussianProcessSeeking, KeepsALimitThatSpreadsOverPowersOfTen) {
  double above = 0.0, share = 0.0;
  constexpr int seeds = 10, cycles = 100;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    auto s = two_inputs(seed);
    s.limits = {{.name = "nox_ppm", .upper = 150.0}};
    GaussianProcessSeeking seeker(s);
    const auto nox = [](const Inputs& x) { return 900.0 * std::exp(-x[0] / 8.0 - 8.0 * x[1]); };
    for (int k = 0; k < cycles; ++k) {
      const Inputs x = seeker.ask();
      const double j[] = {-lost(x, -12.0) + noise(seed, k)};
      const double limits[] = {nox(x) * (1.0 + noise(seed, 1000 + k, 0.03))};
      seeker.tell({j, limits});
      above += nox(x) > 150.0 ? 1.0 / (seeds * cycles) : 0.0;
    }
    share += nox(seeker.estimate()) / 150.0 / seeds;
  }
  EXPECT_LE(above, 0.02);
  EXPECT_GT(share, 0.75) << "it keeps away from the limit";
}

// A limit that rises by a factor of 4.5 over the range, 3 % above the start: the first steps are as short as its room.
TEST(GaussianProcessSeeking, FirstStepsLeaveALimitItsRoom) {
  double worst = 0.0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto s = two_inputs(seed);
    s.limits = {{.name = "x", .upper = 1.0}};
    GaussianProcessSeeking seeker(s);
    const Inputs range = seeker.settings().space.upper - seeker.settings().space.lower;
    const double turn = 6.0 * noise(seed, 999);
    for (int k = 0; k < 20; ++k) {
      const Inputs x = seeker.ask(), z = (x - s.space.start).cwiseQuotient(range);
      const double value = 0.97 * std::exp(1.5 * (std::cos(turn) * z[0] + std::sin(turn) * z[1]));
      const double j[] = {-lost(x) + noise(seed, k)}, limits[] = {value + noise(seed, 1000 + k, 0.01)};
      worst = std::max(worst, value - 1.0);
      seeker.tell({j, limits});
    }
  }
  EXPECT_LT(worst, 0.03);  // 0.045 and more where they are half of the usual ones
}

// A start beyond the limit: the least expected excess leads out.
TEST(GaussianProcessSeeking, LeavesAnUnsafeStart) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    auto s = two_inputs(seed);
    s.limits = {{.name = "p_max_bar", .upper = 110.0}};
    GaussianProcessSeeking seeker(s);
    double value = 0.0;
    for (int k = 0; k < 60; ++k) {
      const Inputs x = seeker.ask();
      value = 100.0 + 2.0 * x[0] + 60.0 * x[1];
      const double j[] = {-lost(x, 8.0) + noise(seed, k)}, limits[] = {value + noise(seed, 1000 + k, 0.5)};
      seeker.tell({j, limits});
    }
    EXPECT_LE(value, 110.5) << seed;  // 126.6 at the start
  }
}

TEST(GaussianProcessSeeking, FollowsABestInputThatJumps) {
  double late = 0.0;
  constexpr int seeds = 8;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    for (int k = 0; k < 300; ++k) {
      const double best = k < 100 ? -4.0 : 5.0;
      const double j[] = {-lost(seeker.ask(), best) + noise(seed, k)};
      seeker.tell({j, {}});
      if (k >= 200) late += lost(seeker.applied(), best) / (100.0 * seeds);
    }
    EXPECT_GE(seeker.doubts(), 1) << seed;
  }
  EXPECT_LT(late, 0.4);  // 2.4 where it stays
}

TEST(GaussianProcessSeeking, AllocatesNothing) {
  auto s = two_inputs(5);
  s.kept = 20;
  s.limits = {{.name = "p", .upper = 200.0}};
  GaussianProcessSeeking seeker(s);
  static_assert(noexcept(seeker.ask()) && noexcept(seeker.tell(std::declval<const Reading&>())));
  const AllocationCounter counter;
  for (int k = 0; k < 43; ++k) {
    const Inputs x = seeker.ask();
    const double j[] = {-lost(x) + noise(5, k)}, limits[] = {100.0 + x[0]};
    seeker.tell({j, limits, k % 9 == 4});
  }
  EXPECT_EQ(counter.count(), 0u);
}

TEST(GaussianProcessSeeking, ANewPointBeginsAnewAndRatesHold) {
  auto s = two_inputs(6);
  s.space.inputs[0].rate = 1.5;
  GaussianProcessSeeking seeker(s);
  Inputs before = s.space.start;
  for (int k = 0; k < 80; ++k) {
    if (k == 40) seeker.restart();
    const Inputs x = seeker.ask();
    ASSERT_LE(std::abs(x[0] - before[0]), 1.5 + 1e-12) << k;
    before = x;
    const double j[] = {-lost(x, k < 40 ? -4.0 : -1.0) + noise(6, k, 0.05)};
    seeker.tell({j, {}});
  }
  EXPECT_NEAR(seeker.estimate()[0], -1.0, 1.0);
}

// After arrival: to both sides of every input, by little, as long as nothing changes; then it looks around again.
TEST(GaussianProcessSeeking, HandsOverToADitherUntilSomethingChanges) {
  for (const std::uint64_t seed : {3U, 4U}) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    const auto to_the_side = [&] { return Inputs(seeker.ask() - seeker.estimate()); };
    std::vector<Inputs> steps;
    for (int k = 0; k < 200; ++k) {
      if (k >= 160) steps.push_back(to_the_side());
      const double j[] = {-lost(seeker.ask()) + noise(seed, k)};
      seeker.tell({j, {}});
    }
    for (const int i : {0, 1}) {
      const double range = i == 0 ? 40.0 : 0.4;
      const auto up = std::ranges::count_if(steps, [&](const Inputs& s) { return s[i] > 1e-4 * range; });
      const auto down = std::ranges::count_if(steps, [&](const Inputs& s) { return s[i] < -1e-4 * range; });
      EXPECT_GE(up, 6) << seed;
      EXPECT_GE(down, 6) << seed;
      for (const Inputs& step : steps)
        EXPECT_LT(std::abs(step[i]), 0.07 * range) << seed;
    }
    const std::int64_t doubts = seeker.doubts();
    double farthest = 0.0;
    for (int k = 200; k < 320; ++k) {
      farthest = std::max(farthest, std::abs(to_the_side()[0]));
      const double j[] = {-lost(seeker.ask(), -12.0) + noise(seed, k)};
      seeker.tell({j, {}});
    }
    EXPECT_GT(seeker.doubts(), doubts) << seed;
    EXPECT_GT(farthest, 2.0) << seed;
    EXPECT_LT(lost(seeker.estimate(), -12.0), 0.3) << seed;
  }
}

TEST(GaussianProcessSeeking, KeepsOutOfInputsThatFail) {
  const auto s = two_inputs(7);
  GaussianProcessSeeking seeker(s);
  int failed = 0;
  for (int k = 0; k < 200; ++k) {
    const Inputs x = seeker.ask();
    const bool fails = x[1] < 0.22;  // the best input lies in there
    const double j[] = {-lost(x) + noise(7, k)};
    seeker.tell({j, {}, fails});
    if (k >= 100) failed += fails ? 1 : 0;
  }
  EXPECT_LE(failed, 10);
  EXPECT_GE(seeker.estimate()[1], 0.2);
  EXPECT_EQ(seeker.protocol().failures.failing_below().maxCoeff(), -unlimited);  // no edge of one input
}

// Beyond an oblique edge 3 past the best input: edges per input would shut the best one out.
TEST(GaussianProcessSeeking, FindsTheBestInputBesideAnObliqueEdge) {
  int failed = 0, late_failed = 0;
  double late = 0.0;
  constexpr int seeds = 10, cycles = 200;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    for (int k = 0; k < cycles; ++k) {
      const Inputs x = seeker.ask();
      const bool fails = 100.0 * (x[1] - 0.2) - (x[0] + 4.0) > 3.0 * std::sqrt(2.0);
      const double j[] = {-lost(x) + noise(seed, k)};
      seeker.tell({j, {}, fails});
      failed += fails ? 1 : 0;
      late_failed += fails && k >= cycles / 2 ? 1 : 0;
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LT(late, 0.1);
  EXPECT_LE(failed, 8 * seeds);
  EXPECT_LE(late_failed, 2 * seeds);
}

// Cycles that fail at random, wherever they are, fence nothing off.
TEST(GaussianProcessSeeking, FailuresAtRandomKeepItFromNothing) {
  double late = 0.0;
  constexpr int seeds = 10;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    GaussianProcessSeeking seeker(two_inputs(seed));
    for (int k = 0; k < 200; ++k) {
      const double j[] = {-lost(seeker.ask()) + noise(seed, k)};
      seeker.tell({j, {}, random::uniform(seed, 77, static_cast<std::uint64_t>(k)) < 0.1});
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LT(late, 0.1);
}

// A cycle of five fails wherever it is asked, the first step towards the optimum too: no region is to be left for it.
TEST(GaussianProcessSeeking, CyclesThatFailAnywhereAreNoRegion) {
  double loss = 0.0;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    GaussianProcessSeekingSettings s;
    s.space.inputs = {{.name = "soc_cad", .lower = -20.0, .upper = 10.0}};
    s.space.start = scalar_input(1.0);
    s.seed = seed;
    GaussianProcessSeeking seeker(s);
    for (int k = 0; k < 200; ++k) {
      const auto cycle = static_cast<std::uint64_t>(k);
      const double off = seeker.ask()[0] + 6.0;
      loss += 0.08 * off * off / (8.0 * 200.0);
      const double j[] = {-0.08 * off * off + 0.25 * random::normal(seed, 9, cycle)};
      seeker.tell({j, {}, k == 1 || random::uniform(seed, 10, cycle) < 0.2});
    }
  }
  EXPECT_LT(loss, 0.5);
}

TEST(GaussianProcessSeeking, WhatIsKnownOfFailuresIsRestoredWithinItsBounds) {
  GaussianProcessSeeking seeker(two_inputs(3));
  const StateColumns kept = save_state(seeker);
  for (const auto& [name, value] : {std::pair{"anywhere", 3.5}, {"cycles_seen", -10.0}, {"cycles_failed", 0.5}}) {
    StateColumns broken = kept;
    broken[name] = {value};
    EXPECT_THROW(restore_state(seeker, broken), ParameterError) << name;
    EXPECT_EQ(save_state(seeker), kept) << name;
  }
}

}  // namespace
}  // namespace mgdd::optimize
