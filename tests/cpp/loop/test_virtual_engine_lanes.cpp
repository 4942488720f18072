// Benches side by side: the numbers of single ones, whatever stands in the other lanes and on any instruction set;
// a cycle that does not exist; refusals; no allocation.
#include "mgdd/loop/virtual_engine_lanes.hpp"

#include "mgdd/common/error.hpp"
#include "mgdd/loop/cycle_fields.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::loop {
namespace {

/// Each differs from its neighbours in all that may differ.
BenchSettings settings_of(std::size_t i) {
  const auto x = static_cast<double>(i);
  BenchSettings s;
  s.cylinder.wall_heat.wall_heat_scale = 0.4 + 0.02 * x;
  s.cylinder.burn.burn_duration_ref_cad = 26.0 + x;
  engine::OperatingPoint point;
  point.speed_rpm = 1000.0 + 150.0 * x;
  point.fuel_mg = 20.0 + 3.0 * x;
  s.schedule = {{0, point}};
  point.fuel_mg += 6.0;
  point.intake_pressure_kpa += 10.0;
  s.schedule.push_back({40 + static_cast<std::int64_t>(i), point});
  s.soc_scatter_cad = 0.1 * x;
  s.misfire_probability = i % 2 == 0 ? 0.05 : 0.0;
  s.wall_heat_drift_per_kcycle = i == 3 ? 0.4 : 0.0;
  s.soc_drift_cad_per_kcycle = i == 4 ? 5.0 : 0.0;
  s.performance = engine::efficiency_and_nox();
  s.delay_whole_objective = i == 5;
  s.limits = {"p_max_bar", "ca50_cad", "cov_imep_percent"};
  s.seed = 7 + i;
  return s;
}

std::vector<VirtualEngine> benches_of(std::size_t n) {
  std::vector<VirtualEngine> out;
  for (std::size_t i = 0; i < n; ++i)
    out.emplace_back(settings_of(i));
  return out;
}

double request(std::size_t i, int k) {
  return -8.0 + 6.0 * std::sin(0.1 * k + static_cast<double>(i));
}

/// All numbers of a cycle, one after another.
std::vector<double> numbers_of(const BenchCycle& c) {
  std::vector<double> out;
  for (const auto& number : bench_cycle_numbers)
    out.push_back(number.of(c));
  for (const auto& flag : bench_flags)
    out.push_back(c.*(flag.member) ? 1.0 : 0.0);
  for (const auto& field : engine::indicator_fields<double>())
    out.push_back(c.indicators.*(field.member));
  for (const double value : c.component_values())
    out.push_back(value);
  for (const double value : c.limits())
    out.push_back(value);
  return out;
}

/// A whole run of some of the benches, the numbers of each in a row of its own.
std::vector<std::vector<double>> run(const std::vector<std::size_t>& which, InstructionSet set, int cycles = 90) {
  std::vector<VirtualEngine> benches;
  for (const std::size_t i : which)
    benches.emplace_back(settings_of(i));
  VirtualEngineLanes lanes(std::move(benches), set);
  std::vector<double> soc(which.size());
  std::vector<BenchCycle> out(which.size());
  std::vector<std::vector<double>> rows(which.size());
  for (int k = 0; k < cycles; ++k) {
    for (std::size_t lane = 0; lane < which.size(); ++lane)
      soc[lane] = request(which[lane], k);
    lanes.step(soc, out);
    for (std::size_t lane = 0; lane < which.size(); ++lane) {
      const std::vector<double> numbers = numbers_of(out[lane]);
      rows[lane].insert(rows[lane].end(), numbers.begin(), numbers.end());
    }
  }
  return rows;
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!(a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i])))) return false;
  }
  return true;
}

