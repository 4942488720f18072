#include "mgdd/identify/throttle/first_principle_fit.hpp"

#include <cstddef>
#include <string>
#include <utility>

#include "mgdd/common/record.hpp"

namespace mgdd::identify {

using throttle::FirstPrinciple;

std::vector<optimize::Parameter> first_principle_parameters() {
  std::vector<optimize::Parameter> out;
  for (const FieldInfo& field : FirstPrinciple::parameters)
    out.push_back(optimize::parameter_of(field, std::string(field.name)));
  // Without presliding friction is another law, and so for stops: a search does not cross over.
  for (const auto& [index, least] : {std::pair{13, 0.01}, {17, 2.0}}) {
    optimize::Parameter& parameter = out[static_cast<std::size_t>(index)];
    parameter.lower = least;
    parameter.log_scaled = true;
  }
  return out;
}

FirstPrincipleFit fit_first_principle(const FirstPrinciple& model, const std::vector<SimulationRecord>& records,
                                      const std::vector<FitStage>& stages,
                                      const std::vector<FirstPrincipleGroups>& starts, std::size_t n_threads) {
  model.validate();
  const std::vector<optimize::Parameter> parameters = first_principle_parameters();
  for (const FirstPrincipleGroups& start : starts) {
    for (std::size_t i = 0; i < start.size(); ++i)
      require_in(FirstPrinciple::parameters[i], start[i]);
  }
  std::vector<Eigen::VectorXd> indices;  // which start: each thread then owns its entry of `ends`
  std::vector<FirstPrincipleGroups> ends = starts;
  for (std::size_t i = 0; i < starts.size(); ++i)
    indices.push_back(Eigen::VectorXd::Constant(1, static_cast<double>(i)));
  FirstPrincipleFit fit;
  fit.starts = optimize::multi_start(
      indices,
      [&](const Eigen::VectorXd& index) {
        return fit_in_stages(model, parameters, records, stages, ends[static_cast<std::size_t>(index[0])]);
      },
      n_threads);
  fit.values = ends[fit.starts.best];
  return fit;
}

}  // namespace mgdd::identify
