// The performance J: each term by hand, their sum, and what is refused.
#include "mgdd/engine/performance.hpp"

#include <gtest/gtest.h>

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

static_assert(noexcept(std::declval<const Performance&>().components(std::declval<const PerformanceSignals&>(),
                                                                     std::span<double>())));
static_assert(std::is_trivially_copyable_v<Performance>);

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

}  // namespace
}  // namespace mgdd::engine
