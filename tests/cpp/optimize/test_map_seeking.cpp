// A search for a map on a spark engine of its own.
#include "mgdd/common/state.hpp"
#include "support/no_alloc.hpp"
#include "support/spark_engine.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

using namespace test_support;

TEST(MapSeeking, TenVisitsAndARoughModelMakeTheMapOfAnotherEngine) {
  const Plant plant, rough{.octane = -4.0, .mbt_shift = 5.0, .scale = 0.8};
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    MapSeeking search(settings(seed, &rough));
    const Judged found = visited(search, plant, 10, seed);
    EXPECT_LT(found.worst_loss, 0.6) << seed;  // N m of some 60 to 180
    EXPECT_LT(found.worst_knock, 1.05 * knock_limit) << seed;
  }
}

TEST(MapSeeking, WithoutAModelItTakesMoreVisits) {
  const Plant plant;
  int near = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    MapSeeking search(settings(seed, nullptr));
    near += visited(search, plant, 40, seed).worst_loss < 10.0 ? 1 : 0;
  }
  EXPECT_GE(near, 7);  // as 28 of 40 are
}

// Sum over both axes of squared second differences, in ranges of the spark per squared mean step.
double bends(MapSeeking& search) {
  const auto& axes = search.settings().axes;
  const auto at = [&](std::size_t i, std::size_t j) { return search.best(i * axes[1].size() + j).input[0] / 55.0; };
  const auto bend = [](const std::vector<double>& axis, std::size_t k, double low, double middle, double high) {
    const double step = (axis.back() - axis.front()) / static_cast<double>(axis.size() - 1);
    const double before = (axis[k] - axis[k - 1]) / step, after = (axis[k + 1] - axis[k]) / step;
    const double second = 2.0 / (before + after) * ((high - middle) / after - (middle - low) / before);
    return second * second;
  };
  double out = 0.0;
  for (std::size_t i = 0; i < axes[0].size(); ++i) {
    for (std::size_t j = 0; j < axes[1].size(); ++j) {
      if (i > 0 && i + 1 < axes[0].size()) out += bend(axes[0], i, at(i - 1, j), at(i, j), at(i + 1, j));
      if (j > 0 && j + 1 < axes[1].size()) out += bend(axes[1], j, at(i, j - 1), at(i, j), at(i, j + 1));
    }
  }
  return out;
}

// By the same readings: what a smooth map loses, its bends no longer cost.
TEST(MapSeeking, ASmoothMapIsWorthMoreThanThePlainOneWhereBendsCost) {
  const Plant plant, rough{.octane = -4.0, .mbt_shift = 5.0, .scale = 0.8};
  MapSeekingSettings own = settings(3, &rough);
  own.axes = {{1.0, 1.5, 2.6, 4.0}, {0.3, 0.55, 0.9}};
  MapSeeking plain(own);
  own.smoothness = 3000.0;
  MapSeeking smooth(own);
  for (std::uint64_t k = 0; k < 12; ++k) {
    const MapSeeking::Visit visit = smooth.suggest();
    for (MapSeeking* one : {&plain, &smooth})
      read(*one, plant, visit.context, visit.input, k);
  }
  const auto expected = [](MapSeeking& search) {
    double out = 0.0;
    for (std::size_t c = 0; c < search.cells(); ++c)
      out += search.best(c).expected;
    return out;
  };
  EXPECT_LT(bends(smooth), 0.6 * bends(plain));
  EXPECT_GT(expected(smooth) - own.smoothness * bends(smooth), expected(plain) - own.smoothness * bends(plain));
  EXPECT_LE(expected(smooth), expected(plain) + 0.01);
  for (std::size_t c = 0; c < smooth.cells(); ++c)
    EXPECT_LE(plant.knock(smooth.cell(c), smooth.best(c).input[0]), 1.02 * knock_limit) << c;
}

TEST(MapSeeking, AModelOfTheWrongWayIsLeftBehind) {
  const Plant plant, wrong{.octane = 0.0, .mbt_shift = 0.0, .scale = -1.0};
  MapSeeking search(settings(1, &wrong));
  EXPECT_LT(visited(search, plant, 40, 1).worst_loss, 20.0);  // of 90 where it begins
}

TEST(MapSeeking, AskFindsTheBestOfAPointBetweenTheCells) {
  const Plant plant, rough{.octane = -4.0, .mbt_shift = 5.0, .scale = 0.8};
  MapSeeking search(settings(2, &rough));
  visited(search, plant, 8, 2);
  const Inputs at = point(2.4, 0.45);
  double lost = 0.0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    const Inputs asked = search.ask(at);
    lost += (plant.torque(at, plant.best(at)) - plant.torque(at, asked[0])) / 12.0;
    read(search, plant, at, asked, 70'000 + k);
  }
  EXPECT_LT(lost, 0.6);
}

