#include "mgdd/engine/pressure/angles.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::engine {

SampleRange samples_within(const std::vector<double>& angle, double from_cad, double to_cad) {
  const auto index = [&](auto place) { return static_cast<std::size_t>(place - angle.begin()); };
  const std::size_t first = index(std::lower_bound(angle.begin(), angle.end(), from_cad - 1e-9));
  return {first, std::max(first, index(std::upper_bound(angle.begin(), angle.end(), to_cad + 1e-9)))};
}

double median_step(const std::vector<double>& angle) {
  std::vector<double> steps(angle.size() - 1);
  for (std::size_t k = 0; k + 1 < angle.size(); ++k)
    steps[k] = angle[k + 1] - angle[k];
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

bool is_even(const std::vector<double>& angle, double tolerance) {
  const double step = median_step(angle);
  for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
    if (std::abs(angle[k + 1] - angle[k] - step) > tolerance * step) return false;
  }
  return true;
}

}  // namespace mgdd::engine
