#include "mgdd/guide/online_calibration_settings.hpp"

#include <algorithm>
#include <string>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

// What is off must leave a gas and an engine.
constexpr double gamma_lower = 1.15, gamma_upper = 1.6;
constexpr double compression_lower = 3.0, compression_upper = 99.0;
constexpr double wall_lower_k = 300.0, wall_upper_k = 1700.0;

}  // namespace

int parse_calibrated(std::string_view field, std::string_view name) {
  std::string valid;
  for (int i = 0; i < n_calibrated; ++i) {
    if (info_of(i).field.name == name) return i;
    valid.append(valid.empty() ? "" : ", ").append(info_of(i).field.name);
  }
  throw ParameterError(field, name, "must be one of " + valid);
}

void validate(const OnlineCalibrationSettings& s) {
  engine::validate(s.cylinder);
  require_within("gamma", s.cylinder.gas.gamma, gamma_lower, gamma_upper);
  require_within("compression_ratio", s.cylinder.geometry.compression_ratio, compression_lower, compression_upper);
  require_within("wall_temperature_k", s.cylinder.wall_heat.wall_temperature_k, wall_lower_k, wall_upper_k, "K");
  require_within("forgetting", s.forgetting, 0.0, 1.0);
  require_within("soc_scatter_cad", s.soc_scatter_cad, 0.0, 5.0, "°CA");
  require_within("jump_factor", s.jump_factor, 1.5, 100.0);
  require_within("trials_per_update", s.trials_per_update, 1.0, 100.0);
  if (std::none_of(s.wanted.begin(), s.wanted.end(), [](bool w) { return w; })) {
    throw about("parameters", ParameterError("parameters is empty: name at least one to adapt"));
  }
  for (int i = 0; i < n_calibrated; ++i) {
    const FieldInfo& field = info_of(i).field;
    require_within("uncertainty of " + std::string(field.name), s.uncertainty[place(i)], 0.0,
                   field.domain.upper - field.domain.lower, field.unit);
    if (i != Calibrated::wall_heat_scale && s.wanted[place(i)] && s.method == CalibrationMethod::extremum_seeking) {
      throw about("parameters", ParameterError("parameters: extremum seeking adapts wall_heat_scale alone, not " +
                                               std::string(field.name) + "; use 'gauss_newton' or 'recursive'"));
    }
  }
  if (s.wanted[place(Calibrated::soc_variance)] && !(s.soc_scatter_cad > 0.0)) {
    throw ParameterError("soc_scatter_cad", s.soc_scatter_cad, "must be above 0 where soc_variance_scale is adapted");
  }
  if (s.method == CalibrationMethod::extremum_seeking && !s.wanted[place(Calibrated::wall_heat_scale)]) {
    throw about("parameters", ParameterError("parameters: extremum seeking adapts wall_heat_scale, name it"));
  }
}

Beforehand beforehand_of(const OnlineCalibrationSettings& s) {
  Beforehand out;
  for (int i = 0; i < n_calibrated; ++i) {
    const CalibratedInfo& info = info_of(i);
    const double start = i == Calibrated::wall_heat_scale ? s.cylinder.wall_heat.wall_heat_scale : info.start;
    out.start[i] = info.field.domain.clamped(start);
    const double width = info.field.domain.upper - info.field.domain.lower;
    const double sd = s.wanted[place(i)] ? width : s.uncertainty[place(i)];
    out.unknown[place(i)] = sd > 0.0 && (i != Calibrated::soc_variance || s.soc_scatter_cad > 0.0);
    if (sd > 0.0) out.information[i] = 1.0 / (sd * sd);
  }
  return out;
}

}  // namespace mgdd::guide
