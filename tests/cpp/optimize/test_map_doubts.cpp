// What a search for a map does with readings that are odd, and with limits that it cannot be sure of.
#include "support/spark_engine.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

using namespace test_support;

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
