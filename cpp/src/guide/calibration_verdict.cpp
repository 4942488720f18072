// What an online calibration says of its own parameters.
#include <algorithm>
#include <cmath>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/guide/online_calibration.hpp"

namespace mgdd::guide {
namespace {

constexpr double contradiction_sds = 3.0;
constexpr double culprit_share = 0.25;  // of the variance that would go if that parameter were known

std::string name_of_parameter(int parameter) {
  return std::string(info_of(parameter).field.name);
}
// Shortest text of a number of three significant digits.
std::string short_text(double value) {
  if (value == 0.0 || !std::isfinite(value)) return text(value);
  const double unit = std::pow(10.0, std::floor(std::log10(std::abs(value))) - 2.0);
  const double steps = std::round(value / unit);
  return text(unit < 1.0 ? steps / std::round(1.0 / unit) : steps * unit);
}
std::string with_unit(double value, int parameter) {
  const std::string_view unit = info_of(parameter).field.unit;
  return short_text(value) + (unit == "-" ? "" : " " + std::string(unit));
}

double determined_below(int parameter, double value) noexcept {
  const double sd = info_of(parameter).determined_sd;
  return parameter == Calibrated::wall_heat_scale ? sd * value : sd;
}

}  // namespace

CalibrationVector OnlineCalibration::standard_errors() const noexcept {
  return covariance_.diagonal().cwiseMax(0.0).cwiseSqrt();
}

bool OnlineCalibration::is_held(int parameter) const noexcept {
  double variance = covariance_(parameter, parameter);
  // Extremum seeking fits one parameter: the variance that the others add to it does not mean poor excitation.
  for (int i = 0; seeker_ && i < n_calibrated; ++i) {
    if (i != parameter && covariance_(i, i) > 0.0)
      variance -= std::pow(covariance_(parameter, i), 2) / covariance_(i, i);
  }
  return variance > std::pow(info_of(parameter).known_sd, 2);
}

CalibrationVerdict OnlineCalibration::verdict(int parameter) const noexcept {
  CalibrationVerdict out;
  const double variance = covariance_(parameter, parameter);
  if (updates_ == 0 || !settings_.wanted[place(parameter)]) return out;
  double worst = 0.0;
  for (int i = 0; i < n_calibrated; ++i) {
    if (i == parameter || !(covariance_(i, i) > 0.0)) continue;
    const double explained = std::pow(covariance_(parameter, i), 2) / covariance_(i, i);
    if (explained > culprit_share * variance && explained > worst) {
      worst = explained;
      out.culprit = i;
    }
  }
  const Beforehand known = beforehand();
  for (int i = 0; i < n_calibrated; ++i) {
    if (settings_.wanted[place(i)] || !known.unknown[place(i)]) continue;
    const double sds = std::abs(x_[i] - known.start[i]) * std::sqrt(known.information[i]);
    if (sds > contradiction_sds) return {Knowledge::contradicted, i};
  }
  const Domain& domain = info_of(parameter).field.domain;
  const double margin = seeker_ ? 1.01 * calibration_amplitude : 0.0;
  if (is_held(parameter)) {
    out.knowledge = Knowledge::held;
  } else if (x_[parameter] <= domain.lower + margin || x_[parameter] >= domain.upper - margin) {
    out.knowledge = Knowledge::at_bound;
  } else {
    const bool sure = std::sqrt(variance) <= determined_below(parameter, x_[parameter]);
    out.knowledge = sure ? Knowledge::determined : Knowledge::uncertain;
  }
  return out;
}

bool OnlineCalibration::determined() const noexcept {
  for (int i = 0; i < n_calibrated; ++i) {
    if (settings_.wanted[place(i)] && verdict(i).knowledge != Knowledge::determined) return false;
  }
  return true;
}

std::string OnlineCalibration::explain(int parameter) const {
  const CalibrationVerdict v = verdict(parameter);
  const std::string name = name_of_parameter(parameter);
  if (v.knowledge == Knowledge::no_data) {
    return name + " = " + with_unit(x_[parameter], parameter) + ": no data, nothing was adapted yet";
  }
  const double error = std::sqrt(std::max(covariance_(parameter, parameter), 0.0));
  std::string out = name + " = " + short_text(x_[parameter]) + " +- " + with_unit(error, parameter) + ": ";
  out += name_of(v.knowledge);
  const auto because = [&] {
    if (v.culprit < 0) return std::string(", by noise");
    return ", mostly because " + name_of_parameter(v.culprit) + " is known to " +
           with_unit(std::sqrt(covariance_(v.culprit, v.culprit)), v.culprit) + " only";
  };
  switch (v.knowledge) {
    case Knowledge::uncertain:
      return out + ", above " + with_unit(determined_below(parameter, x_[parameter]), parameter) + because();
    case Knowledge::held:
      return out + ", known beforehand to " + with_unit(info_of(parameter).known_sd, parameter) + because();
    case Knowledge::contradicted:
      return out + ", " + name_of_parameter(v.culprit) + " had to go to " + with_unit(x_[v.culprit], v.culprit) +
             ", more than three standard deviations off: the model does not fit";
    default:
      return out;
  }
}

void OnlineCalibration::require_usable() const {
  for (int i = 0; i < n_calibrated; ++i) {
    require_in(info_of(i).field.domain, "state column 'parameters' for " + name_of_parameter(i), x_[i]);
    if (!(covariance_(i, i) >= 0.0)) throw ParameterError("state column 'covariance' must have a diagonal >= 0");
  }
}

}  // namespace mgdd::guide
