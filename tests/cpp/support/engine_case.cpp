#include "support/engine_case.hpp"

#include <fstream>
#include <sstream>
#include <stdexcept>

#include "mgdd/common/units.hpp"
#include "support/test.hpp"

namespace mgdd::test_support {
namespace {

std::vector<std::string> split(const std::string& text, char mark) {
  std::vector<std::string> parts;
  std::stringstream stream(text);
  for (std::string part; std::getline(stream, part, mark);) {
    parts.push_back(part);
  }
  return parts;
}

std::vector<std::vector<std::string>> read_csv(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty() && line.front() != '#') rows.push_back(split(line, ','));
  }
  return rows;
}

void set(EngineCase& c, const std::string& name, const std::string& value) {
  if (name == "burn_shape") {
    c.cylinder.burn.burn_shape = parse_name<engine::BurnShape>("burn_shape", value);
  } else if (name == "gamma_model") {
    c.cylinder.gas.gamma_model = parse_name<engine::GammaModel>("gamma_model", value);
  } else if (name == "wall_heat_model") {
    c.cylinder.wall_heat.wall_heat_model = parse_name<engine::WallHeatModel>("wall_heat_model", value);
  } else if (name == "ignition_model") {
    c.cylinder.ignition.ignition_model = parse_name<engine::IgnitionModel>("ignition_model", value);
  } else if (name == "integrator") {
    c.integrator = parse_name<engine::Integrator>("integrator", value);
  } else if (name == "soc_cad") {
    c.soc_cad = std::stod(value);
  } else if (name == "soi_cad") {
    c.soi_cad = std::stod(value);
  } else if (name == "step_cad") {
    c.step_cad = std::stod(value);
  } else if (name == "burn_duration_cad") {
    c.point.burn_duration_cad = std::stod(value);
  } else if (name == "trapped_mass_g") {
    c.point.trapped_mass_g = std::stod(value);
  } else if (name == "ivc_temperature_k") {
    c.point.ivc_temperature_k = std::stod(value);
  } else {
    for (const auto& field : engine::operating_point_fields<double>()) {
      if (field.info.name == name) {
        field.in(c.point) = std::stod(value);
        return;
      }
    }
    for (const auto& field : engine::cylinder_fields<double>()) {
      if (field.info.name == name) {
        field.in(c.cylinder) = std::stod(value);
        return;
      }
    }
    c.words[name] = value;
  }
}

}  // namespace

EngineCase::EngineCase(std::string_view settings) {
  for (const std::string& word : split(std::string(settings), ' ')) {
    const auto equals = word.find('=');
    set(*this, word.substr(0, equals), word.substr(equals + 1));
  }
}

Cycle run(const EngineCase& c) {
  engine::CycleModel<double> model(c.cylinder, engine::crank_grid(c.cylinder, c.step_cad), c.integrator);
  engine::CycleWorkspace<double> work = model.make_workspace();
  const engine::Charge<double> charge = model.charge(c.point);
  model.run(charge, c.soc_cad, work);
  const engine::Indicators<double> indicators = model.indicators(charge, c.soc_cad, work);
  return {std::move(model), std::move(work), charge, indicators};
}

std::size_t Cycle::index(double angle_cad) const {
  const auto angle = model.angles_cad();
  const auto found = std::find(angle.begin(), angle.end(), angle_cad);
  if (found == angle.end()) throw std::out_of_range("no such angle on the grid");
  return static_cast<std::size_t>(found - angle.begin());
}

double Cycle::pressure_bar(double angle_cad) const {
  return work.pressure_pa[index(angle_cad)] / units::pa_per_bar;
}

double Cycle::temperature_k(double angle_cad) const {
  const std::size_t k = index(angle_cad);
  return work.pressure_pa[k] * model.volume_m3()[k] / charge.gas_j_per_k;
}

std::vector<double> Cycle::angles() const {
  return {model.angles_cad().begin(), model.angles_cad().end()};
}

std::vector<double> Cycle::pressures_bar() const {
  std::vector<double> bar;
  bar.reserve(work.pressure_pa.size());
  for (const double pa : work.pressure_pa) {
    bar.push_back(pa / units::pa_per_bar);
  }
  return bar;
}

double indicator(const engine::Indicators<double>& of, std::string_view name) {
  for (const auto& field : engine::indicator_fields<double>()) {
    if (field.name == name) return of.*(field.member);
  }
  throw std::out_of_range("no indicator " + std::string(name));
}

double best_soc_cad(EngineCase c, std::string_view name) {
  const auto value = [&](double soc) {
    c.soc_cad = soc;
    return indicator(run(c).indicators, name);
  };
  const double ratio = 0.5 * (std::sqrt(5.0) - 1.0);
  double low = -30.0;
  double high = 10.0;
  while (high - low > 1e-4) {
    const double left = high - ratio * (high - low);
    const double right = low + ratio * (high - low);
    (value(left) > value(right) ? high : low) = value(left) > value(right) ? right : left;
  }
  return 0.5 * (low + high);
}

std::vector<identify::MeasuredCycle> hd_traces(bool with_mass) {
  const std::string folder = MGDD_PACKAGE_DATA_DIR "/hd_diesel_128x144_";
  const auto conditions = read_csv(folder + "conditions.csv");
  const auto table = read_csv(folder + "traces.csv");
  std::vector<identify::MeasuredCycle> traces;
  for (std::size_t load = 1; load < conditions.size(); ++load) {
    identify::MeasuredCycle trace;
    trace.label = conditions[load][1];  // the load in %
    trace.point.speed_rpm = std::stod(conditions[load][2]);
    if (with_mass) trace.point.trapped_mass_g = std::stod(conditions[load][3]);
    for (std::size_t row = 1; row < table.size(); ++row) {
      trace.angle_cad.push_back(std::stod(table[row][0]));
      trace.pressure_bar.push_back(std::stod(table[row][load]));
    }
    traces.push_back(trace);
  }
  return traces;
}

engine::Cylinder hd_cylinder() {
  return EngineCase(
             "bore_mm=128 stroke_mm=144 connecting_rod_mm=241.5 compression_ratio=20.3 ivc_cad=-143 evo_cad=125 "
             "volumetric_efficiency=0.865 burn_shape=wiebe gamma_model=linear")
      .cylinder;
}

}  // namespace mgdd::test_support
