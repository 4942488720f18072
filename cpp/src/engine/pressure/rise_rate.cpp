#include "mgdd/engine/pressure/rise_rate.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "mgdd/math/cubic_weights.hpp"
#include "mgdd/math/line_fit.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

constexpr double coarsest_cad = 0.25;

}  // namespace

double steepest_rise_bar_per_cad(const Column& angle, const Column& pressure) {
  Column x, y;
  for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
    const double step = angle[k + 1] - angle[k];
    const int parts = std::max(1, static_cast<int>(std::ceil(step / coarsest_cad - 1e-6)));
    for (int i = 0; i < parts; ++i) {
      x.push_back(angle[k] + step * i / parts);
      y.push_back(i == 0 ? pressure[k] : cubic_weights(angle, k, x.back()).value_of(pressure));
    }
  }
  x.push_back(angle.back()), y.push_back(pressure.back());

  double steepest = -std::numeric_limits<double>::infinity();
  LineFit line;  // of the samples low to high - 1, which move along
  std::size_t low = 0, high = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double from = x[k] - 0.5 * rise_rate_width_cad - 1e-9, to = x[k] + 0.5 * rise_rate_width_cad + 1e-9;
    if (from < x.front() - 1e-6 || to > x.back() + 1e-6) continue;  // only whole windows
    for (; high < x.size() && x[high] <= to; ++high)
      line.add(x[high], y[high]);
    for (; x[low] < from; ++low)
      line.add(x[low], y[low], -1.0);
    LineFit trapezoid = line;  // half weight at both ends: the sums are trapezoids of the integrals
    trapezoid.add(x[low], y[low], -0.5);
    trapezoid.add(x[high - 1], y[high - 1], -0.5);
    steepest = std::max(steepest, trapezoid.slope());
  }
  return steepest;
}

}  // namespace mgdd::engine
