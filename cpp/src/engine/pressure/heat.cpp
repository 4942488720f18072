#include "mgdd/engine/pressure/heat.hpp"

#include <algorithm>

#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

CumulativeHeat accumulate_heat(const TraceAnalysis& a, double from_cad, double to_cad) {
  const std::size_t n = a.angle_cad.size();
  CumulativeHeat h;
  h.net_j.assign(n, 0.0);
  h.gross_j.assign(n, 0.0);
  double net = 0.0, gross = 0.0;
  for (std::size_t k = 1; k < n; ++k) {
    if (a.angle_cad[k - 1] >= from_cad - 1e-9 && a.angle_cad[k] <= to_cad + 1e-9) {
      if (h.empty) h.first = k - 1, h.empty = false;
      net += a.net_step_j[k];
      gross += a.net_step_j[k] + a.loss_step_j[k];
      if (net > h.net_best_j) h.net_best_j = net, h.net_peak = k;
      if (gross > h.gross_best_j) h.gross_best_j = gross, h.gross_peak = k;
    }
    h.net_j[k] = net;
    h.gross_j[k] = gross;
  }
  return h;
}

double level_angle_cad(std::span<const double> angle_cad, std::span<const double> heat, std::size_t first,
                       std::size_t peak, double level) noexcept {
  for (std::size_t k = first; k < peak; ++k) {
    if (heat[k + 1] >= level && heat[k + 1] > heat[k]) {
      return angle_cad[k] +
             (angle_cad[k + 1] - angle_cad[k]) * std::max(0.0, level - heat[k]) / (heat[k + 1] - heat[k]);
    }
  }
  return undefined<double>();
}

double burn_angle_cad(const TraceAnalysis& a, const CumulativeHeat& h, bool gross, double share) {
  return gross ? level_angle_cad(a.angle_cad, h.gross_j, h.first, h.gross_peak, share * h.gross_best_j)
               : level_angle_cad(a.angle_cad, h.net_j, h.first, h.net_peak, share * h.net_best_j);
}

}  // namespace mgdd::engine
