// Online calibration of engines that are not quite those of the guide: compression ratio, charge and walls, fuel, burn
// and sensor are off within what is known of them, and the stated intervals hold all the same.
#include "mgdd/common/random.hpp"
#include "mgdd/engine/geometry.hpp"
#include "support/calibration_case.hpp"
#include "support/test.hpp"

namespace mgdd::guide {
namespace {

using test_support::wall;
using test_support::wrong_guide;

constexpr CalibrationMethod stepping[] = {CalibrationMethod::gauss_newton, CalibrationMethod::recursive};
constexpr int window_cycles = 10;
constexpr double wall_heat = 0.5, intake_k = 10.0;  // of the plant; error of the intake temperature

struct Plant {
  loop::BenchSettings bench;
  double told_error_cad = 0.0;
  CalibrationVector truth = CalibrationVector::Zero();
};

// Off by these shares of 0.1 of compression ratio, 10 K of intake and 70 K of wall.
Plant plant(std::uint64_t seed, double compression, double intake, double walls) {
  Plant p;
  p.bench = test_support::steady_bench(0.1, seed);
  p.bench.soc_scatter_cad = 0.3;
  for (const int scale : {Calibrated::burn_duration, Calibrated::fuel_heat, Calibrated::gain})
    p.truth[scale] = 1.0;
  p.truth[wall] = wall_heat;
  p.truth[Calibrated::compression_ratio] = 0.1 * compression;
  p.truth[Calibrated::wall_temperature] = 70.0 * walls;
  const engine::Geometry<double> geometry(p.bench.cylinder.geometry);
  const double charge_over_intake = geometry.volume_m3(p.bench.cylinder.geometry.ivc_cad) /
                                    (p.bench.cylinder.gas.volumetric_efficiency * geometry.swept_m3);
  p.truth[Calibrated::charge_temperature] = charge_over_intake * intake_k * intake;
  p.bench.cylinder.geometry.compression_ratio += 0.1 * compression;
  p.bench.cylinder.wall_heat.wall_temperature_k += 70.0 * walls;
  p.bench.schedule[0].point.intake_temperature_k += intake_k * intake;
  p.bench.schedule[0].point.burn_duration_cad = 30.0;
  return p;
}

// The rest of it off by draws from what is known beforehand.
Plant with_the_rest_off(Plant p) {
  const auto drawn = [&](int i) {
    const double sd = info_of(i).known_sd;
    return sd * random::normal(p.bench.seed, 81, static_cast<std::uint64_t>(i));
  };
  for (const int i : {Calibrated::burn_duration, Calibrated::fuel_heat, Calibrated::gain, Calibrated::gamma,
                      Calibrated::tdc, Calibrated::offset})
    p.truth[i] += drawn(i);
  engine::OperatingPoint& point = p.bench.schedule[0].point;
  point.burn_duration_cad = 30.0 * p.truth[Calibrated::burn_duration];
  point.fuel_mg *= p.truth[Calibrated::fuel_heat];
  p.bench.cylinder.gas.gamma += p.truth[Calibrated::gamma];
  p.bench.pressure.tdc_error_cad = p.truth[Calibrated::tdc];
  p.bench.pressure.gain_error = p.truth[Calibrated::gain] - 1.0;
  p.bench.pressure.offset_bar = p.truth[Calibrated::offset];
  p.told_error_cad = drawn(Calibrated::soc_offset);
  return p;
}

// Timing of a cycle as a seeker's dither moves it.
double dithered_cad(int cycle) {
  return -6.0 + std::sin(0.2 * std::numbers::pi * cycle);
}

// Runs the plant; the truth of the timing is that of the last window.
OnlineCalibration taught(Plant& p, CalibrationMethod method, int cycles) {
  loop::VirtualEngine bench(p.bench);
  OnlineCalibrationSettings s = wrong_guide(method, 0.8);
  s.soc_scatter_cad = 0.3;
  OnlineCalibration calibration(s);
  engine::OperatingPoint told;
  told.burn_duration_cad = 30.0;
  double mean = 0.0, square = 0.0, told_square = 0.0;
  for (int k = 0; k < cycles; ++k) {
    const double asked = dithered_cad(k);
    const loop::BenchCycle c = bench.step(asked);
    calibration.offer(bench.pressure().pressure_bar, told, asked + p.told_error_cad);
    calibration.update();
    if (k < cycles - window_cycles) continue;
    mean += (c.soc_cad + 6.0) / window_cycles;
    square += std::pow(c.soc_cad + 6.0, 2) / window_cycles;
    told_square += std::pow(asked + 6.0, 2) / window_cycles;  // a whole period: its mean is zero
  }
  for (int k = 0; k < 5; ++k)
    calibration.update();  // the same window again, until its steps are done
  p.truth[Calibrated::soc_offset] = mean - p.told_error_cad;
  p.truth[Calibrated::soc_variance] = (square - mean * mean - told_square) / (0.3 * 0.3);
  return calibration;
}

double z_of(const OnlineCalibration& calibration, const Plant& p, int parameter) {
  return (calibration.parameters()[parameter] - p.truth[parameter]) / calibration.standard_errors()[parameter];
}

bool sure_and_wrong(const OnlineCalibration& calibration) {
  return calibration.determined() && std::abs(calibration.parameters()[wall] / wall_heat - 1.0) > 0.05;
}

TEST(OnlineCalibrationPlants, IntervalsOfEveryParameterHoldOverRandomPlants) {
  constexpr int plants = 60;
  for (const CalibrationMethod method : stepping) {
    std::array<double, n_calibrated> holds{}, runs{};
    int wrong = 0;
    for (std::uint64_t seed = 0; seed < plants; ++seed) {
      const auto uniform = [&](std::uint64_t of) { return 2.0 * random::uniform(seed, 82, of) - 1.0; };
      Plant p = with_the_rest_off(plant(seed, uniform(0), uniform(1), uniform(2)));
      const OnlineCalibration calibration = taught(p, method, 60);
      wrong += sure_and_wrong(calibration) ? 1 : 0;
      for (int i = 0; i < n_calibrated; ++i) {
        // Where a cycle was left out, the last window is another one.
        const bool of_window = i == Calibrated::soc_offset || i == Calibrated::soc_variance;
        if (of_window && calibration.accepted() != 60) continue;
        ++runs[place(i)];
        holds[place(i)] += std::abs(z_of(calibration, p, i)) < 1.96 ? 1.0 : 0.0;
      }
    }
    EXPECT_LE(wrong, plants / 20) << name_of(method);
    for (int i = 0; i < n_calibrated; ++i) {
      EXPECT_GE(runs[place(i)], 40.0);
      EXPECT_GE(holds[place(i)] / runs[place(i)], 0.85) << name_of(method) << " " << info_of(i).field.name;
    }
  }
}

// No window shows the temperature of the charge; many together, each linearised elsewhere, must not claim to.
TEST(OnlineCalibrationPlants, ManyWindowsDoNotKnowWhatNoneOfThemShows) {
  Plant p = plant(4, 0.0, 0.0, 0.0);
  const OnlineCalibration calibration = taught(p, CalibrationMethod::recursive, 400);
  const double charge = info_of(Calibrated::charge_temperature).known_sd;
  EXPECT_GT(calibration.standard_errors()[Calibrated::charge_temperature], 0.9 * charge);
  EXPECT_LT(calibration.standard_errors()[Calibrated::compression_ratio],
            0.6 * info_of(Calibrated::compression_ratio).known_sd);  // of this they do learn
  EXPECT_LT(std::abs(calibration.parameters()[wall] / wall_heat - 1.0), 0.05);
  EXPECT_EQ(calibration.verdict(wall).knowledge, Knowledge::uncertain);
  EXPECT_NE(calibration.explain(wall).find("mostly because charge_temperature_offset_k is known to"), std::string::npos)
      << calibration.explain(wall);
}

// A parameter that is adapted goes into the cylinder, where the cylinder has it.
TEST(OnlineCalibrationPlants, AnAdaptedCompressionRatioGoesIntoTheCylinder) {
  Plant p = plant(2, 3.0, 0.0, 0.0);
  loop::VirtualEngine bench(p.bench);
  OnlineCalibrationSettings s = wrong_guide(CalibrationMethod::recursive);
  s.soc_scatter_cad = 0.3;
  s.wanted[Calibrated::compression_ratio] = s.wanted[Calibrated::wall_temperature] = true;
  s.uncertainty[Calibrated::gamma] = 0.001;
  OnlineCalibration calibration(s);
  for (int k = 0; k < 200; ++k) {
    bench.step(dithered_cad(k));
    calibration.offer(bench.pressure().pressure_bar, p.bench.schedule[0].point, dithered_cad(k));
    calibration.update();
  }
  EXPECT_NEAR(calibration.parameters()[Calibrated::compression_ratio], 0.3, 0.05);
  const engine::Cylinder found = calibration.cylinder();
  EXPECT_EQ(found.geometry.compression_ratio,
            s.cylinder.geometry.compression_ratio + calibration.parameters()[Calibrated::compression_ratio]);
  EXPECT_EQ(found.wall_heat.wall_temperature_k,
            s.cylinder.wall_heat.wall_temperature_k + calibration.parameters()[Calibrated::wall_temperature]);
}

// A cycle that the stated scatter explains is not a jump; three of them in a row would make the calibration begin anew.
TEST(OnlineCalibrationPlants, ScatterOfTheTimingIsNotTakenForAJump) {
  for (const CalibrationMethod method : stepping) {
    std::int64_t jumps = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      Plant p = plant(seed, 0.0, 0.0, 0.0);
      jumps += taught(p, method, 150).jumps();
    }
    EXPECT_LE(jumps, 1) << name_of(method);
  }
}

// Every column of the model against central differences of what it predicts.
TEST(CalibrationModel, ColumnsAreTheSlopesOfTheReading) {
  for (const bool states_temperature : {false, true}) {
    CalibrationModel model(engine::Cylinder{}, 1.0, engine::Integrator::trapezoid);
    CalibrationConditions at;
    at.soc_cad = -6.0;
    at.soc_sd_cad = 0.2;
    at.scatter_cad = 0.3;
    if (states_temperature) at.point.ivc_temperature_k = 360.0;
    CalibrationVector x = CalibrationVector::Zero();
    for (int i = 0; i < n_calibrated; ++i)
      x[i] = info_of(i).start + 0.2 * info_of(i).known_sd;
    const std::size_t n = model.angles_cad().size();
    std::vector<double> reading(n), high(n), low(n);
    CalibrationColumns columns(static_cast<Eigen::Index>(n), n_calibrated);
    ASSERT_TRUE(model.predict(x, at, reading));
    ASSERT_TRUE(model.differentiate(x, at, reading, columns));
    for (int i = 0; i < n_calibrated; ++i) {
      const double step = 0.05 * info_of(i).known_sd;
      CalibrationVector there = x;
      there[i] = x[i] + step;
      ASSERT_TRUE(model.predict(there, at, high));
      there[i] = x[i] - step;
      ASSERT_TRUE(model.predict(there, at, low));
      double error = 0.0, size = 0.0;
      for (std::size_t k = 5; k + 5 < n; ++k) {
        const double slope = (high[k] - low[k]) / (2.0 * step);
        error += std::pow(columns(static_cast<Eigen::Index>(k), i) - slope, 2);
        size += slope * slope;
      }
      // Columns stand at the mean timing, the reading is the mean of two.
      EXPECT_LT(std::sqrt(error / size), i == Calibrated::soc_variance ? 0.3 : 0.05) << info_of(i).field.name;
      EXPECT_GT(size, 0.0) << info_of(i).field.name;
    }
  }
}

}  // namespace
}  // namespace mgdd::guide
