// Refusals of traces that cannot be what the caller says they are.
#include "mgdd/engine/pressure/trace_check.hpp"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

struct Trace {
  std::vector<double> angle, pressure;
};

Trace good() {
  const auto cycle = run(test_support::EngineCase());
  return {cycle.angles(), cycle.pressures_bar()};
}

template <class Refused>
void expect_refusal(const Trace& t, const std::vector<std::string>& parts) {
  try {
    check_trace(t.angle, t.pressure);
    FAIL() << parts.front();
  } catch (const Refused& error) {
    for (const std::string& part : parts) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  }
}

TEST(EngineTraceCheck, NamesPlaceValueAndRemedy) {
  EXPECT_NO_THROW(check_trace(good().angle, good().pressure));
  Trace t = good();
  t.pressure.pop_back();
  expect_refusal<ShapeError>(t, {"271", "270"});
  t = good();
  t.pressure[17] = std::nan("");
  expect_refusal<DataError>(t, {"pressure_bar[17]", "-123", "finite"});
  t = good();
  t.angle[17] = INFINITY;
  expect_refusal<DataError>(t, {"crank_angle_cad[17]", "finite"});
  t = good();
  t.angle[18] = t.angle[17];
  expect_refusal<DataError>(t, {"crank_angle_cad[18] = -123", "repeated"});
  t = good();
  std::swap(t.angle[18], t.angle[19]);
  expect_refusal<DataError>(t, {"crank_angle_cad[19]", "increase", "sort"});
  t = good();
  t.angle.erase(t.angle.begin() + 50, t.angle.begin() + 55);
  t.pressure.erase(t.pressure.begin() + 50, t.pressure.begin() + 55);
  expect_refusal<DataError>(t, {"gap of 6", "-91", "-85"});
  // In the middle of the trace too, where the gap itself stands in the place of the usual step.
  t = good();
  const auto middle = static_cast<std::ptrdiff_t>(t.angle.size() / 2);
  t.angle.erase(t.angle.begin() + middle - 2, t.angle.begin() + middle + 3);
  t.pressure.erase(t.pressure.begin() + middle - 2, t.pressure.begin() + middle + 3);
  expect_refusal<DataError>(t, {"gap of 6", "usual step is 1"});
  for (const auto& [factor, unit] : {std::pair{1e5, "Pa"}, std::pair{100.0, "kPa"}}) {
    t = good();
    for (double& p : t.pressure) {
      p *= factor;
    }
    expect_refusal<DataError>(t, {"looks like", unit, "pressure_unit"});
  }
  t = {std::vector<double>(19), std::vector<double>(19)};
  expect_refusal<DataError>(t, {"19 samples", "20"});
  expect_refusal<DataError>(Trace{}, {"0 samples"});
}

TEST(EngineTraceCheck, AnalysisRefusesBadOptions) {
  const Trace t = good();
  TraceOptions bad[6];
  bad[0].gamma = 1.0;
  bad[1].pegging_exponent = std::nan("");
  bad[2].heat_from_cad = 95.0;
  bad[3].gamma_compression = -1.3;
  bad[4].gamma_combustion = 2.0;
  bad[5].heat_from_cad = std::nan("");
  for (const TraceOptions& o : bad) {
    EXPECT_THROW(analyze_trace(t.angle, t.pressure, {}, {}, o), ParameterError);
  }
  EXPECT_THROW(parse_name<Pegging>("pegging", "auto"), ParameterError);
  EXPECT_THROW(parse_name<AnalysisGamma>("gamma", "1.33"), ParameterError);
}

}  // namespace
}  // namespace mgdd::engine
