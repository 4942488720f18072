// Heat of the steps of an analysed trace as rates.
#include <cstddef>
#include <vector>

#include "mgdd/engine/pressure/trace_analysis.hpp"

namespace mgdd::engine {
namespace {

std::vector<double> per_cad(const std::vector<double>& angle_cad, const std::vector<double>& step_j) {
  std::vector<double> rate(step_j.size(), 0.0);
  for (std::size_t k = 1; k < rate.size(); ++k)
    rate[k] = step_j[k] / (angle_cad[k] - angle_cad[k - 1]);
  return rate;
}

}  // namespace

std::vector<double> TraceAnalysis::heat_release_net_j_per_cad() const {
  return per_cad(angle_cad, net_step_j);
}

std::vector<double> TraceAnalysis::heat_loss_j_per_cad() const {
  return per_cad(angle_cad, loss_step_j);
}

std::vector<double> TraceAnalysis::heat_release_gross_j_per_cad() const {
  std::vector<double> gross(net_step_j.size());
  for (std::size_t k = 0; k < gross.size(); ++k)
    gross[k] = net_step_j[k] + loss_step_j[k];
  return per_cad(angle_cad, gross);
}

}  // namespace mgdd::engine
