// Exact derivatives against Richardson-extrapolated central differences, and laws that need no differences.
#include "mgdd/engine/sensitivity.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "mgdd/common/units.hpp"
#include "support/engine_case.hpp"

namespace mgdd::engine {
namespace {

using test_support::Cycle;
using test_support::EngineCase;

// Away from kinks: SOC, the joint of the triangle and the end of each burn lie between grid angles.
EngineCase smooth() {
  return EngineCase("soc_cad=-6.37 burn_duration_cad=33.3 trapped_mass_g=0.78 second_duration_cad=50.3");
}

// All differences of one input: the central quotient at h and h/2, extrapolated to h^4.
struct Differences {
  std::vector<double> indicators, pressure_bar;
};

Differences differences(const EngineCase& c, std::string_view name) {
  const auto at = [&](double offset) {
    CycleInputs<double> inputs{c.cylinder, c.point, c.soc_cad};
    input(inputs, name) += offset;
    EngineCase moved = c;
    moved.cylinder = inputs.cylinder;
    moved.point = inputs.point;
    moved.soc_cad = inputs.soc_cad;
    const Cycle cycle = run(moved);
    std::vector<double> all = cycle.pressures_bar();
    for (const auto& field : indicator_fields<double>()) {
      all.push_back(cycle.indicators.*(field.member));
    }
    return all;
  };
  CycleInputs<double> inputs{c.cylinder, c.point, c.soc_cad};
  const double x = std::abs(input(inputs, name));
  const double h = 1e-4 * (x > 0.0 ? x : 1.0);
  const std::vector<double> a = at(h), b = at(-h), d = at(0.5 * h), e = at(-0.5 * h);
  std::vector<double> slope(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    slope[i] = (4.0 * (d[i] - e[i]) / h - (a[i] - b[i]) / (2.0 * h)) / 3.0;
  }
  const auto n = static_cast<std::ptrdiff_t>(a.size() - indicator_fields<double>().size());
  return {{slope.begin() + n, slope.end()}, {slope.begin(), slope.begin() + n}};
}

void compare(const EngineCase& c, const std::string& what) {
  const std::vector<std::string> names = differentiable_inputs();
  const Sensitivities s = sensitivities(c.cylinder, c.point, c.soc_cad, names, c.step_cad, c.integrator);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Differences d = differences(c, names[i]);
    CycleInputs<double> inputs{c.cylinder, c.point, c.soc_cad};
    const double x = std::abs(input(inputs, names[i]));
    const double per = 1.0 / (x > 0.0 ? x : 1.0);
    std::size_t k = 0;
    for (const auto& field : indicator_fields<double>()) {
      const double exact = s.indicators[i].*(field.member);
      const double scale = std::max({std::abs(exact), std::abs(s.value.*(field.member)) * per, 1e-3 * per});
      EXPECT_NEAR(exact, d.indicators[k++], 2e-6 * scale) << what << ": d " << field.name << " / d " << names[i];
    }
    const auto column = s.pressure_bar.col(static_cast<Eigen::Index>(i));
    const double scale = std::max(column.cwiseAbs().maxCoeff(), s.value.p_max_bar * per);
    for (std::size_t row = 0; row < d.pressure_bar.size(); ++row) {
      EXPECT_NEAR(column[static_cast<Eigen::Index>(row)], d.pressure_bar[row], 2e-6 * scale) << what << names[i];
    }
  }
}

TEST(EngineSensitivity, AgreesWithDifferencesForEveryIntegrator) {
  for (const auto integrator : {Integrator::split, Integrator::tan2018_lagged, Integrator::euler}) {
    EngineCase c = smooth();
    c.integrator = integrator;
    c.step_cad = 0.7;
    compare(c, std::string(name_of(integrator)));
  }
}

// Naming an optional of the point holds it constant for all inputs, also for those of another pass.
TEST(EngineSensitivity, NamesAreIndependentOfTheirCompany) {
  const EngineCase c;
  EngineCase fixed = c;
  fixed.point.burn_duration_cad = 30.0;
  fixed.point.trapped_mass_g = run(c).charge.gas_j_per_k / units::gas_constant_j_per_molk * 28.9647;
  const std::vector<std::string> names = differentiable_inputs();
  const Sensitivities all = sensitivities(c.cylinder, c.point, -6.3, names);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Sensitivities one = sensitivities(fixed.cylinder, fixed.point, -6.3, {names[i]});
    EXPECT_NEAR(one.indicators[0].imep_gross_bar, all.indicators[i].imep_gross_bar,
                1e-9 * (1.0 + std::abs(all.indicators[i].imep_gross_bar)))
        << names[i];
  }
}

}  // namespace
}  // namespace mgdd::engine
