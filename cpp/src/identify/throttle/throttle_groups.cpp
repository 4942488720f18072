#include "mgdd/identify/throttle/throttle_groups.hpp"

#include <string>

#include "mgdd/common/bounds.hpp"

namespace mgdd::identify {

static_assert(StepModel<ThrottleGroups>);

std::vector<optimize::Parameter> throttle_group_parameters() {
  const std::array<optimize::Parameter, 9> domain{{{"tau_s", 0.003, 1.0, true},
                                                   {"gain_deg_per_s2_per_duty", 3e3, 1e6, true},
                                                   {"beta_above_duty", 1e-3, 0.6, true},
                                                   {"kappa_above_duty_per_deg", 1e-5, 2e-2, true},
                                                   {"delta_duty", 1e-3, 0.5, true},
                                                   {"beta_below_duty", 1e-3, 0.6, true},
                                                   {"kappa_below_duty_per_deg", 1e-5, 5e-2, true},
                                                   {"limp_home_deg", -5.0, 60.0, false},
                                                   {"electrical_s", 0.0, 0.02, false}}};
  return {domain.begin(), domain.end()};
}

ThrottleGroupsFit fit_throttle_groups(const ThrottleGroups& model, const std::vector<SimulationRecord>& records,
                                      const std::vector<FitStage>& stages, const std::vector<Values<double, 9>>& starts,
                                      std::size_t n_threads) {
  require_positive("ramp_deg", model.ramp_deg, "deg");
  require_within("substeps", model.substeps, 1, 100);
  require_within("open_deg", model.open_deg, model.closed_deg + 1.0, 180.0, "deg");
  const std::vector<optimize::Parameter> parameters = throttle_group_parameters();
  for (const Values<double, 9>& start : starts) {
    for (std::size_t i = 0; i < start.size(); ++i)
      require_within(parameters[i].name, start[i], parameters[i].lower, parameters[i].upper);
  }
  std::vector<Eigen::VectorXd> indices;  // which start: each thread then owns its entry of `ends`
  std::vector<Values<double, 9>> ends = starts;
  for (std::size_t i = 0; i < starts.size(); ++i)
    indices.push_back(Eigen::VectorXd::Constant(1, static_cast<double>(i)));
  ThrottleGroupsFit fit;
  fit.starts = multi_start(
      indices,
      [&](const Eigen::VectorXd& index) {
        return fit_in_stages(model, parameters, records, stages, ends[static_cast<std::size_t>(index[0])]);
      },
      n_threads);
  fit.values = ends[fit.starts.best];
  return fit;
}

std::vector<double> simulate(const ThrottleGroups& model, const Values<double, 9>& values, double dt_s,
                             const Values<double, 3>& start, const std::vector<double>& duty) {
  std::vector<double> angle_deg(duty.size());
  Values<double, 3> x = start;
  for (std::size_t k = 0; k < duty.size(); ++k) {
    angle_deg[k] = x[0];
    x = model.step<double>(values, x, {duty[k]}, dt_s);
  }
  return angle_deg;
}

}  // namespace mgdd::identify
