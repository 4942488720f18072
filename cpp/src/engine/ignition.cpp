#include "mgdd/engine/ignition.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/common/units.hpp"
#include "mgdd/engine/cycle.hpp"

namespace mgdd::engine {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

double interpolate(const std::vector<double>& x, const std::vector<double>& y, double at) {
  const auto upper = std::upper_bound(x.begin() + 1, x.end() - 1, at);
  const auto k = static_cast<std::size_t>(upper - x.begin());
  return y[k - 1] + (y[k] - y[k - 1]) * (at - x[k - 1]) / (x[k] - x[k - 1]);
}

// The motored cycle and what the chosen correlation needs of it.
class Delay {
 public:
  Delay(const Cylinder& cylinder, OperatingPoint point) : law_(cylinder.ignition), speed_rpm_(point.speed_rpm) {
    point.fuel_mg = 0.0;
    angle_ = crank_grid(cylinder);
    const CycleModel<double> model(cylinder, angle_);
    const Charge<double> charge = model.charge(point);
    CycleWorkspace<double> work = model.make_workspace();
    model.run(charge, 0.0, work);
    model.require_physical(work);
    piston_speed_ = model.geometry().mean_piston_speed_m_per_s(point.speed_rpm);
    for (std::size_t k = 0; k < angle_.size(); ++k) {
      pressure_bar_.push_back(work.pressure_pa[k] / units::pa_per_bar);
      temperature_k_.push_back(work.pressure_pa[k] * model.volume_m3()[k] / charge.gas_j_per_k);
    }
    if (by_integral()) accumulate();
  }

  bool by_integral() const noexcept {
    return law_.ignition_model == IgnitionModel::watson || law_.ignition_model == IgnitionModel::wolfer;
  }

  double soc(double soi_cad) const {
    if (soi_cad < angle_.front() || soi_cad > angle_.back()) return nan;
    if (by_integral()) {
      const double goal = interpolate(angle_, progress_, soi_cad) + 1.0;
      return goal <= progress_.back() ? interpolate(progress_, angle_, goal) : nan;
    }
    const double end = soi_cad + algebraic_delay_cad(soi_cad);
    return end <= angle_.back() ? end : nan;
  }

  /// Largest SOI in the injection window whose SOC is not after `soc_cad`, and the edges where there is none.
  IgnitionTiming inverse(double soc_cad) const {
    const double low = std::max(injection_lower_cad, angle_.front());
    double high = injection_upper_cad;
    // The late edge: the last injection that still ignites; "no ignition" counts as later than any SOC.
    const auto too_late = [&](double soi, double bound) {
      const double at = soc(soi);
      return !(at <= bound);
    };
    if (too_late(high, infinity)) high = last(low, high, infinity);
    if (std::isnan(high)) return {nan, nan, nan, false, true};
    if (!too_late(high, soc_cad)) return result(high, soc(high) < soc_cad - 1e-6);
    // Search downwards from the late side: Hardenberg-Hase has no value where the pressure is too low.
    const double soi = last(low, high, soc_cad);
    if (std::isnan(soi)) return result(earliest(low, high), true);
    return result(soi, std::abs(soc(soi) - soc_cad) > 1e-6);
  }

 private:
  // The last SOI in [low, high] with SOC <= bound: coarse steps down from the late side, then bisection.
  double last(double low, double high, double bound) const {
    const auto good = [&](double soi) { return soc(soi) <= bound; };
    constexpr double coarse_cad = 0.25;
    double bad = high;
    double at = high;
    while (!good(at)) {
      if (at <= low) return nan;
      bad = at;
      at = std::max(low, at - coarse_cad);
    }
    for (int i = 0; i < 60 && bad > at; ++i) {
      const double middle = 0.5 * (at + bad);
      (good(middle) ? at : bad) = middle;
    }
    return at;
  }

