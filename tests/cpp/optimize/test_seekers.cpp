// What holds for every seeker and form and is not seen from Python, whose contract test has the rest: the search on a
// noisy quadratic from far away, a shift of the estimate, and that ask, tell and history allocate nothing.
#include <gtest/gtest.h>

#include "mgdd/optimize/ask_tell/seeker_history.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

constexpr int forms = 7;

std::string form_name(std::size_t form) {
  return every_seeker(space_at(scalar_input(0.0), 20.0), 0.25)[form].first;
}

// --- the search ---------------------------------------------------------------------------------------------

class FarStart : public testing::TestWithParam<std::tuple<int, double>> {};

TEST_P(FarStart, ArrivesOnceStaysAndHasNoBias) {
  const auto form = static_cast<std::size_t>(std::get<0>(GetParam()));
  const double start = std::get<1>(GetParam());
  const std::uint64_t seeds = 1000;
  double mean = 0.0;
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    Seeker any = every_seeker(space_at(scalar_input(start)), 0.25, seed)[form].second;
    const std::vector<double> path =
        std::visit([&](auto& seeker) { return search(seeker, quadratic, 2000, 0.25, seed); }, any);
    for (const double x : path)
      ASSERT_LE(std::abs(x), 41.0) << form_name(form) << " seed " << seed;
    const int arrival = first_within(path, 1.0);
    ASSERT_GE(arrival, 0) << form_name(form) << " seed " << seed;
    ASSERT_LT(arrival, 700) << form_name(form) << " seed " << seed;
    mean += mean_of(path, 1000, 2000) / static_cast<double>(seeds);
  }
  EXPECT_LE(std::abs(mean), 0.03) << form_name(form);
}

INSTANTIATE_TEST_SUITE_P(EverySeeker, FarStart,
                         testing::Combine(testing::Range(0, forms), testing::Values(40.0, -40.0)), [](const auto& one) {
                           return form_name(static_cast<std::size_t>(std::get<0>(one.param))) +
                                  (std::get<1>(one.param) > 0.0 ? "_from_above" : "_from_below");
                         });

// --- ask and tell -------------------------------------------------------------------------------------------

struct Scene {
  SearchSpace space;
  std::vector<Limit> limits;
};

std::vector<Scene> scenes() {
  const Limit switching{"p_max_bar", 150.0, 1.0}, penalty{"rise", 4.0, 0.0, LimitMethod::penalty},
      barrier{"nox", 900.0, 0.0, LimitMethod::barrier};
  const SearchSpace one = space_at(scalar_input(8.0), 40.0), three = space_at(inputs({8.0, -6.0, 4.0}), 40.0);
  return {{one, {}}, {one, {switching, penalty, barrier}}, {three, {}}, {three, {switching, penalty, barrier}}};
}

double peak(const Inputs& x) {
  return 0.5 * bend * x.squaredNorm();
}
std::vector<double> limit_values(const Scene& scene, const Inputs& x) {
  if (scene.limits.empty()) return {};
  return {148.0 + 0.3 * x[0], 2.0 - 0.1 * x[0], 500.0 + 10.0 * x[0]};
}

template <class S>
void run(S& seeker, const Scene& scene, int cycles, std::uint64_t first = 0) {
  for (int k = 0; k < cycles; ++k) {
    const double noise = 0.25 * random::normal(5, 1, first + static_cast<std::uint64_t>(k));
    const Inputs x = seeker.ask();
    ASSERT_TRUE(x.allFinite());
    const double j[] = {peak(x) + noise};
    const std::vector<double> limits = limit_values(scene, x);
    ASSERT_EQ(seeker.tell({j, limits, false}), TellStatus::accepted);
  }
}

/// Calls `check(seeker, scene, name)` on every seeker, with one and three inputs, with limits and without.
template <class F>
void on_every_seeker(F&& check) {
  for (const Scene& scene : scenes()) {
    for (auto& [name, any] : every_seeker(scene.space, 0.25, 3, scene.limits)) {
      SCOPED_TRACE(name + ", inputs " + std::to_string(scene.space.size()) + ", limits " +
                   std::to_string(scene.limits.size()));
      std::visit([&](auto& seeker) { check(seeker, scene); }, any);
    }
  }
}

TEST(EverySeeker, AskAndTellAreNoexceptAndDoNotAllocate) {
  on_every_seeker([](auto& seeker, const Scene& scene) {
    static_assert(noexcept(seeker.ask()) && noexcept(seeker.restart()));
    static_assert(noexcept(seeker.tell(std::declval<const Reading&>())));
    std::vector<double> limits = limit_values(scene, scene.space.start);
    const test_support::AllocationCounter counter;
    for (int k = 0; k < 700; ++k) {
      const Inputs& x = seeker.ask();
      const double j[] = {peak(x) + std::sin(k)};
      if (!limits.empty()) limits[0] = 148.0 + 0.3 * x[0];
      seeker.tell({j, limits, k % 50 == 7});
      if (k == 500) seeker.restart();
    }
    EXPECT_EQ(counter.count(), 0u);
  });
}

TEST(EverySeeker, ARestartForgetsWhatItLearntOfTheLimits) {
  on_every_seeker([](auto& seeker, const Scene& scene) {
    const StateColumns fresh = save_state(seeker);
    const auto active = [&] { return save_state(seeker).at("limit_active").front() == 1.0; };
    run(seeker, scene, 333);
    for (std::uint64_t k = 333; k < 700 && !active(); ++k)
      run(seeker, scene, 1, k);
    seeker.restart();
    for (const auto& [name, column] : save_state(seeker)) {
      if (!name.starts_with("limit") || name == "limit_good")
        continue;  // the good point has no meaning without its flag
      EXPECT_EQ(column, fresh.at(name)) << name;
    }
  });
}

TEST(Steps, OfTwoBesideALimitTheOneThatKeepsItIsSet) {
  Input coarse{"a", -1.0, 1.1}, fine{"b"};  // 1.1 is not a step of a
  coarse.step = 0.5;
  fine.step = 0.1;
  const Steps steps = steps_of({coarse, fine, Input{"c"}});
  Inputs wanted(3), set(3), below(3);
  wanted << 1.1, -0.27, 0.123;
  set << 1.0, -0.3, 0.123;
  const auto keeps = [](const Inputs&) { return -1.0; };
  EXPECT_TRUE(steps.nearest(wanted, keeps).isApprox(set, 1e-12)) << steps.nearest(wanted, keeps).transpose();
  wanted << 0.4, -0.27, 0.123;
  below << 0.0, -0.3, 0.123;
  const auto sum = [](const Inputs& at) { return at.sum() - 0.2; };  // over by .123 at the nearest
  EXPECT_TRUE(steps.nearest(wanted, sum).isApprox(below, 1e-12)) << steps.nearest(wanted, sum).transpose();
  EXPECT_FALSE(steps_of({Input{"c"}}).any());
}

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

RecordedSeeker<Spsa> two_inputs() {
  SpsaSettings settings;
  settings.space = space_at(inputs({8.0, -6.0}), 20.0);
  settings.seed = 4;
  return RecordedSeeker<Spsa>(Spsa(settings));
}

TEST(SeekerHistory, RoomThatWasMadeIsNotAllocatedAgain) {
  RecordedSeeker<Spsa> seeker = two_inputs();
  seeker.history().make_room(200);
  const double j[] = {1.0};
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 200; ++k) {
    seeker.ask();
    seeker.tell({j, {}, false});
  }
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::optimize
