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
      net += a.heat_net_j[k];
      gross += a.heat_net_j[k] + a.heat_loss_j[k];
      if (net > h.net_best_j) h.net_best_j = net, h.net_peak = k;
      if (gross > h.gross_best_j) h.gross_best_j = gross, h.gross_peak = k;
    }
    h.net_j[k] = net;
    h.gross_j[k] = gross;
  }
  return h;
}

double burn_angle_cad(const TraceAnalysis& a, const CumulativeHeat& h, bool gross, double share) {
  const std::vector<double>& heat = gross ? h.gross_j : h.net_j;
  const double level = share * (gross ? h.gross_best_j : h.net_best_j);
  const std::size_t peak = gross ? h.gross_peak : h.net_peak;
  for (std::size_t k = h.first; k < peak; ++k) {
    if (heat[k + 1] >= level && heat[k + 1] > heat[k]) {
      return a.angle_cad[k] +
             (a.angle_cad[k + 1] - a.angle_cad[k]) * std::max(0.0, level - heat[k]) / (heat[k + 1] - heat[k]);
    }
  }
  return undefined<double>();
}

}  // namespace mgdd::engine
