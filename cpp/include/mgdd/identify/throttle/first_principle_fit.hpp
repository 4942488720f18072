// Fit of the first-principle throttle groups to logs: staged, from one or many starts. Units deg, s, duty. Not
// real-time safe: allocates and throws.
#pragma once

#include <cstddef>
#include <vector>

#include "mgdd/identify/staged.hpp"
#include "mgdd/optimize/least_squares/multi_start.hpp"
#include "mgdd/throttle/models/first_principle.hpp"

namespace mgdd::identify {

using FirstPrincipleGroups = throttle::FirstPrinciple::Groups<double>;

/// Bounds of the groups in a search: their domains, and for the presliding what still bends.
std::vector<optimize::Parameter> first_principle_parameters();

/// Staged fit from every start; values of the best start and all reports (last stage).
struct FirstPrincipleFit {
  FirstPrincipleGroups values{};
  optimize::MultiStartFit starts;
};
FirstPrincipleFit fit_first_principle(const throttle::FirstPrinciple& model,
                                      const std::vector<SimulationRecord>& records, const std::vector<FitStage>& stages,
                                      const std::vector<FirstPrincipleGroups>& starts, std::size_t n_threads);

}  // namespace mgdd::identify
