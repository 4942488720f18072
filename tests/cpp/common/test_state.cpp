#include "mgdd/common/state.hpp"

#include <limits>

#include <gtest/gtest.h>

namespace mgdd {
namespace {

struct Everything {
  double number = 0.1;
  bool flag = true;
  std::int64_t count = 7, phase = 3;
  std::vector<double> list{1.0, 2.0};
  Eigen::Vector3d vector{1.0, 2.0, 3.0};
  Eigen::Matrix2d matrix = Eigen::Matrix2d::Identity();

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("number", self.number);
    v("flag", self.flag);
    v("count", self.count);
    v("phase", self.phase, 10);
    v("list", self.list);
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
  there.list = {std::numeric_limits<double>::infinity(), 5e-324};
  there.matrix(0, 1) = 4.0;
  const StateColumns columns = save_state(there);
  EXPECT_EQ(columns.size(), 7u);
  EXPECT_EQ(columns.at("matrix"), (std::vector<double>{1.0, 0.0, 4.0, 1.0}));
  Everything back;
  restore_state(back, columns);
  EXPECT_EQ(save_state(back), columns);
  EXPECT_TRUE(std::signbit(back.number));
}

TEST(State, RefusesByColumnAndChangesNothing) {
  const StateColumns good = save_state(Everything{});
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
  EXPECT_NE(message([](auto& c) { c["new"] = {1.0}; }).find("8 columns, 7 are known"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["list"] = {1.0}; }).find("'list' has 1 entries: must have 2"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["phase"] = {10.0}; }).find("'phase' = 10: must lie in [0, 10)"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c["phase"] = {-1.0}; }).find("'phase' = -1"), std::string::npos);
  for (const double value : {0.5, 1e300, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_NE(message([&](auto& c) { c["count"] = {value}; }).find("'count' must hold a whole number"),
              std::string::npos);
}

}  // namespace
}  // namespace mgdd
