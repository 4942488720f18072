// Fit of the first-principle throttle groups to logs: staged, from one or many starts. Units deg, s, duty. Not
// real-time safe: allocates and throws.
#pragma once

#include <cstddef>
#include <vector>

#include "mgdd/identify/staged.hpp"
#include "mgdd/optimize/least_squares/multi_start.hpp"
#include "mgdd/throttle/models/first_principle.hpp"

namespace mgdd::identify {

/// Bounds of the nine groups; all are searched as logarithms but the limp-home angle and the electrical time.
std::vector<optimize::Parameter> first_principle_parameters();

/// Staged fit from every start; values of the best start and all reports (last stage).
struct FirstPrincipleFit {
  Values<double, 9> values{};
  optimize::MultiStartFit starts;
};
FirstPrincipleFit fit_first_principle(const throttle::FirstPrinciple& model,
                                      const std::vector<SimulationRecord>& records, const std::vector<FitStage>& stages,
                                      const std::vector<Values<double, 9>>& starts, std::size_t n_threads);

}  // namespace mgdd::identify