TEST(VirtualEngineLanes, EachMeasuresWhatItMeasuresAlone) {
  VirtualEngineLanes lanes(benches_of(9));
  ASSERT_EQ(lanes.size(), 9u);
  std::vector<VirtualEngine> alone = benches_of(9);
  std::vector<double> soc(9);
  std::vector<BenchCycle> out(9);
  int misfires = 0;
  for (int k = 0; k < 150; ++k) {
    for (std::size_t i = 0; i < 9; ++i)
      soc[i] = k == 70 ? std::numeric_limits<double>::quiet_NaN() : request(i, k);
    lanes.step(soc, out);
    for (std::size_t i = 0; i < 9; ++i) {
      const std::vector<double> now = numbers_of(out[i]), expected = numbers_of(alone[i].step(soc[i]));
      ASSERT_EQ(now.size(), expected.size());
      for (std::size_t j = 0; j < now.size(); ++j) {
        if (std::isnan(expected[j])) {
          ASSERT_TRUE(std::isnan(now[j])) << "number " << j << " of bench " << i << " in cycle " << k;
        } else {
          ASSERT_NEAR(now[j], expected[j], 1e-9 * std::abs(expected[j]) + 1e-9)
              << "number " << j << " of bench " << i << " in cycle " << k;
        }
      }
      misfires += out[i].misfire ? 1 : 0;
    }
  }
  EXPECT_GT(misfires, 10);  // a lane without fuel beside lanes with fuel
}

TEST(VirtualEngineLanes, ALaneDependsOnNothingBesideIt) {
  const auto all = run({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}, instruction_set());
  const auto some = run({11, 3, 5}, instruction_set());
  EXPECT_TRUE(same_bits(some[0], all[11]));
  EXPECT_TRUE(same_bits(some[1], all[3]));
  EXPECT_TRUE(same_bits(some[2], all[5]));
  EXPECT_FALSE(same_bits(some[0], all[3]));
  EXPECT_TRUE(same_bits(run({3}, InstructionSet::baseline)[0], all[3]));
}

TEST(VirtualEngineLanes, ACycleThatDoesNotExistLeavesItsNeighboursAlone) {
  BenchSettings well;
  well.step_cad = 5.0;
  BenchSettings hot = well;  // wall heat grows until the pressure turns negative
  hot.schedule.front().point.speed_rpm = 50.0;
  hot.wall_heat_drift_per_kcycle = 100.0;
  VirtualEngineLanes lanes({VirtualEngine(well), VirtualEngine(hot)});
  VirtualEngine healthy(well), alone(hot);
  std::vector<BenchCycle> out(2);
  const std::vector<double> soc{-6.0, -6.0};
  int unphysical = 0;
  for (int k = 0; k < 1000; ++k) {
    lanes.step(soc, out);
    const BenchCycle a = healthy.step(-6.0), b = alone.step(-6.0);
    ASSERT_NEAR(out[0].indicators.efficiency_gross, a.indicators.efficiency_gross, 1e-10);
    ASSERT_EQ(out[1].unphysical, b.unphysical) << k;
    ASSERT_NEAR(out[1].j, b.j, 1e-9);
    unphysical += out[1].unphysical ? 1 : 0;
    ASSERT_EQ(std::isnan(out[1].indicators.p_max_bar), b.unphysical) << k;
  }
  EXPECT_GT(unphysical, 0);
  EXPECT_LT(unphysical, 1000);
}

TEST(VirtualEngineLanes, RefusesWhatCannotRunSideBySide) {
  EXPECT_THROW(VirtualEngineLanes({}), ParameterError);
  EXPECT_THROW(VirtualEngineLanes(benches_of(17)), ParameterError);
  BenchSettings other;
  other.cylinder.gas.gamma_model = engine::GammaModel::linear;
  EXPECT_FALSE(side_by_side(VirtualEngine(other), VirtualEngine(other)));
  other = {};
  other.step_cad = 0.5;
  EXPECT_FALSE(side_by_side(VirtualEngine(other), VirtualEngine(BenchSettings{})));
  other = {};
  other.cylinder.geometry.bore_mm += 1.0;
  EXPECT_THROW(VirtualEngineLanes({VirtualEngine(other), VirtualEngine(BenchSettings{})}), ParameterError);
}

TEST(VirtualEngineLanes, AStepAllocatesNothing) {
  VirtualEngineLanes lanes(benches_of(6));
  const std::vector<double> soc(6, -6.0);
  std::vector<BenchCycle> out(6);
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 60; ++k)
    lanes.step(soc, out);
  EXPECT_EQ(counter.count(), 0u);
}

}  // namespace
}  // namespace mgdd::loop
