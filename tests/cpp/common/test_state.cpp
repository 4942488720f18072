#include "mgdd/common/state.hpp"

#include <Eigen/Core>

#include "support/test.hpp"

namespace mgdd {
namespace {

struct Everything {
  double number = 0.1;
  bool flag = true;
  std::int64_t count = 7, phase = 3;
  std::array<std::int64_t, 2> places{0, 4};
  std::uint64_t word = 0;
  std::optional<double> maybe, perhaps = 2.0;
  std::vector<double> list{1.0, 2.0}, counted;
  std::array<double, 3> array{1.0, 2.0, 3.0};
  Eigen::Vector3d vector{1.0, 2.0, 3.0};
  Eigen::Matrix2d matrix = Eigen::Matrix2d::Identity();

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("number", self.number);
    v("flag", self.flag);
    v("count", self.count, -20, counts_end);
    v("phase", self.phase, 10);
    v("places", self.places, 5);
    v("word", self.word);
    v("maybe", self.maybe);
    v("perhaps", self.perhaps);
    v("list", self.list);
    v("counted", self.counted, static_cast<std::size_t>(self.phase));
    v("array", self.array);
    v("vector", self.vector);
    v("matrix", self.matrix);
  }
};

TEST(State, ColumnsHoldEveryMemberAndGiveItBack) {
  Everything there;
  there.number = -0.0;
  there.flag = false;
  there.count = -12;
  there.phase = 9;
  there.list = {-1.7e308, 5e-324};
  there.counted.assign(9, 0.25);
  there.word = 0xFEDCBA9876543210u;
  there.maybe = 0.5;
  there.perhaps.reset();
  there.array = {-1.0, 0.0, 1e-300};
  there.matrix(0, 1) = 4.0;
  const StateColumns columns = save_state(there);
  EXPECT_EQ(columns.size(), 13u);
  EXPECT_EQ(columns.at("matrix"), (std::vector<double>{1.0, 0.0, 4.0, 1.0}));
  Everything back;
  restore_state(back, columns);
  EXPECT_EQ(save_state(back), columns);
  EXPECT_TRUE(std::signbit(back.number));
  EXPECT_EQ(back.word, there.word);
  EXPECT_EQ(back.maybe, there.maybe);
  EXPECT_FALSE(back.perhaps.has_value());
}

TEST(State, RefusesByColumnAndChangesNothing) {
  Everything source;
  source.counted.assign(3, 0.0);
  const StateColumns good = save_state(source);
  const auto message = [&](auto change) -> std::string {
    StateColumns columns = good;
    change(columns);
    Everything object;
    object.number = 5.0;
    const StateColumns before = save_state(object);
    try {
      restore_state(object, columns);
    } catch (const ParameterError& e) {
      EXPECT_EQ(save_state(object), before);
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message([](auto& c) { c.erase("matrix"); }).find("'matrix' is missing"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["new"] = {1.0}; }).find("14 columns, 13 are known"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["list"] = {1.0}; }).find("'list' has 1 entries: must have 2"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["phase"] = {10.0}; }).find("'phase' = 10: must lie in [0, 10)"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["phase"] = {-1.0}; }).find("'phase' = -1"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["count"] = {-21.0}; }).find("must lie in [-20, 281474976710656)"),
            std::string::npos);
  EXPECT_NE(message([](auto& c) { c["count"] = {0x1p48}; }).find("must lie in [-20, 2"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["places"] = {0.0, 5.0}; }).find("'places' = 5: must lie in [0, 5)"),
            std::string::npos);
  for (const double value : {0.5, 1e300})
    EXPECT_NE(message([&](auto& c) { c["count"] = {value}; }).find(": must be a whole number"), std::string::npos);
  for (const char* name : {"number", "count", "word", "perhaps", "list", "counted", "array", "vector", "matrix"}) {
    for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      EXPECT_NE(message([&](auto& c) { c[name].back() = value; }).find(": must be finite"), std::string::npos) << name;
    }
  }
  EXPECT_NE(message([](auto& c) { c["flag"] = {2.0}; }).find("'flag' holds 2: must be 0 or 1"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["counted"] = {1.0}; }).find("must have 3"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["perhaps"] = {1.0, 2.0}; }).find("must have 1"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["word"] = {0.0, -1.0}; }).find("whole number >= 0"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["word"] = {4294967296.0, 0.0}; }).find("whole number >= 0"), std::string::npos);
}

// What has no end cannot be visited at all: neither read nor written, so that a new class cannot forget it.
template <class V>
concept VisitsWholeNumbersWithoutEnd = requires(V v, std::int64_t whole) { v("name", whole); };
static_assert(!VisitsWholeNumbersWithoutEnd<StateReader> && !VisitsWholeNumbersWithoutEnd<StateWriter>);

}  // namespace
}  // namespace mgdd