TEST(MapSeeking, LookingAtTheMapOfADriveChangesNothing) {
  const Plant plant, rough{.octane = -4.0, .mbt_shift = 5.0, .scale = 0.8};
  MapSeeking looked(settings(8, &rough)), left(settings(8, &rough));
  for (std::uint64_t k = 0; k < 14; ++k) {
    const Inputs at = point(1.3 + 0.2 * static_cast<double>(k % 5), 0.4 + 0.1 * static_cast<double>(k % 3));
    looked.best(k % looked.cells());
    const Inputs asked = left.ask(at);
    EXPECT_EQ(looked.ask(at), asked) << k;
    read(looked, plant, at, asked, 800 + k);
    read(left, plant, at, asked, 800 + k);
  }
}

TEST(MapSeeking, AskAndTellAllocateNothing) {
  const Plant plant;
  MapSeeking search(settings(3, &plant));
  visited(search, plant, 4, 3);
  const Inputs at = point(1.7, 0.8);
  const AllocationCounter counter;
  for (std::uint64_t k = 0; k < 6; ++k) {
    const Inputs asked = search.ask(at);
    const double torque = plant.torque(at, asked[0]);
    const std::array<double, 1> knock{plant.knock(at, asked[0])};
    search.tell(at, asked, {.components = {&torque, 1}, .limits = knock});
  }
  EXPECT_EQ(counter.count(), 0u);
  static_assert(noexcept(search.ask(at)) && noexcept(search.suggest()));
}

TEST(MapSeeking, GoesOnBitForBitFromItsState) {
  const Plant plant, rough{.octane = 2.0, .mbt_shift = -3.0, .scale = 1.1};
  MapSeeking search(settings(4, &rough)), copy(settings(4, &rough));
  visited(search, plant, 7, 4);
  restore_state(copy, save_state(search));
  for (int k = 0; k < 3; ++k) {
    const MapSeeking::Visit one = search.suggest(), other = copy.suggest();
    EXPECT_EQ(one.context, other.context);
    EXPECT_EQ(one.input, other.input);
    EXPECT_EQ(one.gain, other.gain);
    read(search, plant, one.context, one.input, static_cast<std::uint64_t>(k));
    read(copy, plant, other.context, other.input, static_cast<std::uint64_t>(k));
  }
  StateColumns broken = save_state(search);
  broken["place3"][0] = 1.5;
  EXPECT_THROW(restore_state(copy, broken), ParameterError);
  broken = save_state(search);
  broken["limit0_within"][0] = -1.0;
  EXPECT_THROW(restore_state(copy, broken), ParameterError);
}

TEST(MapSeeking, KeepsOutOfACellThatFails) {
  const Plant plant, rough{.octane = -4.0, .mbt_shift = 5.0, .scale = 0.8};
  MapSeeking search(settings(5, &rough));
  int failed = 0;
  for (std::uint64_t k = 0; k < 24; ++k) {
    const MapSeeking::Visit visit = search.suggest();
    const bool fails = visit.context[0] > 3.5 && visit.context[1] < 0.4;
    failed += fails ? 1 : 0;
    if (fails) {
      EXPECT_EQ(search.tell(visit.context, visit.input, Reading{.components = {}, .limits = {}, .misfire = true}),
                TellStatus::misfire);
    } else {
      read(search, plant, visit.context, visit.input, k);
    }
  }
  EXPECT_LE(failed, 4);
}

TEST(MapSeeking, RefusesWhatIsNoReadingAndChangesNothing) {
  const Plant plant;
  MapSeeking search(settings(6, &plant));
  visited(search, plant, 3, 6);
  const StateColumns before = save_state(search);
  const double nan = std::nan(""), torque = 100.0;
  const std::array<double, 1> knock{0.5}, bad{nan};
  EXPECT_EQ(search.tell(point(2, 0.5), scalar_input(9), {.components = {&nan, 1}, .limits = knock}),
            TellStatus::not_a_reading);
  EXPECT_EQ(search.tell(point(2, 0.5), scalar_input(9), {.components = {&torque, 1}, .limits = bad}),
            TellStatus::not_a_reading);
  EXPECT_EQ(search.tell(point(2, 0.5), scalar_input(9), Reading{.components = {&torque, 1}, .limits = {}}),
            TellStatus::wrong_limit_count);
  EXPECT_EQ(save_state(search), before);
}

TEST(MapSeeking, RefusesSettingsByName) {
  const Plant plant;
  const auto refused = [&](const auto& change) {
    MapSeekingSettings s = settings(0, &plant);
    change(s);
    try {
      MapSeeking const search(std::move(s));
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refused([](auto& s) { s.axes[1] = {0.3, 0.3}; }).find("axes of load"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s.axes[0].back() = 5.0; }).find("axes of speed_krpm"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s.axes.pop_back(); }).find("axes"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s.context[0].upper = unlimited; }).find("speed_krpm"), std::string::npos);
  EXPECT_NE(refused([](auto& s) { s.space.lower = scalar_input(-unlimited); }).find("lower"), std::string::npos);
  EXPECT_NE(refused([](auto& s) {
              s.limit_guides.clear();
              s.guide.push_back(s.guide[0]);
            }).find("guide"),
            std::string::npos);
}

