// Calibration of a cylinder by its traces, and the residuals of it.
#include "mgdd/common/error.hpp"
#include "mgdd/identify/engine/cylinder_fit.hpp"
#include "mgdd/identify/engine/cylinder_residual.hpp"
#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"

namespace mgdd::identify {
namespace {

using test_support::EngineCase;

const std::vector<std::string> burn_names{"soc_cad", "burn_duration_cad", "fuel_heat_j"};

std::vector<std::string> with(std::vector<std::string> names, std::initializer_list<const char*> more) {
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

std::vector<LoadBurn> estimates(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& c) {
  std::vector<LoadBurn> burns;
  burns.reserve(traces.size());
  for (const MeasuredCycle& t : traces) {
    burns.push_back(estimate_burn(t, c));
  }
  return burns;
}

CylinderFit fit(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& c,
                const std::vector<std::string>& free) {
  return fit_cylinder(traces, c, estimates(traces, c), free, {});
}

// A plant that is the model: two loads of the default cylinder, on the model's own 0.25 CAD grid.
struct Plant {
  EngineCase truth{"step_cad=0.25 wall_heat_scale=0.8 burn_shape=wiebe burn_duration_cad=42"};
  std::vector<MeasuredCycle> traces;

  explicit Plant(double noise_bar = 0.0, std::uint64_t seed = 0) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise(0.0, noise_bar > 0.0 ? noise_bar : 1.0);
    for (const auto& [fuel, soc] : {std::pair{14.0, -5.0}, std::pair{24.0, -9.0}}) {
      truth.point.fuel_mg = fuel;
      truth.soc_cad = soc;
      MeasuredCycle t{"at " + std::to_string(static_cast<int>(fuel)), {}, {}, truth.point};
      const auto cycle = run(truth);
      t.point.trapped_mass_g = engine::mass_of_gas_g(cycle.charge.gas_j_per_k);
      t.angle_cad = cycle.angles();
      t.pressure_bar = cycle.pressures_bar();
      // p(IVC) fixes the charge and is not a residual: noise there is another experiment.
      for (std::size_t k = 1; k < t.pressure_bar.size() && noise_bar > 0.0; ++k)
        t.pressure_bar[k] += noise(random);
      traces.push_back(t);
    }
  }
  engine::Cylinder start() const {
    engine::Cylinder c = truth.cylinder;
    c.wall_heat.wall_heat_scale = 0.3;
    return c;
  }
};

TEST(IdentifyFit, WallHeatTradesWithFuelHeat) {
  const auto f = fit(test_support::hd_traces(), test_support::hd_cylinder(), with(burn_names, {"wall_heat_scale"}));
  EXPECT_TRUE(std::isnan(f.report.correlation(0, 3)));  // held at its bound
  for (Eigen::Index load = 0; load < 4; ++load) {
    const double correlation = f.correlation_if_free(0, 1 + 3 * load + 2);
    EXPECT_GT(correlation, 0.72);
    EXPECT_LT(correlation, 0.935);
  }
}

TEST(IdentifyFit, ABoundNarrowsTheSearchOfOneTraceOrOfAll) {
  const Plant plant;
  const auto start = estimates(plant.traces, plant.start());
  const auto free = with(burn_names, {"wall_heat_scale"});
  CylinderFitOptions options;
  options.bounds = {{"soc_cad[at 24]", -8.0, 20.0}};  // the truth is -9; the other load stays free
  const CylinderFit one = fit_cylinder(plant.traces, plant.start(), start, free, options);
  EXPECT_EQ(one.loads[1].burn.soc_cad, -8.0);
  EXPECT_LT(one.loads[0].burn.soc_cad, -4.0);
  options.bounds = {{"burn_duration_cad", 10.0, 41.0}, {"wall_heat_scale", 0.9, 1.5}};
  const CylinderFit all = fit_cylinder(plant.traces, plant.start(), start, free, options);
  for (const LoadFit& load : all.loads)
    EXPECT_LE(load.burn.burn_duration_cad, 41.0);
  EXPECT_GE(all.cylinder.wall_heat.wall_heat_scale, 0.9);
  options.bounds = {{"burn_duration_cad", 30.0, 60.0}};  // where nothing holds, nothing changes
  const CylinderFit wide = fit_cylinder(plant.traces, plant.start(), start, free, options);
  EXPECT_NEAR(wide.cylinder.wall_heat.wall_heat_scale, 0.8, 1e-6);
  for (const SearchBound& bad : {SearchBound{"wiebe_m", 0.0, 1.0}, SearchBound{"soc_cad[at 99]", 0.0, 1.0},
                                 SearchBound{"soc_cad", 5.0, 5.0}, SearchBound{"burn_duration_cad", 200.0, 300.0}}) {
    options.bounds = {bad};
    EXPECT_THROW(fit_cylinder(plant.traces, plant.start(), start, free, options), ParameterError) << bad.name;
  }
}

TEST(IdentifyFit, ParameterListsAreDisjoint) {
  for (const std::string& name : common_parameters()) {
    const auto loads = load_parameters();
    EXPECT_EQ(std::find(loads.begin(), loads.end(), name), loads.end()) << name;
  }
  LoadBurn burn;
  burn.second_wiebe_m = 1.9;
  EXPECT_EQ(with_burn(engine::Cylinder{}, burn).burn.second_wiebe_m, 1.9);
}

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using engine::BurnShape;

static_assert(noexcept(std::declval<CylinderResidual&>()(std::declval<const VectorXd&>(), std::declval<VectorXd&>(),
                                                         static_cast<MatrixXd*>(nullptr))));

// Places of `wall_heat_scale` and `gamma` among the cylinder's fields.
std::vector<std::size_t> common() {
  std::vector<std::size_t> places;
  const auto fields = engine::cylinder_fields<double>();
  for (std::size_t k = 0; k < fields.size(); ++k) {
    if (fields[k].info.name == "wall_heat_scale" || fields[k].info.name == "gamma_linear_300k") places.push_back(k);
  }
  return places;
}

// Starts and durations between sample angles, so that no kink lies within a difference quotient.
std::vector<LoadBurn> starts() {
  std::vector<LoadBurn> burns(2);
  for (std::size_t i = 0; i < burns.size(); ++i) {
    burns[i].soc_cad = -4.13 - static_cast<double>(i);
    burns[i].burn_duration_cad = 41.3;
    burns[i].fuel_heat_j = 3000.0 + 2000.0 * static_cast<double>(i);
    burns[i].second_duration_cad = 50.07;
  }
  return burns;
}

struct Problem {
  std::vector<MeasuredCycle> traces;
  CylinderResidual residual;
  VectorXd x;

