#include "mgdd/engine/pressure/heat.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

void Cumulative::add(double step, std::size_t k) noexcept {
  sum[k] = sum[k - 1] + step;
  if (sum[k] > best) best = sum[k], peak = k;
}

const Cumulative& CumulativeHeat::of(BurnFractions which) const noexcept {
  switch (which) {
    case BurnFractions::gross:
      return gross_j;
    case BurnFractions::rassweiler_withrow:
      return pressure_bar;
    case BurnFractions::net:
      break;
  }
  return net_j;
}

CumulativeHeat accumulate_heat(const TraceAnalysis& a, double from_cad, double to_cad) {
  const std::size_t n = a.angle_cad.size();
  CumulativeHeat h;
  for (Cumulative* each : {&h.net_j, &h.gross_j, &h.pressure_bar})
    each->sum.assign(n, 0.0);
  for (std::size_t k = 1; k < n; ++k) {
    const bool inside = a.angle_cad[k - 1] >= from_cad - 1e-9 && a.angle_cad[k] <= to_cad + 1e-9;
    if (inside && h.empty) h.first = k - 1, h.empty = false;
    h.net_j.add(inside ? a.net_step_j[k] : 0.0, k);
    h.gross_j.add(inside ? a.net_step_j[k] + a.loss_step_j[k] : 0.0, k);
    h.pressure_bar.add(inside && !a.pressure_step_bar.empty() ? a.pressure_step_bar[k] : 0.0, k);
  }
  return h;
}

std::vector<double> combustion_pressure_bar(const TraceAnalysis& a, std::span<const double> p) {
  const double smallest = *std::min_element(a.volume_l.begin(), a.volume_l.end());
  std::vector<double> out(p.size(), 0.0);
  for (std::size_t k = 1; k < p.size(); ++k) {
    const double middle = 0.5 * (a.angle_cad[k] + a.angle_cad[k - 1]);
    const double way = std::clamp((middle - compression_to_cad) / (expansion_from_cad - compression_to_cad), 0.0, 1.0);
    const double exponent = a.n_compression + way * (a.n_expansion - a.n_compression);
    const double moved = p[k - 1] * std::pow(a.volume_l[k - 1] / a.volume_l[k], exponent);
    out[k] = (p[k] - moved) * 0.5 * (a.volume_l[k] + a.volume_l[k - 1]) / smallest;
  }
  return out;
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

double burn_angle_cad(const TraceAnalysis& a, const CumulativeHeat& h, BurnFractions which, double share) {
  const Cumulative& released = h.of(which);
  return level_angle_cad(a.angle_cad, released.sum, h.first, released.peak, share * released.best);
}

}  // namespace mgdd::engine
