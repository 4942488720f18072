#include "mgdd/throttle/models/pseudo_wiener_numbers.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "mgdd/common/error.hpp"

namespace mgdd::throttle {
namespace {

// Settings stand beside the fields of a kind: `v(name, unit, member)`, in the order of a file.
template <class P, class V>
void visit_settings(P& p, V&& v) {
  v("closed_deg", "deg", p.frame.closed_deg);
  v("open_deg", "deg", p.frame.open_deg);
  v("sample_s", "s", p.frame.sample_s);
  v("delay_samples", "samples", p.frame.delay_samples);
  if constexpr (requires { p.ramp_deg; }) {
    v("substeps", "-", p.frame.substeps);
    v("ramp_deg", "deg", p.ramp_deg);
    v("tanh_deg_per_s", "deg/s", p.tanh_deg_per_s);
    v("dead_band_deg", "deg", p.dead_band_deg);
  } else {
    v("map_start", "-", p.lag_start);
  }
  if constexpr (requires { p.plays; }) v("plays", "-", p.plays);
  if constexpr (requires { p.knot_lower_duty; }) {
    v("knot_lower_duty", "-", p.knot_lower_duty);
    v("knot_upper_duty", "-", p.knot_upper_duty);
  }
}

double number_of(double member) {
  return member;
}
double number_of(int member) {
  return member;
}
double number_of(LagStart member) {
  return member == LagStart::inverse_map ? 1.0 : 0.0;
}

void assign(std::string_view, double& member, double value) {
  member = value;
}
void assign(std::string_view name, int& member, double value) {
  if (!(value >= 0.0 && value <= 1e6) || value != std::floor(value)) {
    throw ParameterError(name, value, "must be a whole number");
  }
  member = static_cast<int>(value);
}
void assign(std::string_view name, LagStart& member, double value) {
  if (value != 0.0 && value != 1.0) throw ParameterError(name, value, "must be 0 or 1");
  member = value == 1.0 ? LagStart::inverse_map : LagStart::rest;
}

std::vector<NamedNumber> listed(const PseudoWiener& model, bool all) {
  const auto rows = fields(kind_of(model));
  std::vector<NamedNumber> out;
  std::visit(
      [&](const auto& p) {
        const auto places = numbers(p);
        for (std::size_t i = 0; i < rows.size(); ++i) {
          if constexpr (requires { p.plays; }) {
            const auto end_of_plays = 3 + 2 * static_cast<std::size_t>(p.plays);
            if (!all && i >= end_of_plays && i + 1 < rows.size()) continue;
          }
          out.push_back({rows[i].name, rows[i].unit, *places[i]});
        }
        visit_settings(p, [&](std::string_view name, std::string_view unit, const auto& member) {
          out.push_back({name, unit, number_of(member)});
        });
      },
      model);
  return out;
}

PseudoWiener standard(PseudoWienerKind kind) {
  if (kind == PseudoWienerKind::pw_w) return PwW{};
  if (kind == PseudoWienerKind::pw_p) return PwP{};
  return PwR{};
}

}  // namespace

std::vector<NamedNumber> named_numbers(const PseudoWiener& model) {
  return listed(model, false);
}

std::vector<NamedNumber> named_numbers(PseudoWienerKind kind) {
  return listed(standard(kind), true);
}

PseudoWiener pseudo_wiener_from(std::string_view kind, const std::map<std::string, double>& given,
                                std::string_view switching, std::string_view friction) {
  const PseudoWienerKind k = parse_name<PseudoWienerKind>("kind", kind);
  PseudoWiener out = standard(k);
  const auto rows = fields(k);
  std::visit(
      [&](auto& p) {
        const auto places = numbers(p);
        for (const auto& entry : given) {
          const std::string& name = entry.first;
          const double value = entry.second;
          bool known = false;
          for (std::size_t i = 0; i < rows.size(); ++i) {
            if (rows[i].name != name) continue;
            *places[i] = value;
            known = true;
          }
          visit_settings(p, [&](std::string_view setting, std::string_view, auto& member) {
            if (setting != name) return;
            assign(setting, member, value);
            known = true;
          });
          if (!known) {
            throw about("parameters",
                        ParameterError("parameters: '" + name + "' is not a parameter of " + std::string(kind)));
          }
        }
        if constexpr (requires { p.switching; }) {
          p.switching = parse_name<Switching>("switching", switching);
          p.friction = parse_name("friction", friction, dry_friction_names());
        }
      },
      out);
  validate(out);
  return out;
}

}  // namespace mgdd::throttle