  explicit Problem(BurnShape shape)
      : traces(two()),
        residual(traces, cylinder(shape), starts(), common(), {0, 1, 2, 3, 4, 5, 6, 7, 8}, 0.5,
                 engine::Integrator::trapezoid) {
    x.resize(residual.n_parameters());
    x[0] = 1.38;  // fields come in the order of the record: gamma before the wall heat
    x[1] = 0.6;
    for (Index t = 0; t < 2; ++t) {
      const LoadBurn b = starts()[static_cast<std::size_t>(t)];
      x.segment(2 + 9 * t, 9) << b.soc_cad, b.burn_duration_cad, b.fuel_heat_j, b.wiebe_m, b.second_fraction,
          b.second_delay_cad, b.second_duration_cad, b.second_wiebe_m,
          1.07 * traces[static_cast<std::size_t>(t)].pressure_bar.front();
    }
  }
  static std::vector<MeasuredCycle> two() {
    auto all = test_support::hd_traces();
    return {all[1], all[3]};
  }
  static engine::Cylinder cylinder(BurnShape shape) {
    engine::Cylinder c = test_support::hd_cylinder();
    c.burn.burn_shape = shape;
    return c;
  }
};

TEST(IdentifyResidual, JacobianAgreesWithDifferences) {
  for (const BurnShape shape : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
    Problem p(shape);
    const Index n = p.residual.n_residuals(), m = p.residual.n_parameters();
    ASSERT_EQ(n, 2 * 267);
    ASSERT_EQ(m, 2 + 2 * 9);
    VectorXd r(n), moved(n);
    MatrixXd jacobian(n, m);
    ASSERT_TRUE(p.residual(p.x, r, &jacobian));
    for (Index j = 0; j < m; ++j) {
      const double h = 3e-6 * std::abs(p.x[j]);  // short: the clamp of Woschni's burning term is a kink
      const auto quotient = [&](double step) {
        VectorXd low(n), y = p.x;
        y[j] = p.x[j] + step;
        EXPECT_TRUE(p.residual(y, moved, nullptr));
        y[j] = p.x[j] - step;
        EXPECT_TRUE(p.residual(y, low, nullptr));
        return VectorXd((moved - low) / (2.0 * step));
      };
      const VectorXd slope = (4.0 * quotient(0.5 * h) - quotient(h)) / 3.0;
      const double scale = std::max(jacobian.col(j).cwiseAbs().maxCoeff(), 1e-3 / std::abs(p.x[j]));
      EXPECT_LT((slope - jacobian.col(j)).cwiseAbs().maxCoeff(), 1e-6 * scale) << j;
    }
    EXPECT_EQ(jacobian.block(267, 2, 267, 9).cwiseAbs().maxCoeff(), 0.0);  // a load does not touch the other trace
  }
}

TEST(IdentifyResidual, IsModelMinusMeasuredOverPeak) {
  Problem p(BurnShape::wiebe);
  VectorXd r(p.residual.n_residuals());
  ASSERT_TRUE(p.residual(p.x, r, nullptr));
  for (std::size_t t = 0; t < 2; ++t) {
    const auto model = p.residual.simulate(t, p.x).pressure_bar;
    EXPECT_NEAR(p.residual.p_max_bar(t), t == 0 ? 183.5 : 233.2, 0.05);
    for (std::size_t k = 0; k < model.size(); ++k) {
      const double expected = (model[k] - p.traces[t].pressure_bar[k]) / p.residual.p_max_bar(t);
      EXPECT_NEAR(r[static_cast<Index>(t * 267 + k)], expected, 1e-14);
    }
    const double first = p.traces[t].pressure_bar.front();  // the start pressure is 7 % above it
    EXPECT_NEAR(r[static_cast<Index>(t * 267)], 0.07 * first / p.residual.p_max_bar(t), 1e-15);
    EXPECT_EQ(p.residual.start(t).start_pressure_bar, first);  // where none is given
  }
  EXPECT_EQ(p.residual.cylinder(p.x).wall_heat.wall_heat_scale, 0.6);
  EXPECT_EQ(p.residual.burn(1, p.x).fuel_heat_j, 5000.0);
}

TEST(IdentifyResidual, AllocatesNothing) {
  for (const BurnShape shape : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
    Problem p(shape);
    VectorXd r(p.residual.n_residuals());
    MatrixXd jacobian(p.residual.n_residuals(), p.residual.n_parameters());
    const test_support::AllocationCounter counter;
    p.residual(p.x, r, nullptr);
    p.residual(p.x, r, &jacobian);
    EXPECT_EQ(counter.count(), 0u);
  }
}

TEST(IdentifyResidual, SaysWhenTheModelLeavesTheNumbers) {
  Problem p(BurnShape::wiebe);
  VectorXd r(p.residual.n_residuals());
  for (const double scale : {1e5, std::nan("")}) {
    p.x[1] = scale;  // wall heat that takes more than there is
    EXPECT_FALSE(p.residual(p.x, r, nullptr)) << scale;
  }
}

}  // namespace
}  // namespace mgdd::identify
