#include "mgdd/loop/pressure_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mgdd/common/random.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::loop {

PressureSensor::PressureSensor(const engine::CycleModel<double>& model, const PressureSensorSettings& settings)
    : label_cad_(model.angles_cad().begin(), model.angles_cad().end()),
      pressure_bar_(label_cad_.size(), std::numeric_limits<double>::quiet_NaN()),
      settings_(settings) {
  for (const double label : label_cad_) {
    const double angle = label - settings_.tdc_error_cad;
    const bool closed = angle >= label_cad_.front() && angle <= label_cad_.back();
    weights_.emplace_back();
    if (closed) weights_.back() = cubic_weights(label_cad_, interval_of(label_cad_, angle), angle);
  }
}

PressureTrace PressureSensor::read(const engine::CycleModel<double>& model, const engine::CycleWorkspace<double>& work,
                                   std::uint64_t seed, std::uint64_t stream, std::int64_t cycle) noexcept {
  const PressureTrace out{label_cad_, pressure_bar_};
  if (model.first_unphysical(work) < label_cad_.size()) {
    std::fill(pressure_bar_.begin(), pressure_bar_.end(), std::numeric_limits<double>::quiet_NaN());
    return out;
  }
  const auto open_pa = [&](double angle) {
    if (angle < label_cad_.front()) return work.pressure_pa.front();
    const double expansion = model.volume_m3().back() / model.geometry().volume_m3(angle);
    return work.pressure_pa.back() * std::pow(expansion, model.cylinder().gas.gamma);
  };
  const auto first = static_cast<std::uint64_t>(cycle) * label_cad_.size();
  const double offset_bar = settings_.offset_bar + settings_.drift_bar_per_kcycle * 1e-3 * static_cast<double>(cycle);
  for (std::size_t k = 0; k < label_cad_.size(); ++k) {
    const std::optional<CubicWeights>& weights = weights_[k];
    const double pa = weights ? weights->value_of(work.pressure_pa) : open_pa(label_cad_[k] - settings_.tdc_error_cad);
    pressure_bar_[k] = pa / units::pa_per_bar * (1.0 + settings_.gain_error) + offset_bar;
    if (settings_.noise_bar > 0.0) pressure_bar_[k] += settings_.noise_bar * random::normal(seed, stream, first + k);
  }
  return out;
}

}  // namespace mgdd::loop
