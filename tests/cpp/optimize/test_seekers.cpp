// What holds for every seeker and form: the search on a noisy quadratic from far away, and the protocol of ask and
// tell.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

constexpr int forms = 8;

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

TEST(EverySeeker, AskingAgainGivesTheSame) {
  on_every_seeker([](auto& seeker, const Scene& scene) {
    run(seeker, scene, 33);
    const Inputs first = seeker.ask();
    EXPECT_EQ(first, seeker.ask());
    EXPECT_EQ(first, seeker.applied());
  });
}

TEST(EverySeeker, AMisfireOnlyCounts) {
  on_every_seeker([](auto& seeker, const Scene& scene) {
    run(seeker, scene, 57);
    auto other = seeker;
    const Inputs x = seeker.ask();
    const double nothing[] = {std::nan("")};
    EXPECT_EQ(seeker.tell({nothing, {}, true}), TellStatus::misfire);
    EXPECT_EQ(seeker.protocol().cycle, 58);
    EXPECT_EQ(seeker.protocol().misfires, 1);
    EXPECT_EQ(seeker.ask(), x);
    StateColumns after = save_state(seeker);
    other.ask();
    StateColumns before = save_state(other);
    for (StateColumns* const state : {&before, &after})  // where it failed is counted as well
      std::erase_if(*state, [](const auto& column) { return column.first.starts_with("failing_"); });
    before["cycle"] = {58.0};
    before["misfires"] = {1.0};
    EXPECT_EQ(before, after);
  });
}

TEST(EverySeeker, ARefusedReadingChangesNothing) {
  on_every_seeker([](auto& seeker, const Scene& scene) {
    run(seeker, scene, 41);
    auto untouched = seeker;
    const double good[] = {1.0};
    const std::vector<double> limits = limit_values(scene, scene.space.start);
    EXPECT_EQ(seeker.tell({good, limits, false}), TellStatus::not_asked);
    EXPECT_EQ(seeker.tell({good, limits, true}), TellStatus::not_asked);
    EXPECT_EQ(save_state(seeker), save_state(untouched));
    seeker.ask();
    untouched.ask();
    for (const double bad : {std::nan(""), unlimited, -unlimited, 1e308, -1e308, 1.001e30, -9.9e37}) {
      const double j[] = {bad};
      const Reading reading{j, limits, false};
      EXPECT_EQ(seeker.tell(reading), TellStatus::not_a_reading);
      try {
        require(TellStatus::not_a_reading, seeker.protocol(), reading, 1, limits.size(), scene.space.size());
        FAIL();
      } catch (const DataError& e) {
        EXPECT_NE(std::string(e.what()).find("cycle 41: J = "), std::string::npos) << e.what();
        EXPECT_EQ(e.field, "J");
      }
    }
    const double two[] = {1.0, 2.0};
    EXPECT_EQ(seeker.tell({two, limits, false}), TellStatus::wrong_component_count);
    EXPECT_EQ(seeker.tell({good, two, false}), TellStatus::wrong_limit_count);
    if (!limits.empty()) {
      std::vector<double> broken = limits;
      for (const double bad : {std::nan(""), 1e308}) {
        broken[1] = bad;
        EXPECT_EQ(seeker.tell({good, broken, false}), TellStatus::not_a_reading);
      }
    }
    EXPECT_EQ(save_state(seeker), save_state(untouched));
    run(seeker, scene, 60, 41);
    run(untouched, scene, 60, 41);
    EXPECT_EQ(save_state(seeker), save_state(untouched));
    const double j[] = {1.0};
    EXPECT_EQ(seeker.tell({j, limits, false}), TellStatus::not_asked) << "twice";
  });
}

bool all_finite(const StateColumns& columns) {
  for (const auto& [name, column] : columns) {
    for (const double value : column) {
      if (!std::isfinite(value)) return false;
    }
  }
  return true;
}

