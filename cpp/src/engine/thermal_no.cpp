#include "mgdd/engine/thermal_no.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/gas.hpp"

namespace mgdd::engine {
namespace {

constexpr double no2_kg_per_mol = 46.0055e-3;
constexpr double burned_gamma = 1.28;  // of the burned gas between two samples
constexpr double frozen_k = 1700.0;    // below it no NO forms or goes in the time of a cycle
constexpr double packet_cad = 1.0;     // what burns within it is one packet
constexpr double least_burned = 1e-9;

// cm3, mol, s: forward rates of O + N2, N + O2, N + OH, and the reverse of the first.
struct Rates {
  double k1, k2, k3, k1_back;

  Rates(NoRates which, double t) noexcept {
    if (which == NoRates::heywood) {
      k1 = 7.6e13 * std::exp(-38000.0 / t), k2 = 6.4e9 * t * std::exp(-3150.0 / t), k3 = 4.1e13, k1_back = 1.6e13;
    } else {
      k1 = 1.8e14 * std::exp(-38370.0 / t), k2 = 1.8e10 * t * std::exp(-4680.0 / t);
      k3 = 7.1e13 * std::exp(-450.0 / t), k1_back = 3.8e13 * std::exp(-425.0 / t);
    }
  }
};

struct Packet {
  double moles, temperature_k, no = 0.0;

