// The performance J: each term by hand, their sum, and what is refused.
#include "mgdd/engine/performance.hpp"

#include <array>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"

namespace mgdd::engine {
namespace {

using enum PerformanceSignal;

PerformanceSignals example() {
  PerformanceSignals s;
  s[efficiency_percent] = 56.0;
  s[imep_gross_bar] = 9.6;
  s[imep_closed_bar] = 9.4;
  s[nox_ppm] = 1500.0;
  s[p_max_bar] = 110.0;
  s[dp_max_bar_per_cad] = 12.0;
  s[t_max_k] = 1950.0;
  return s;
}

std::string message_of(const std::vector<PerformanceTerm>& terms) {
  try {
    const Performance made{std::span<const PerformanceTerm>(terms)};
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "accepted";
}

static_assert(noexcept(std::declval<const Performance&>().components(std::declval<const PerformanceSignals&>(),
                                                                     std::span<double>())));
static_assert(std::is_trivially_copyable_v<Performance>);

TEST(Performance, IsEfficiencyUnlessToldOtherwise) {
  EXPECT_EQ(Performance().value(example()), 56.0);
  EXPECT_EQ(efficiency_only(), Performance());
  EXPECT_EQ(Performance().size(), 1u);
  EXPECT_FALSE(Performance().uses(nox_ppm));
}

TEST(Performance, WeighsNoxByTheDefaultOfFourThousandths) {
  const Performance j = efficiency_and_nox();
  std::array<double, 2> parts{};
  EXPECT_DOUBLE_EQ(j.components(example(), parts), 56.0 - 0.004 * 1500.0);
  EXPECT_EQ(parts[0], 56.0);
  EXPECT_DOUBLE_EQ(parts[1], -6.0);
  EXPECT_TRUE(j.uses(nox_ppm));
}

TEST(Performance, EverySignalReachesItsTerm) {
  const PerformanceSignals s = example();
  for (std::size_t i = 0; i < performance_signal_count; ++i) {
    const auto signal = static_cast<PerformanceSignal>(i);
    EXPECT_DOUBLE_EQ((Performance{{.signal = signal, .weight = 3.0, .reference = 2.0}}.value(s)), 1.5 * s.values[i]);
    EXPECT_EQ(parse_name<PerformanceSignal>("signal", name_of(signal)), signal);
    EXPECT_NE(unit_of(signal), "unknown");
  }
}

TEST(Performance, AHingeIsZeroToItsLimitAndQuadraticAbove) {
  const PerformanceTerm hinge{.signal = dp_max_bar_per_cad, .weight = -2.0, .reference = 7.0, .above = 10.0};
  EXPECT_EQ(hinge.value(4.0), 0.0);
  EXPECT_EQ(hinge.value(10.0), 0.0);
  EXPECT_DOUBLE_EQ(hinge.value(12.0), -2.0 * 0.04);
  EXPECT_DOUBLE_EQ(hinge.value(20.0), -2.0);
}

TEST(Performance, RefusesWhatCannotBeATerm) {
  EXPECT_EQ(message_of({}), "terms has 0 entries: must be 1 to 8");
  EXPECT_EQ(message_of(std::vector<PerformanceTerm>(9)), "terms has 9 entries: must be 1 to 8");
  EXPECT_EQ(message_of(std::vector<PerformanceTerm>(8)), "accepted");
  EXPECT_EQ(message_of({{}, {.signal = nox_ppm, .reference = 0.0}}),
            "terms[1].reference = 0 ppm: must be > 0 and finite");
  EXPECT_EQ(message_of({{.signal = p_max_bar, .above = -5.0}}), "terms[0].above = -5 bar: must be > 0 and finite");
  EXPECT_EQ(message_of({{.weight = std::numeric_limits<double>::quiet_NaN()}}),
            "terms[0].weight = nan: must be finite");
  EXPECT_EQ(message_of({{.signal = static_cast<PerformanceSignal>(99)}}), "terms[0].signal = 99: is not a signal");
  EXPECT_THROW(efficiency_and_nox(-0.1), ParameterError);
  EXPECT_THROW(parse_name<PerformanceSignal>("signal", "torque"), ParameterError);
}

}  // namespace
}  // namespace mgdd::engine
