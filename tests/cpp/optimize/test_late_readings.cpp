// J that comes late, by a delay or a lag: readings go to the inputs that caused them.
#include <cmath>
#include <vector>

#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "support/coupled_map.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

// Told three cycles short or long, the delay is read off the readings; told right, it stays.
TEST(LateReadings, TellADelayThatIsToldWrong) {
  constexpr int seeds = 8;
  for (const double told : {5.0, 8.0, 11.0}) {
    int found = 0;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
      auto s = two_inputs(seed);
      s.sensor = {told, 0.0};
      GaussianProcessSeeking seeker(s);
      std::vector<double> on_their_way(8, -lost(s.space.start));
      for (int k = 0; k < 200; ++k) {
        on_their_way.push_back(-lost(seeker.ask()) + noise(seed, k));
        const double j[] = {on_their_way[static_cast<std::size_t>(k)]};
        seeker.tell({j, {}});
      }
      found += seeker.delay_cycles() == 8.0 && lost(seeker.estimate()) < 0.3 ? 1 : 0;
    }
    EXPECT_GE(found, seeds - 2) << told;
  }
}

// What is on its way is counted on: nothing is tried twelve times before its first reading comes.
TEST(LateReadings, AreWaitedForByTheProcess) {
  double asked_far = 0.0, late = 0.0;
  constexpr int seeds = 10;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    auto s = two_inputs(seed);
    s.components = {{20.0, 0.0}};
    s.delay_uncertainty = 0;
    GaussianProcessSeeking seeker(s);
    std::vector<double> on_their_way(20, -lost(s.space.start));
    for (int k = 0; k < 200; ++k) {
      on_their_way.push_back(-lost(seeker.ask()) + noise(seed, k));
      asked_far += lost(seeker.ask()) / (200 * seeds);
      const double j[] = {on_their_way[static_cast<std::size_t>(k)]};
      seeker.tell({j, {}});
    }
    late += lost(seeker.estimate()) / seeds;
  }
  EXPECT_LT(late, 0.15);
  EXPECT_LT(asked_far, 3.2);  // the start itself loses 9.6
}

// J at the estimate lies within 1.44 standard deviations of what is expected, from the first readings on.
TEST(LateReadings, OfTheProcessHoldItsIntervals) {
  double held = 0.0, stated = 0.0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto s = two_inputs(seed);
    s.sensor = {20.0, 10.0};
    GaussianProcessSeeking seeker(s);
    std::vector<double> on_their_way(20, -lost(s.space.start));
    double lagged = on_their_way[0];
    for (int k = 0; k < 260; ++k) {
      on_their_way.push_back(-lost(seeker.ask()));
      if (seeker.expected_sd() > 0.0) {
        stated += 1.0;
        held += std::abs(-lost(seeker.estimate()) - seeker.expected()) < 1.44 * seeker.expected_sd() ? 1.0 : 0.0;
      }
      lagged += (1.0 - std::exp(-0.1)) * (on_their_way[static_cast<std::size_t>(k)] - lagged);
      const double j[] = {lagged + noise(seed, k)};
      seeker.tell({j, {}});
    }
  }
  EXPECT_GT(stated, 20 * 180.0);
  EXPECT_GE(held / stated, 0.85);
}

// y += (1 - exp(-1/3)) (x - y): an input is held for 3 cycles, and the lag is taken out of what is read meanwhile.
TEST(LateReadings, BehindALagHoldTheInputs) {
  auto s = two_inputs(4);
  s.sensor = {0.0, 3.0};
  GaussianProcessSeeking seeker(s);
  double lagged = -lost(s.space.start);
  int changes = 0;
  Inputs before = s.space.start;
  for (int k = 0; k < 280; ++k) {
    const Inputs x = seeker.ask();
    changes += x == before ? 0 : 1;
    before = x;
    lagged += (1.0 - std::exp(-1.0 / 3.0)) * (-lost(x) - lagged);
    const double j[] = {lagged + noise(4, k, 0.05)};
    seeker.tell({j, {}});
  }
  EXPECT_LE(changes, 94);
  EXPECT_LT(lost(seeker.estimate()), 0.2);
}

// Behind a delay the dither goes on where a reading is missing: what is on its way stays with its input.
TEST(LateReadings, ThatAreMissingCostTheDitherLittle) {
  for (const MeanRemoval form : {MeanRemoval::batch, MeanRemoval::moving_average}) {
    double lost[2] = {0.0, 0.0};
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      for (const int some : {0, 1}) {
        ExtremumSeekingSettings s = plain_seeking(7.0);
        s.form = form;
        s.dither.period = 12;
        s.components = {{7.0, 0.0}};
        ExtremumSeeking seeker(s);
        std::vector<double> on_their_way(7, quadratic(7.0));
        for (int k = 0; k < 600; ++k) {
          const auto at = static_cast<std::uint64_t>(k);
          on_their_way.push_back(quadratic(seeker.ask()[0]) + 0.1 * random::normal(seed, 7, at));
          lost[some] -= quadratic(seeker.estimate()[0]) / 24000.0;
          const double j[] = {on_their_way[at]};
          seeker.tell({j, {}, some == 1 && random::bernoulli(0.1, seed, 8, at)});
        }
      }
    }
    EXPECT_LT(lost[1], 1.1 * lost[0]) << name_of(form);
  }
}

}  // namespace
}  // namespace mgdd::optimize