  void add(const Packet& other) noexcept {
    moles += other.moles;
    temperature_k += (other.temperature_k - temperature_k) * other.moles / moles;
    no += (other.no - no) * other.moles / moles;
  }
};

void check_cycle(std::span<const double> angle, std::span<const double> p, std::span<const double> v,
                 std::span<const double> t, std::span<const double> burned, const OperatingPoint& point) {
  const auto require = [&](std::string_view name, std::span<const double> column, bool positive) {
    if (column.size() != angle.size()) {
      throw about(name, ShapeError(std::string(name) + " has " + std::to_string(column.size()) +
                                   " samples, crank_angle_cad " + std::to_string(angle.size())));
    }
    for (std::size_t k = 0; k < column.size(); ++k) {
      if (std::isfinite(column[k]) && (!positive || column[k] > 0.0)) continue;
      throw DataError(std::string(name) + "[" + std::to_string(k) + "]", column[k],
                      positive ? "must be > 0 and finite" : "must be finite");
    }
  };
  if (angle.size() < 20) throw DataError("the trace has " + std::to_string(angle.size()) + " samples: 20 are needed");
  require("crank_angle_cad", angle, false);
  require("pressure_bar", p, true);
  require("volume_l", v, true);
  require("temperature_k", t, true);
  require("burned_fraction", burned, false);
  if (!(point.fuel_mg > 0.0))
    throw ParameterError("fuel_mg", point.fuel_mg, "must be > 0: a motored cycle forms no nitric oxide", "mg");
  if (*std::ranges::max_element(burned) < least_burned)
    throw about("burned_fraction", DataError("nothing burns in the trace: give a fired cycle"));
}

}  // namespace

void validate(const ThermalNo& m) {
  require_fields(fields_of(m), m);
}

// d[NO]/dt = 2 R1 (1 - a^2)/(1 + a K), a = [NO]/[NO]e (Heywood 1988, eq. 11.14), by an implicit step in a.
double no_after(double start, const BurnedGas& gas, double t, double pressure_pa, double seconds,
                NoRates rates) noexcept {
  const Rates k(rates, t);
  const double mol_per_cm3 = 1e-6 * pressure_pa / (units::gas_constant_j_per_molk * t);
  const auto c = [&](Species s) { return mol_per_cm3 * gas[s]; };
  const double r1 = k.k1 * c(Species::o) * c(Species::n2);
  const double n = r1 / (k.k1_back * c(Species::no));
  const double share = r1 / (n * (k.k2 * c(Species::o2) + k.k3 * c(Species::oh)));
  const double formed = 2.0 * r1 / mol_per_cm3 * seconds, equilibrium = gas[Species::no], a = start / equilibrium;
  // e (x - a)(1 + K x) = h (1 - x^2), for x at the end of the step.
  const double square = equilibrium * share + formed, linear = equilibrium * (1.0 - a * share);
  const double rest = equilibrium * a + formed;
  const double x = (-linear + std::sqrt(linear * linear + 4.0 * square * rest)) / (2.0 * square);
  return x * equilibrium;
}

ThermalNoCycle thermal_no(std::span<const double> angle, std::span<const double> pressure_bar,
                          std::span<const double> volume_l, std::span<const double> temperature_k,
                          std::span<const double> burned_fraction, const Cylinder& cylinder,
                          const OperatingPoint& point, const ThermalNo& model) {
  validate(model);
  check_cycle(angle, pressure_bar, volume_l, temperature_k, burned_fraction, point);
  const Reactants mixture{.hydrogen_to_carbon = model.hydrogen_to_carbon,
                          .heating_value_j_per_kg = 1e6 * cylinder.gas.lower_heating_value_mj_per_kg,
                          .charge_o2_fraction = model.intake_o2_fraction,
                          .lambda = model.lambda_burned};
  const std::size_t n = angle.size();
  const auto pascal = [&](std::size_t k) { return units::pa_per_bar * pressure_bar[k]; };
  const double charge = pascal(0) * 1e-3 * volume_l[0] / (units::gas_constant_j_per_molk * temperature_k[0]);
  const double carbon = 1e-6 * point.fuel_mg / mixture.fuel_kg_per_mol();  // mol of CHy
  ThermalNoCycle out;
  out.lambda_global = model.lambda_burned * charge / (carbon * mixture.charge_mol());
  if (out.lambda_global < model.lambda_burned) {
    throw ParameterError("lambda_burned", model.lambda_burned,
                         "must be at most that of all charge, " + text(out.lambda_global) +
                             ": burn richer, or mend fuel_mg or intake_o2_fraction");
  }
  const double undefined = std::numeric_limits<double>::quiet_NaN();
  out.no_ppm.assign(n, 0.0), out.flame_k.assign(n, undefined), out.unburned_k.assign(n, undefined);
  std::size_t first = 0;
  while (first + 1 < n && burned_fraction[first + 1] < least_burned)
    ++first;
  const double gamma = gamma_at(cylinder.gas, temperature_k[first]);
  std::vector<Packet> packets;
  double burned = 0.0, work = 0.0, moles = charge, opened_cad = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < n; ++k) {
    const double p = pascal(k), mean = 0.5 * (p + pascal(k - 1));
    work += mean * 1e-3 * (volume_l[k] - volume_l[k - 1]);
    const double seconds = (angle[k] - angle[k - 1]) / (6.0 * point.speed_rpm);
    const double keep = std::exp(-1e3 * seconds / model.mixing_time_ms);
    const double squeezed = std::pow(pressure_bar[k] / pressure_bar[k - 1], (burned_gamma - 1.0) / burned_gamma);
    double formed = 0.0;
    const auto react = [&](Packet& packet, double t, double during) {
      if (t > frozen_k) packet.no = no_after(packet.no, burned_gas(mixture, t, mean), t, mean, during, model.rates);
    };
    for (Packet& packet : packets) {
      const double before = packet.temperature_k;
      packet.temperature_k = temperature_k[k] + keep * (before * squeezed - temperature_k[k]);
      react(packet, 0.5 * (before + packet.temperature_k), seconds);
      formed += packet.no * packet.moles;
    }
    if (k > first) {
      out.unburned_k[k] = temperature_k[first] * std::pow(pressure_bar[k] / pressure_bar[first], (gamma - 1.0) / gamma);
      const double share = std::min(burned_fraction[k], 1.0) - burned;
      if (share > least_burned) {
        burned += share;
        out.flame_k[k] = flame_temperature_k(mixture, out.unburned_k[k], p);
        out.flame_max_k = std::max(out.flame_max_k, out.flame_k[k]);
        // It has burned all along the step: half of the step has mixed it, and its NO has had that time.
        const double mixed = temperature_k[k] + std::sqrt(keep) * (out.flame_k[k] - temperature_k[k]);
        Packet fresh{share * carbon * burned_gas(mixture, out.flame_k[k], p).moles, mixed};
        react(fresh, 0.5 * (out.flame_k[k] + mixed), 0.5 * seconds);
        moles += fresh.moles - share * carbon * mixture.charge_mol();
        formed += fresh.no * fresh.moles;
        if (packets.empty() || angle[k] >= opened_cad + packet_cad - 1e-9) {
          packets.push_back(fresh);
          opened_cad = angle[k];
        } else {
          packets.back().add(fresh);
        }
      }
    }
    out.no_ppm[k] = 1e6 * model.calibration * formed / moles;
  }
  out.nox_ppm = out.no_ppm.back();
  const double grams = 1e3 * no2_kg_per_mol * 1e-6 * out.nox_ppm * moles;
  out.nox_g_per_kwh = work > 0.0 ? grams / (work / 3.6e6) : undefined;
  return out;
}

}  // namespace mgdd::engine