TEST(EverySeeker, StaysFiniteWhateverReadingsItTakes) {
  // Alternating signs are the worst case of every difference: 1e308 - -1e308 is not finite.
  for (const double size : {1e308, 1e200, 1e100, largest_reading, 1e25, 1e8}) {
    on_every_seeker([&](auto& seeker, const Scene& scene) {
      for (int k = 0; k < 600; ++k) {
        const double sign = random::bits(3, 1, static_cast<std::uint64_t>(k)) >> 63 ? 1.0 : -1.0;
        ASSERT_TRUE(seeker.ask().allFinite());
        const double j[] = {sign * size};
        std::vector<double> limits = limit_values(scene, scene.space.start);
        for (double& value : limits)
          value = k % 3 == 0 ? -sign * size : value;
        seeker.tell({j, limits, false});
        ASSERT_TRUE(all_finite(save_state(seeker))) << size << ", cycle " << k;
      }
    });
  }
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

// --- bounds -------------------------------------------------------------------------------------------------

TEST(EverySeeker, StaysWithinTightBoundsWhateverItIsTold) {
  for (const double bound : {6.0, 9.0}) {
    for (auto& [name, any] : every_seeker(space_at(scalar_input(1.0), bound), 0.25)) {
      SCOPED_TRACE(name);
      std::visit(
          [&](auto& seeker) {
            for (int k = 0; k < 400; ++k) {
              const double x = seeker.ask()[0];
              ASSERT_LE(std::abs(x), bound * (1.0 + 1e-15));
              const double j[] = {1e3 * random::normal(9, 2, static_cast<std::uint64_t>(k)) + 50.0 * x};
              seeker.tell({j, {}, false});
            }
          },
          any);
    }
  }
}

TEST(EverySeeker, RefusesAStartOutsideItsBounds) {
  for (const double start : {30.0, -30.0, 20.5, std::nan("")})
    EXPECT_THROW(every_seeker(space_at(scalar_input(start), 20.0), 0.25), ParameterError) << start;
  SearchSpace space = space_at(scalar_input(0.0), 20.0);
  space.upper[0] = -21.0;
  EXPECT_THROW(every_seeker(space, 0.25), ParameterError);
  space.upper = inputs({1.0, 2.0});
  EXPECT_THROW(every_seeker(space, 0.25), ShapeError);
  space.start = Inputs(0);
  EXPECT_THROW(every_seeker(space, 0.25), ShapeError);
}

// --- state --------------------------------------------------------------------------------------------------

TEST(EverySeeker, AStateInTheMiddleContinuesToTheLastBit) {
  on_every_seeker([](auto& seeker, const Scene& scene) {
    auto fresh = seeker;
    for (const int middle : {1, 38, 133}) {
      run(seeker, scene, middle);
      seeker.ask();
      const StateColumns saved = save_state(seeker);
      restore_state(fresh, saved);
      EXPECT_EQ(save_state(fresh), saved);
      EXPECT_EQ(fresh.applied(), seeker.applied());
      auto ahead = seeker;
      run(ahead, scene, 200, 1000);
      run(fresh, scene, 200, 1000);
      EXPECT_EQ(save_state(fresh), save_state(ahead));
    }
  });
}

TEST(EverySeeker, AStateOfAnotherKindOrSizeIsRefusedAndChangesNothing) {
  const std::vector<Scene> all = scenes();
  const auto one = every_seeker(all[0].space, 0.25), three = every_seeker(all[3].space, 0.25, 3, all[3].limits);
  for (std::size_t i = 0; i < one.size(); ++i) {
    Seeker any = one[i].second;
    std::visit(
        [&](auto& seeker) {
          run(seeker, all[0], 15);
          const StateColumns before = save_state(seeker);
          const auto refused = [&](const StateColumns& other) {
            EXPECT_THROW(restore_state(seeker, other), ParameterError) << one[i].first;
            EXPECT_EQ(save_state(seeker), before);
          };
          if (i < three.size()) {
            std::visit([&](const auto& other) { refused(save_state(other)); }, three[i].second);
          }
          const std::size_t kind = i < 3 ? 3 : 0;  // the forms of one kind differ in their windows only
          std::visit([&](const auto& other) { refused(save_state(other)); }, one[kind].second);
          StateColumns changed = before;
          changed.erase("cycle");
          refused(changed);
          changed = before;
          changed["unheard_of"] = {1.0};
          refused(changed);
          changed = before;
          changed["cycle"] = {1.5};
          refused(changed);
          changed["cycle"] = {unlimited};
          refused(changed);
          for (const char* const index : {"phase", "stage", "turn"}) {
            if (!before.contains(index)) continue;
            for (const double value : {-1.0, 1e6}) {
              changed = before;
              changed[index] = {value};
              refused(changed);
            }
          }
        },
        any);
  }
}

}  // namespace
}  // namespace mgdd::optimize
