#include "case_reader.hpp"

#include <algorithm>
#include <string>
#include <string_view>

#include "mgdd/common/error.hpp"

namespace mgdd::engine {
namespace {

using Changes = BatchColumn::Changes;

// A change of these needs another crank grid, or other tables over it.
Changes change_of(std::string_view cylinder_field) {
  if (cylinder_field == "ivc_cad" || cylinder_field == "evo_cad") return Changes::grid;
  for (const std::string_view name :
       {"bore_mm", "stroke_mm", "connecting_rod_mm", "compression_ratio", "bowl_area_factor", "gamma"}) {
    if (cylinder_field == name) return Changes::tables;
  }
  for (const auto* part : {"burn_", "wiebe_", "second_", "lower_heating_value"}) {
    if (cylinder_field.starts_with(part)) return Changes::burn;
  }
  return Changes::cylinder;
}

void set_point(CycleInputs<double>& inputs, double value, const BatchColumn& column) {
  column.in_point(inputs.point) = value;
}
void set_cylinder(CycleInputs<double>& inputs, double value, const BatchColumn& column) {
  column.in_cylinder(inputs.cylinder) = value;
}
void set_timing(CycleInputs<double>& inputs, double value, const BatchColumn&) {
  inputs.soc_cad = value;
}
template <std::optional<double> OperatingPoint::* member>
void set_optional(CycleInputs<double>& inputs, double value, const BatchColumn&) {
  inputs.point.*member = value;
}

}  // namespace

std::vector<BatchColumn> batch_columns() {
  std::vector<BatchColumn> all;
  all.push_back({{"soc_cad", "°CA aTDC", closed(timing_lower_cad, timing_upper_cad), "start of combustion"},
                 Changes::timing,
                 set_timing});
  all.push_back({burn_duration_info, Changes::burn, set_optional<&OperatingPoint::burn_duration_cad>});
  all.push_back({trapped_mass_info, Changes::point, set_optional<&OperatingPoint::trapped_mass_g>});
  all.push_back({ivc_temperature_info, Changes::point, set_optional<&OperatingPoint::ivc_temperature_k>});
  for (const auto& field : operating_point_fields<double>()) {
    all.push_back(
        {field.info, field.info.name == "fuel_mg" ? Changes::burn : Changes::point, set_point, field.access, nullptr});
  }
  for (const auto& field : cylinder_fields<double>())
    all.push_back({field.info, change_of(field.info.name), set_cylinder, nullptr, field.access});
  return all;
}

std::vector<FieldInfo> batch_inputs() {
  std::vector<FieldInfo> infos;
  for (const BatchColumn& column : batch_columns())
    infos.push_back(column.info);
  return infos;
}

CaseReader::CaseReader(const BatchCases& cases) : cases_(cases) {
  const std::vector<BatchColumn> all = batch_columns();
  for (const std::string& name : cases.names) {
    const auto same = [&name](const BatchColumn& column) { return column.info.name == name; };
    const auto found = std::ranges::find_if(all, same);
    if (found == all.end()) {
      std::string valid;
      for (const BatchColumn& column : all)
        valid.append(valid.empty() ? "" : ", ").append(column.info.name);
      throw ParameterError("names", name, "must be one of " + valid);
    }
    if (std::ranges::any_of(columns_, same)) throw ParameterError("names", name, "stands there twice");
    columns_.push_back(*found);
  }
  if (columns_.empty()) throw about("names", ParameterError("names is empty: a batch varies at least one input"));
  if (cases.values.size() % columns_.size() != 0) {
    throw about("values", ShapeError("values has " + std::to_string(cases.values.size()) + " entries: must be " +
                                     std::to_string(columns_.size()) + " for each case"));
  }
}

double CaseReader::cases_per_point() const noexcept {
  std::size_t points = size() > 0 ? 1 : 0;
  const std::size_t m = columns_.size();
  for (std::size_t row = 1; row < size(); ++row) {
    const double* now = cases_.values.data() + row * m;
    for (std::size_t i = 0; i < m; ++i) {
      if (columns_[i].changes < Changes::point || now[i] == (now - m)[i]) continue;
      ++points;
      break;
    }
  }
  return points > 0 ? static_cast<double>(size()) / static_cast<double>(points) : 0.0;
}

bool CaseReader::within_domains(std::size_t row) const noexcept {
  const double* value = cases_.values.data() + row * columns_.size();
  const GeometryParameters<double>& g = cases_.cylinder.geometry;
  return std::ranges::all_of(columns_, [&](const BatchColumn& column) {
    const double x = *value++;
    return column.info.domain.contains(x) && (column.changes != Changes::timing || (x >= g.ivc_cad && x < g.evo_cad));
  });
}

void CaseReader::require_valid() const {
  CycleInputs<double> inputs = start();
  // Several fields together must fit; the usual inputs cannot break that when each of them lies in its domain.
  const auto in_cylinder = [](const BatchColumn& column) { return column.in_cylinder != nullptr; };
  const bool together = std::ranges::any_of(columns_, in_cylinder) || cases_.cylinder.gas.ivc_pressure_rise_kpa < 0.0 ||
                        cases_.cylinder.burn.burn_shape == BurnShape::double_wiebe;
  for (std::size_t row = 0; row < size(); ++row) {
    if (row > 0 && !together && within_domains(row)) continue;
    static_cast<void>(read(row, no_row, inputs));
    try {
      validate_cycle(inputs.cylinder, inputs.point, inputs.soc_cad);
    } catch (const ParameterError& e) {
      ParameterError located("case " + std::to_string(row) + ": " + e.what());
      located.field = e.field;
      located.value = e.value;
      located.bound = e.bound;
      throw located;
    }
  }
}

}  // namespace mgdd::engine