  double earliest(double low, double high) const {
    double best = std::isnan(soc(low)) ? high : low;
    for (double soi = high; soi >= low; soi -= 0.25) {
      if (soc(soi) < soc(best)) best = soi;
    }
    return best;
  }

  IgnitionTiming result(double soi, bool clipped) const {
    const double at = soc(soi);
    return {soi, at, at - soi, !std::isnan(at), clipped};
  }

  double algebraic_delay_cad(double soi_cad) const {
    if (law_.ignition_model == IgnitionModel::polynomial) {
      return law_.ignition_c0_cad + soi_cad * (law_.ignition_c1 + soi_cad * law_.ignition_c2_per_cad);
    }
    return hardenberg_hase_delay_cad(interpolate(angle_, pressure_bar_, soi_cad),
                                     interpolate(angle_, temperature_k_, soi_cad), law_.cetane_number, piston_speed_);
  }

  // Cumulative trapezoid of dt/tau. It does not depend on SOI, so that the same table serves both directions.
  void accumulate() {
    const double ms_per_cad = 1e3 / (units::cad_per_s_per_rpm * speed_rpm_);
    const auto rate = [&](std::size_t k) {
      return law_.ignition_model == IgnitionModel::watson ? 1.0 / watson_delay_ms(pressure_bar_[k], temperature_k_[k])
                                                          : 1.0 / wolfer_delay_ms(pressure_bar_[k], temperature_k_[k]);
    };
    progress_.assign(1, 0.0);
    for (std::size_t k = 1; k < angle_.size(); ++k) {
      progress_.push_back(progress_.back() + 0.5 * (rate(k - 1) + rate(k)) * (angle_[k] - angle_[k - 1]) * ms_per_cad);
    }
  }

  const IgnitionParameters<double>& law_;
  double speed_rpm_;
  double piston_speed_ = 0.0;
  std::vector<double> angle_, pressure_bar_, temperature_k_, progress_;
};

void check(const Cylinder& cylinder, const OperatingPoint& point, std::string_view name, double value) {
  validate_cycle(cylinder, point, 0.0);
  validate_timing(name, value, cylinder);
}

}  // namespace

double watson_delay_ms(double pressure_bar, double temperature_k) noexcept {
  return 3.52 * std::pow(pressure_bar, -1.022) * std::exp(2100.0 / temperature_k);
}

double wolfer_delay_ms(double pressure_bar, double temperature_k) noexcept {
  return 0.44 * std::pow(pressure_bar, -1.19) * std::exp(4650.0 / temperature_k);
}

double hardenberg_hase_delay_cad(double pressure_bar, double temperature_k, double cetane_number,
                                 double piston_speed_m_per_s) noexcept {
  if (!(pressure_bar > 12.4)) return infinity;
  constexpr double gas_constant = 8.3143;  // the value of the correlation, not today's
  const double activation = 618840.0 / (cetane_number + 25.0);
  return (0.36 + 0.22 * piston_speed_m_per_s) *
         std::exp(activation * (1.0 / (gas_constant * temperature_k) - 1.0 / 17190.0) *
                  std::pow(21.2 / (pressure_bar - 12.4), 0.63));
}

IgnitionTiming start_of_combustion(const Cylinder& cylinder, const OperatingPoint& point, double soi_cad) {
  check(cylinder, point, "soi_cad", soi_cad);
  const double soc = Delay(cylinder, point).soc(soi_cad);
  if (soc < soi_cad) {
    throw ParameterError("ignition_c0_cad", cylinder.ignition.ignition_c0_cad,
                         "the polynomial gives a delay of " + text(soc - soi_cad) +
                             " °CA at soi_cad = " + text(soi_cad) + ", must be >= 0",
                         "°CA");
  }
  return {soi_cad, soc, soc - soi_cad, !std::isnan(soc), false};
}

IgnitionTiming start_of_injection(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad) {
  check(cylinder, point, "soc_cad", soc_cad);
  return Delay(cylinder, point).inverse(soc_cad);
}

}  // namespace mgdd::engine