TEST(MapSeeking, ALimitWhoseKinkLiesBeforeThatOfTheModelIsKept) {
  const Plant plant{.motored = 0.7}, rough{.octane = 5.0, .mbt_shift = 2.0, .motored = 0.7};
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    MapSeeking search(settings(seed, &rough));
    const double visits = visited(search, plant, 12, seed).worst_knock;
    double map = 0.0;
    for (std::size_t c = 0; c < search.cells(); ++c)
      map = std::max(map, plant.knock(search.cell(c), search.best(c).input[0]));
    EXPECT_LT(visits, 1.05 * knock_limit) << seed;
    EXPECT_LT(map, 1.01 * knock_limit) << seed;
  }
}

TEST(MapSeeking, AnOddVisitIsMadeAgainAndDoesNotSpoilTheMap) {
  const Plant plant, rough{.octane = -4.0, .mbt_shift = 5.0, .scale = 0.8};
  for (const double lie : {-25.0, 25.0}) {
    for (const int when : {7, 11}) {
      MapSeeking search(settings(6, &rough));
      visited(search, plant, when, 6);
      const MapSeeking::Visit visit = search.suggest();
      const double torque = plant.torque(visit.context, visit.input[0]) + lie;
      const std::array<double, 1> knock{plant.knock(visit.context, visit.input[0])};
      search.tell(visit.context, visit.input, {.components = {&torque, 1}, .limits = knock});
      const MapSeeking::Visit again = search.suggest();
      EXPECT_EQ(again.context, visit.context) << lie << ' ' << when;
      EXPECT_EQ(again.input, visit.input) << lie << ' ' << when;
      const Judged found = visited(search, plant, 6, 60);
      EXPECT_LT(found.worst_loss, 1.0) << lie << ' ' << when;
      EXPECT_LT(found.worst_knock, 1.05 * knock_limit) << lie << ' ' << when;
    }
  }
}

TEST(MapSeeking, ATrueSurpriseIsBelievedOnceItIsReadTwice) {
  const Plant plant, worn{.octane = 0.0, .mbt_shift = 0.0, .scale = 0.85};
  double off = 0.0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    MapSeeking search(settings(seed, &plant));
    visited(search, plant, 8, seed);
    int repeats = 0;
    MapSeeking::Visit before = search.suggest();
    for (std::uint64_t k = 0; k < 12; ++k) {
      read(search, worn, before.context, before.input, 100 * seed + k);
      const MapSeeking::Visit next = search.suggest();
      repeats += next.context == before.context && next.input == before.input ? 1 : 0;
      before = next;
    }
    EXPECT_GE(repeats, 1) << seed;
    EXPECT_LE(repeats, 6) << seed;
    for (std::size_t c = 0; c < search.cells(); ++c) {
      const MapSeeking::Best best = search.best(c);
      off += std::abs(best.expected - worn.torque(search.cell(c), best.input[0])) / 96.0;
    }
  }
  EXPECT_LT(off, 8.0);  // N m of the 16 that it has lost
}

TEST(MapSeeking, WhereNoInputIsSafeTheMapGivesTheBestOfThoseThatAreAboutAsLikelyToBe) {
  const Plant plant, rough{.octane = -1.0, .mbt_shift = 1.0, .scale = 0.9};
  int unsafe = 0, cells = 0;
  double later = 0.0, raised = 0.0;
  for (std::uint64_t seed = 5; seed < 11; ++seed) {
    MapSeekingSettings own = settings(seed, &rough);
    own.limits = {{"knock", 0.01}};  // some cells keep it nowhere, and late sparks knock least
    MapSeeking strict(own);
    own.limit_probability = 0.7;
    MapSeeking bold(own);
    for (std::uint64_t k = 0; k < 10; ++k) {
      const MapSeeking::Visit visit = strict.suggest();
      read(strict, plant, visit.context, visit.input, 1000 * seed + k);
      read(bold, plant, visit.context, visit.input, 1000 * seed + k);
    }
    for (std::size_t c = 0; c < strict.cells(); ++c) {
      const MapSeeking::Best least = strict.best(c), more = bold.best(c);
      ++cells;
      if (least.excess <= 0.0 || more.excess <= 0.0) continue;
      ++unsafe;
      EXPECT_LT(strict.holds(c, 0), 0.95) << c;
      EXPECT_GE(bold.holds(c, 0), 0.7 * strict.holds(c, 0)) << c;
      raised += more.expected - least.expected;
      later += more.input[0] - least.input[0];
    }
  }
  EXPECT_GT(unsafe, 3);
  EXPECT_LT(unsafe, cells / 2);
  EXPECT_GT(later, 0.5 * unsafe);
  EXPECT_GT(raised, 0.5 * unsafe);
}

}  // namespace
}  // namespace mgdd::optimize
