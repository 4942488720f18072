// The best timing of the cycle model within a bounded amount of work: the bound of gradient
// ascent, its fallback, edges, points that have no optimum, real time.
#include "mgdd/guide/model_optimum.hpp"

#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

using test_support::EngineCase;

ModelOptimumSettings settings_of(const EngineCase& c) {
  ModelOptimumSettings s;
  s.cylinder = c.cylinder;
  return s;
}

// 2/|J''| = 39 CAD^2 per point: below it the ascent converges, above it it does not, and golden section takes over.
TEST(ModelOptimum, ConvergesBelowTheBoundOfTheStepAndFallsBackAboveIt) {
  const EngineCase c;
  const double expected = test_support::best_soc_cad(c, "efficiency_gross");
  for (const double step_size : {5.0, 10.0, 15.0, 18.0, 30.0, 45.0}) {
    ModelOptimumSettings s = settings_of(c);
    s.step_size = step_size;
    const ModelOptimumResult found = ModelOptimum(s).find(c.point);
    EXPECT_EQ(found.method, step_size < 39.0 ? OptimumMethod::gradient : OptimumMethod::golden_section) << step_size;
    EXPECT_NEAR(found.soc_cad, expected, 0.06) << step_size;
    if (step_size == 18.0) {
      EXPECT_LE(found.iterations, 4);
    }
    if (step_size == 45.0) {
      EXPECT_EQ(found.iterations, 60);
    }
  }
}

TEST(ModelOptimum, EndsAtAnEdgeThatHoldsItBack) {
  const EngineCase c;
  ModelOptimumSettings s = settings_of(c);
  s.lower_cad = -30.0;
  s.upper_cad = -9.0;
  const ModelOptimumResult late = ModelOptimum(s).find(c.point);
  EXPECT_TRUE(late.at_bound);
  EXPECT_EQ(late.soc_cad, -9.0);
  s.lower_cad = 0.0;
  s.upper_cad = 10.0;
  const ModelOptimumResult early = ModelOptimum(s).find(c.point);
  EXPECT_TRUE(early.at_bound);
  EXPECT_EQ(early.soc_cad, 0.0);
}

TEST(ModelOptimum, SaysWhereThereIsNoOptimum) {
  ModelOptimum optimum(settings_of(EngineCase()));
  const engine::OperatingPoint point;
  for (auto& [field, value] : std::initializer_list<std::pair<double engine::OperatingPoint::*, double>>{
           {&engine::OperatingPoint::fuel_mg, 0.0},
           {&engine::OperatingPoint::fuel_mg, std::nan("")},
           {&engine::OperatingPoint::speed_rpm, -1.0},
           {&engine::OperatingPoint::intake_pressure_kpa, std::numeric_limits<double>::infinity()}}) {
    engine::OperatingPoint bad = point;
    bad.*field = value;
    EXPECT_FALSE(optimum.find(bad).found);
    EXPECT_EQ(guide_value(optimum.find(bad)).optimum.size(), 0);
  }
  EXPECT_TRUE(optimum.find(point).found);
  EXPECT_EQ(guide_value(optimum.find(point)).optimum[0], optimum.find(point).soc_cad);
}

TEST(ModelOptimum, FindsWithoutAllocating) {
  ModelOptimum optimum(settings_of(EngineCase()));
  static_assert(noexcept(optimum.find(engine::OperatingPoint{})));
  engine::OperatingPoint point;
  const test_support::AllocationCounter counter;
  for (const double fuel : {6.0, 12.0, 20.0, 30.0, 40.0}) {
    point.fuel_mg = fuel;
    optimum.find(point);
  }
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::guide
