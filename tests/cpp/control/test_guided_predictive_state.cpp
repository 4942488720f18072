// The guided predictive controller as a part of a running system: bad input, taking over, a restart bit for bit, both
// scalars, no allocation, refusals by name.
#include "mgdd/common/error.hpp"
#include "mgdd/control/guided_predictive.hpp"
#include "support/guided_plate.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::control {
namespace {

using namespace test_support;

static_assert(noexcept(std::declval<GuidedPredictive&>().step(0.0, 0.0)));
static_assert(noexcept(std::declval<BasicGuidedPredictive<float>&>().step(0.0F, 0.0F)));
static_assert(noexcept(std::declval<GuidedPredictive&>().prepare()) &&
              noexcept(std::declval<GuidedPredictive&>().refine()));

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(GuidedPredictive, BadInputRepeatsTheReferenceOrCorrectsNothing) {
  GuidedPredictive controller(asymmetric());
  EXPECT_EQ(controller.step(nan, nan), 0.0);
  EXPECT_EQ(controller.step(30.0, nan), 0.0);
  GuidedPredictive same(asymmetric());
  same.step(30.0, 20.0);
  GuidedPredictive other = same;
  EXPECT_EQ(same.step(nan, 20.5), other.step(30.0, 20.5));
  for (int k = 0; k < 20; ++k) {
    EXPECT_TRUE(std::isfinite(same.step(30.0, nan)));
    EXPECT_TRUE(std::isfinite(same.step(std::numeric_limits<double>::infinity(), 21.0)));
  }
  same.take_over(nan, 0.2);
  EXPECT_NE(same.duty(), 0.2);
  same.take_over(25.0, 0.2);
  EXPECT_EQ(same.duty(), 0.2);
}

TEST(GuidedPredictive, TakesOverWithoutABump) {
  const GuidedPredictiveSettings s = asymmetric();
  Plant plant(s.plate, 40.0);
  GuidedPredictive controller(s);
  controller.take_over(40.0, 0.18);
  double last = 0.18;
  for (int k = 0; k < 50; ++k) {
    const double duty = controller.step(40.0, plant.angle_deg());
    EXPECT_NEAR(duty, last, 0.003);
    last = duty;
    plant.step(duty);
  }
}

template <class Controller, class T>
std::vector<T> driven(Controller& controller, int from, int to) {
  std::vector<T> duties;
  for (int k = from; k < to; ++k) {
    const double noise = 0.03 * std::sin(1.7 * k * k);
    duties.push_back(controller.step(T(driving(k)), T(driving(k - 20) + noise)));
  }
  return duties;
}

TEST(GuidedPredictive, ASavedOneGoesOnBitForBit) {
  for (const bool learning : {true, false}) {
    GuidedPredictiveSettings s = asymmetric();
    s.friction_learning = learning;
    GuidedPredictive first(s), second(s);
    driven<GuidedPredictive, double>(first, 20, 700);
    restore_state(second, save_state(first));
    EXPECT_EQ((driven<GuidedPredictive, double>(first, 700, 1200)),
              (driven<GuidedPredictive, double>(second, 700, 1200)));
    BasicGuidedPredictive<float> single(s), copy(s);
    driven<BasicGuidedPredictive<float>, float>(single, 20, 700);
    restore_state(copy, save_state(single));
    EXPECT_EQ((driven<BasicGuidedPredictive<float>, float>(single, 700, 900)),
              (driven<BasicGuidedPredictive<float>, float>(copy, 700, 900)));
    first.reset();
    GuidedPredictive made(s);
    EXPECT_EQ((driven<GuidedPredictive, double>(first, 20, 300)), (driven<GuidedPredictive, double>(made, 20, 300)));
  }
}

TEST(GuidedPredictive, FloatFollowsDouble) {
  GuidedPredictive wide(asymmetric());
  BasicGuidedPredictive<float> narrow(asymmetric());
  Plant a(asymmetric().plate, 30.0), b(asymmetric().plate, 30.0);
  double first = 0.0, second = 0.0;
  for (int k = 0; k < 4000; ++k) {
    a.step(wide.step(driving(k), a.angle_deg()));
    b.step(static_cast<double>(narrow.step(static_cast<float>(driving(k)), static_cast<float>(b.angle_deg()))));
    first += std::pow(driving(k) - a.angle_deg(), 2);
    second += std::pow(driving(k) - b.angle_deg(), 2);
  }
  EXPECT_NEAR(second, first, 0.02 * first);
}

TEST(GuidedPredictive, NeverAllocates) {
  for (const bool learning : {true, false}) {
    GuidedPredictiveSettings s = asymmetric();
    s.friction_learning = learning;
    GuidedPredictive controller(s);
    const std::array<double, 8> ahead{20.0, 21.0, 22.0, nan, 24.0, 25.0, 26.0, 27.0};
    const test_support::AllocationCounter counter;
    for (int k = 20; k < 500; ++k) {
      controller.prepare();
      controller.feedback(driving(k), driving(k - 20), ahead);
      controller.refine();
    }
    controller.take_over(20.0, 0.1);
    controller.reset();
    EXPECT_EQ(counter.count(), 0u);
  }
}

TEST(GuidedPredictive, RefusesByNameAndChangesNothing) {
  GuidedPredictive controller(asymmetric());
  PlateBelief<double> belief = controller.belief();
  belief.gain_factor = 3.0;
  EXPECT_THROW(controller.set_belief(belief), ParameterError);
  EXPECT_EQ(controller.belief().gain_factor, 1.0);
  auto columns = save_state(controller);
  columns["friction_above"] = {0.9};
  EXPECT_THROW(restore_state(controller, columns), ParameterError);
  EXPECT_EQ(controller.belief().above.friction, 0.08);
  for (const char* name : {"certified_gain_factor", "slope_damping_variance"}) {
    columns = save_state(controller);
    columns[name] = {1e3};
    EXPECT_THROW(restore_state(controller, columns), ParameterError) << name;
  }
}

}  // namespace
}  // namespace mgdd::control
