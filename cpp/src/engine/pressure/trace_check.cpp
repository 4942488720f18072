#include "mgdd/engine/pressure/trace_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/pressure/angles.hpp"

namespace mgdd::engine {
namespace {

std::string sample(const char* name, std::size_t k, double value) {
  return std::string(name) + "[" + std::to_string(k) + "] = " + text(value);
}

}  // namespace

void check_trace(const std::vector<double>& angle, const std::vector<double>& pressure) {
  if (angle.size() != pressure.size()) {
    throw about("crank_angle_cad",
                ShapeError("crank_angle_cad has " + std::to_string(angle.size()) + " entries and pressure_bar " +
                           std::to_string(pressure.size()) + ": they must be equally long"));
  }
  if (angle.size() < 20) {
    throw DataError("the trace has " + std::to_string(angle.size()) + " samples: at least 20 are needed");
  }
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (!std::isfinite(angle[k]))
      throw about("crank_angle_cad", DataError(sample("crank_angle_cad", k, angle[k]) + ": must be finite"));
    if (!std::isfinite(pressure[k])) {
      throw about("pressure_bar", DataError(sample("pressure_bar", k, pressure[k]) + " at " + text(angle[k]) +
                                            " °CA aTDC: must be finite; drop or repair the sample"));
    }
  }
  std::vector<double> steps(angle.size() - 1);
  for (std::size_t k = 0; k + 1 < angle.size(); ++k) {
    steps[k] = angle[k + 1] - angle[k];
    if (steps[k] == 0.0) {
      throw about("crank_angle_cad",
                  DataError(sample("crank_angle_cad", k + 1, angle[k + 1]) + ": repeated; keep one sample per angle"));
    }
    if (steps[k] < 0.0) {
      throw about("crank_angle_cad",
                  DataError(sample("crank_angle_cad", k + 1, angle[k + 1]) + " after " + text(angle[k]) +
                            ": angles must increase; sort the trace or cut it to one cycle"));
    }
  }
  const double usual = median_step(angle);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    if (steps[k] > 1.5 * usual) {
      throw DataError("gap of " + text(steps[k]) + " °CA between crank_angle_cad[" + std::to_string(k) +
                      "] = " + text(angle[k]) + " and " + text(angle[k + 1]) + ", where the usual step is " +
                      text(usual) + ": fill it or cut the trace");
    }
  }
  const double highest = *std::max_element(pressure.begin(), pressure.end());
  if (highest > highest_pressure_bar) {
    const char* unit = highest > 1e5 ? "Pa" : "kPa";
    throw about("pressure_bar",
                DataError("pressure_bar reaches " + text(highest) + " bar, above " + text(highest_pressure_bar) +
                          ": this looks like " + unit + "; convert it or say pressure_unit='" + unit + "'"));
  }
}

}  // namespace mgdd::engine
