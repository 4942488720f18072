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

}  // namespace
}  // namespace mgdd::optimize
