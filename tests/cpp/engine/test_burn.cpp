// Burn laws, and the burn that a trace shows.
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/charge.hpp"
#include "mgdd/engine/pressure/burn_window.hpp"
#include "mgdd/engine/pressure/trace_analysis.hpp"
#include "support/engine_case.hpp"
#include "support/test.hpp"

namespace mgdd::engine {
namespace {

std::vector<Cylinder> laws() {
  std::vector<Cylinder> all(5);
  all[1].burn.burn_shape = BurnShape::wiebe;
  all[2].burn.burn_shape = BurnShape::double_wiebe;
  all[3].burn.burn_shape = BurnShape::double_wiebe;
  all[3].burn.second_delay_cad = -4.0;  // the second law may start first
  all[4].burn.burn_shape = BurnShape::wiebe;
  all[4].burn.wiebe_a = 2.0;
  all[4].burn.wiebe_m = -0.3;
  return all;
}

TEST(EngineBurn, FractionRisesFromZeroToOne) {
  for (const Cylinder& c : laws()) {
    const Burn<double> burn(c.burn, -6.3, 31.7);
    EXPECT_EQ(burn.fraction(burn.start_cad()), 0.0);
    EXPECT_DOUBLE_EQ(burn.fraction(burn.end_cad()), 1.0);
    EXPECT_DOUBLE_EQ(burn.fraction(burn.end_cad() + 100.0), 1.0);
    double last = 0.0;
    for (double a = burn.start_cad(); a <= burn.end_cad(); a += 0.1) {
      EXPECT_GE(burn.fraction(a), last);
      last = burn.fraction(a);
    }
  }
}

TEST(EngineBurn, AngleInvertsTheFraction) {
  for (const Cylinder& c : laws()) {
    const Burn<double> burn(c.burn, -6.3, 31.7);
    for (const double x : {0.01, 0.1, 0.5, 0.9, 0.99}) {
      EXPECT_NEAR(burn.fraction(burn.angle_of(x)), x, 1e-12);
    }
  }
}

TEST(EngineBurn, SlopeIsThatOfTheFraction) {
  Cylinder c;
  c.burn.wiebe_a = 5.3;
  c.burn.wiebe_m = 2.2;
  c.burn.second_fraction = 0.35;
  c.burn.second_delay_cad = 4.5;
  c.burn.second_duration_cad = 43.0;
  c.burn.second_wiebe_m = 1.1;
  for (const BurnShape shape : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
    c.burn.burn_shape = shape;
    const Burn<double> burn(c.burn, -6.3, 31.7);
    for (const double a : {-4.0, 1.0, 6.5, 14.0, 21.0}) {
      const double difference = (burn.fraction(a + 1e-4) - burn.fraction(a - 1e-4)) / 2e-4;
      EXPECT_NEAR(burn.slope_at(a), difference, 1e-8) << static_cast<int>(shape) << " at " << a;
    }
  }
}

TEST(EngineBurn, WiebeByHand) {
  Cylinder c;
  c.burn.burn_shape = BurnShape::wiebe;
  const Burn<double> burn(c.burn, 0.0, 1.0);
  const double whole = 1.0 - std::exp(-6.908);
  EXPECT_NEAR(burn.fraction(0.3), (1.0 - std::exp(-6.908 * std::pow(0.3, 2.5))) / whole, 1e-15);
  EXPECT_NEAR(burn.angle_of(0.5), std::pow(std::log(2.0) / 6.908, 0.4), 3e-4);  // before renormalisation
  EXPECT_NEAR(burn.angle_of(0.5), 0.398, 5e-4);
  // The Wiebe law nearest to the triangle meets it at a quarter and at a half.
  for (const double s : {0.25, 0.5}) {
    EXPECT_NEAR(1.0 - std::exp(-3.60 * std::pow(s, 2.38)), triangle_fraction(s), 2e-3);
  }
}

TEST(EngineBurn, DoubleWiebeIsTheWeightedSum) {
  Cylinder c;
  c.burn.burn_shape = BurnShape::double_wiebe;
  const Burn<double> both(c.burn, -6.0, 20.0);
  for (const double a : {-5.0, -1.0, 5.0, 20.0, 45.0}) {
    const double first = wiebe_fraction((a + 6.0) / 20.0, c.burn.wiebe_a, c.burn.wiebe_m);
    const double second = wiebe_fraction((a + 3.0) / 50.0, c.burn.wiebe_a, c.burn.second_wiebe_m);
    EXPECT_NEAR(both.fraction(a), 0.4 * first + 0.6 * second, 1e-15);
  }
  c.burn.second_fraction = 0.0;
  const Burn<double> one(c.burn, -6.0, 20.0);
  c.burn.burn_shape = BurnShape::wiebe;
  const Burn<double> plain(c.burn, -6.0, 20.0);
  EXPECT_DOUBLE_EQ(one.fraction(3.3), plain.fraction(3.3));
}

using test_support::EngineCase;

struct Trace {
  std::vector<double> angle, pressure, volume;
};
Trace trace(const EngineCase& c, double noise_bar = 0.0, double angle_error = 0.0, unsigned seed = 1) {
  const auto cycle = run(c);
  Trace t{cycle.angles(), cycle.pressures_bar(), {}};
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (double& p : t.pressure)
    p += noise_bar * noise(random);
  for (double& a : t.angle)
    a += angle_error;
  for (const double a : t.angle)
    t.volume.push_back(1e3 * Geometry<double>(c.cylinder.geometry).volume_m3(a));
  return t;
}

// A triangle burns from SOC over the burn duration. Its last 1 % of the rate is its last 0.25 CAD.
TEST(EngineBurnWindow, FindsStartAndEndOfATriangle) {
  for (const double soc : {-38.0, -20.0, -6.0, 5.0}) {
    EngineCase c("burn_duration_cad=50 step_cad=0.5 wall_heat_scale=0.7");
    c.soc_cad = soc;
    for (const double noise : {0.0, 0.05}) {
      const Trace t = trace(c, noise);
      const BurnWindow b = find_burn(t.angle, t.pressure, t.volume, {});
      ASSERT_TRUE(b.found);
      EXPECT_NEAR(b.start_cad, soc, 3.0) << soc;
      EXPECT_GT(b.start_cad, soc - 1.5) << soc;  // never long before it
      EXPECT_NEAR(b.end_cad, soc + 50.0, 8.0) << soc;
    }
  }
}

TEST(EngineBurnWindow, NothingIsFoundBeforeTheStatedInjection) {
  const EngineCase c("soc_cad=-20 step_cad=0.5");
  const Trace t = trace(c);
  EXPECT_LT(find_burn(t.angle, t.pressure, t.volume, {}).start_cad, -17.0);
  const BurnWindow late = find_burn(t.angle, t.pressure, t.volume, -12.0);
  EXPECT_GE(late.start_cad, -12.0);
  EXPECT_EQ(late.unbounded_start_cad, find_burn(t.angle, t.pressure, t.volume, {}).start_cad);
  // An injection 22 CAD before TDC written as +22 would cut the burn: it is doubted.
  TraceOptions o;
  o.earliest_burn_cad = 22.0;
  const auto told = [&] {
    const auto a = analyze_trace(t.angle, t.pressure, c.cylinder, c.point, o);
    return std::count_if(a.warnings.begin(), a.warnings.end(),
                         [](const TraceWarning& w) { return w.kind == "early_burn"; });
  };
  EXPECT_EQ(told(), 1);
  o.earliest_burn_cad = -22.0;
  EXPECT_EQ(told(), 0);
}

TEST(EngineBurnWindow, AMotoredTraceHasNone) {
  for (const char* settings : {"fuel_mg=0", "fuel_mg=0 wall_heat_scale=1.5 speed_rpm=800"}) {
    const Trace t = trace(EngineCase(settings), 0.05);
    EXPECT_FALSE(find_burn(t.angle, t.pressure, t.volume, {}).found) << settings;
  }
}

// Without heat p V^n is the same on both strokes: no step, and the offset is the one that was put in.
TEST(EngineStrokes, AnAdiabaticMotoredTraceGivesTheOffsetThatWasPutIn) {
  for (const double error : {-3.0, -0.4, 0.0, 2.0}) {
    const EngineCase c("fuel_mg=0 wall_heat_scale=0 gamma=1.35");
    const Trace t = trace(c, 0.0, error);
    const Symmetry s = compare_strokes(t.angle, t.pressure, Geometry<double>(c.cylinder.geometry));
    EXPECT_NEAR(s.tdc_offset_cad, error, 0.03 + 0.01 * std::abs(error));
    EXPECT_NEAR(s.burn_step, 0.0, 0.005);
  }
}

// Heat dQ at volume V raises ln(p V^gamma) by (gamma - 1) dQ/(p V): the step of a short burn without wall heat.
TEST(EngineStrokes, TheStepIsTheEntropyOfTheBurn) {
  EngineCase c("wall_heat_scale=0 burn_duration_cad=4 fuel_mg=2 step_cad=0.1");
  c.soc_cad = -2.0;
  const Trace t = trace(c);
  const auto motored = run(EngineCase("wall_heat_scale=0 fuel_mg=0 step_cad=0.1"));
  const double pv_j = motored.pressure_bar(0.0) * 1e5 * Geometry<double>(c.cylinder.geometry).clearance_m3;
  const double heat_j = 2.0 * 42.8;
  const Symmetry s = compare_strokes(t.angle, t.pressure, Geometry<double>(c.cylinder.geometry));
  EXPECT_NEAR(s.burn_step, std::log(1.0 + 0.37 * heat_j / pv_j), 0.003);  // at constant volume
}

TEST(EngineStrokes, ATraceTooShortOnOneSideIsNotJudged) {
  const EngineCase c("fuel_mg=0 evo_cad=78");
  const Trace t = trace(c);
  EXPECT_TRUE(std::isnan(compare_strokes(t.angle, t.pressure, Geometry<double>(c.cylinder.geometry)).burn_step));
  EXPECT_FALSE(analyze_trace(t.angle, t.pressure, c.cylinder, c.point, {}).motored);
}

// Light load with top dead centre wrong by 3 CAD is still fired; a motored trace is still motored.
TEST(EngineStrokes, TopDeadCentreDoesNotMakeAFiredTraceMotored) {
  for (const double error : {-3.0, 0.0, 3.0}) {
    for (const char* settings :
         {"fuel_mg=2.2 step_cad=0.5", "fuel_mg=2.3 step_cad=0.5 intake_pressure_kpa=280 soc_cad=-8"}) {
      const EngineCase c(settings);
      const double imep = run(c).indicators.imep_closed_bar;
      ASSERT_GT(imep, 0.4) << settings;
      ASSERT_LT(imep, 1.1) << settings;
      const Trace t = trace(c, 0.05, error);
      EXPECT_FALSE(analyze_trace(t.angle, t.pressure, c.cylinder, c.point, {}).motored) << settings << error;
    }
    const EngineCase c("fuel_mg=0 step_cad=0.5 wall_heat_scale=0.4");
    const Trace t = trace(c, 0.05, error);
    const auto a = analyze_trace(t.angle, t.pressure, c.cylinder, c.point, {});
    EXPECT_TRUE(a.motored) << error;
    EXPECT_NEAR(a.tdc_offset_cad, error, 0.7);
    EXPECT_TRUE(std::isnan(a.ca50_cad));
  }
}

}  // namespace
}  // namespace mgdd::engine
