// Options of the analysis: which values belong to their domains.
#include "mgdd/engine/pressure/trace_options.hpp"

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "mgdd/common/error.hpp"

namespace mgdd::engine {
namespace {

// The field that `validate` refuses, or "".
std::string refused(const std::function<void(TraceOptions&)>& change) {
  TraceOptions o;
  change(o);
  try {
    validate(o);
  } catch (const ParameterError& error) {
    return error.field.empty() ? error.what() : error.field;
  }
  return "";
}

TEST(EngineTraceOptions, OpenBoundsAreRefusedAndWhatLiesInsideIsNot) {
  struct Case {
    const char* name;
    std::function<void(TraceOptions&, double)> set;
    std::vector<double> allowed, beyond;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Case cases[] = {
      {"pegging_exponent", [](auto& o, double v) { o.pegging_exponent = v; }, {1.01, 1.69}, {1.0, 1.7, nan}},
      {"gamma", [](auto& o, double v) { o.gamma = v; }, {1.01, 1.69}, {1.0, 1.7, nan}},
      {"gamma_compression", [](auto& o, double v) { o.gamma_compression = v; }, {1.01, 1.69}, {1.0, 1.7}},
      {"gamma_combustion", [](auto& o, double v) { o.gamma_combustion = v; }, {1.01, 1.69}, {1.0, 1.7}},
      {"heat_from_cad",
       [](auto& o, double v) { o.heat_from_cad = v, o.heat_to_cad = 20.0; },
       {19.9, -140.0},
       {20.0, 21.0, nan}},
      {"earliest_burn_cad", [](auto& o, double v) { o.earliest_burn_cad = v; }, {-180.0, 90.0}, {-180.1, 90.1, nan}},
      {"smoothing_width_cad", [](auto& o, double v) { o.smoothing_width_cad = v; }, {0.01, 30.0}, {0.0, 30.1, nan}},
      {"smoothing_cutoff_hz", [](auto& o, double v) { o.smoothing_cutoff_hz = v; }, {0.1, 1e6}, {0.0, 1.1e6, nan}},
      {"intake_pressure_kpa", [](auto& o, double v) { o.intake_pressure_kpa = v; }, {0.1, 2000.0}, {0.0, 2001.0, nan}},
      {"bmep_bar", [](auto& o, double v) { o.bmep_bar = v; }, {0.0, 100.0}, {-0.1, 100.1, nan}},
      {"inlet_pressure_kpa",
       [](auto& o, double v) { o.pegging = Pegging::inlet, o.inlet_pressure_kpa = v; },
       {0.1, 300.0},
       {0.0, -1.0, nan}},
  };
  for (const Case& c : cases) {
    for (const double v : c.allowed)
      EXPECT_EQ(refused([&](TraceOptions& o) { c.set(o, v); }), "") << c.name << " " << v;
    for (const double v : c.beyond)
      EXPECT_EQ(refused([&](TraceOptions& o) { c.set(o, v); }), c.name) << v;
  }
}

TEST(EngineTraceOptions, AWindowHasTwoEnds) {
  for (const bool from : {true, false}) {
    const std::string told = refused([&](TraceOptions& o) { (from ? o.heat_from_cad : o.heat_to_cad) = 10.0; });
    EXPECT_NE(told.find("given together"), std::string::npos);
  }
}

}  // namespace
}  // namespace mgdd::engine
