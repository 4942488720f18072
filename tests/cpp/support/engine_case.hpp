// A cycle described by words ("fuel_mg=8 integrator=split"), and the measured traces.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/identify/engine/cylinder_fit.hpp"

namespace mgdd::test_support {

struct EngineCase {
  engine::Cylinder cylinder;
  engine::OperatingPoint point;
  engine::Integrator integrator = engine::Integrator::trapezoid;
  double soc_cad = -6.0;
  double soi_cad = std::numeric_limits<double>::quiet_NaN();
  double step_cad = engine::default_step_cad;
  std::map<std::string, std::string> words;  ///< settings that are not fields: objective, traces, free

  EngineCase() = default;
  explicit EngineCase(std::string_view settings);
};

/// A cycle that has run.
struct Cycle {
  engine::CycleModel<double> model;
  engine::CycleWorkspace<double> work;
  engine::Charge<double> charge;
  engine::Indicators<double> indicators;

  std::size_t index(double angle_cad) const;
  double pressure_bar(double angle_cad) const;
  double temperature_k(double angle_cad) const;
  std::vector<double> angles() const;
  std::vector<double> pressures_bar() const;
};
Cycle run(const EngineCase& c);

/// Largest value of an indicator over SOC in [-30, 10] by golden section: no derivative, another method than the
/// package's.
double best_soc_cad(EngineCase c, std::string_view indicator);

double indicator(const engine::Indicators<double>& of, std::string_view name);

/// The four measured heavy-duty traces that the package carries, and their engine with a Wiebe burn.
std::vector<identify::MeasuredCycle> hd_traces(bool with_mass = true);
engine::Cylinder hd_cylinder();

}  // namespace mgdd::test_support
