// Many cycles: the same as each alone, whatever the threads; warnings counted; errors name their cycle.
#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

struct Record {
  test_support::EngineCase engine{"step_cad=0.5 ivc_temperature_k=340"};
  std::vector<double> angle;
  std::vector<std::vector<double>> pressure;

  std::vector<double> joined() const {
    std::vector<double> out;
    for (const auto& row : pressure)
      out.insert(out.end(), row.begin(), row.end());
    return out;
  }

  Record() {
    for (const double soc : {-8.0, -5.0, -2.0, 1.0, 3.0}) {
      engine.soc_cad = soc;
      const auto cycle = run(engine);
      angle = cycle.angles();
      pressure.push_back(cycle.pressures_bar());
    }
  }
};

TEST(EngineTraceCycles, EachCycleIsAnalysedAsAlone) {
  const Record r;
  for (const std::size_t threads : {1u, 3u}) {
    const auto all = analyze_cycles(r.angle, r.joined(), r.engine.cylinder, r.engine.point, {}, true, threads);
    ASSERT_EQ(all.size(), 5u);
    for (std::size_t c = 0; c < 5; ++c) {
      const auto alone = analyze_trace(r.angle, r.pressure[c], r.engine.cylinder, r.engine.point, {});
      EXPECT_EQ(all[c].ca50_cad, alone.ca50_cad);
      EXPECT_EQ(all[c].heat_net_cumulative_j, alone.heat_net_cumulative_j);
      EXPECT_EQ(all[c].warnings, alone.warnings);
    }
    EXPECT_LT(all[0].ca50_cad + 8.0, all[4].ca50_cad);
  }
}

TEST(EngineTraceCycles, WithoutColumnsTheFiguresAreTheSame) {
  const Record r;
  const auto whole = analyze_cycles(r.angle, r.joined(), r.engine.cylinder, r.engine.point, {});
  const auto small = analyze_cycles(r.angle, r.joined(), r.engine.cylinder, r.engine.point, {}, false);
  EXPECT_EQ(small[0].volume_l, whole[0].volume_l);
  for (std::size_t c = 0; c < 5; ++c) {
    EXPECT_EQ(small[c].ca50_cad, whole[c].ca50_cad);
    EXPECT_EQ(small[c].heat_gross_j, whole[c].heat_gross_j);
    EXPECT_EQ(small[c].pressure_bar.capacity() + small[c].heat_net_cumulative_j.capacity(), 0u);
    EXPECT_EQ(small[c].angle_cad.empty(), c > 0);
  }
}

TEST(EngineTraceCycles, WarningsOfOneKindAreCounted) {
  Record r;
  for (const std::size_t c : {1u, 3u, 4u})
    r.pressure[c][60] += 40.0;
  const auto lines = count_warnings(analyze_cycles(r.angle, r.joined(), r.engine.cylinder, r.engine.point, {}));
  const auto spikes = std::count_if(lines.begin(), lines.end(), [](const TraceWarning& w) {
    return w.kind == "spike" && w.text.starts_with("3 of 5 cycles: the sample at -110") &&
           w.text.ends_with("(cycle 2)");
  });
  EXPECT_EQ(spikes, 1);
}

TEST(EngineTraceCycles, AnErrorNamesItsCycleCountedFromOne) {
  Record r;
  r.pressure[2][10] = std::numeric_limits<double>::quiet_NaN();
  r.pressure[4][10] = std::numeric_limits<double>::quiet_NaN();
  try {
    analyze_cycles(r.angle, r.joined(), r.engine.cylinder, r.engine.point, {});
    FAIL();
  } catch (const DataError& error) {
    EXPECT_TRUE(std::string(error.what()).starts_with("cycle 3: pressure_bar[10]")) << error.what();
    EXPECT_EQ(error.field, "pressure_bar");
  }
  EXPECT_THROW(analyze_cycles(r.angle, {}, r.engine.cylinder, r.engine.point, {}), ShapeError);
}

}  // namespace
}  // namespace mgdd::engine
