#include "mgdd/loop/function_plant.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/random.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"

namespace mgdd::loop {
namespace {

constexpr double not_measured = std::numeric_limits<double>::quiet_NaN();
constexpr double most_values = 64.0;

}  // namespace

double plant_noise(std::uint64_t seed, std::int64_t cycle) noexcept {
  return random::normal(seed, 0, static_cast<std::uint64_t>(cycle));
}

FunctionPlant::FunctionPlant(PlantFunction function, void* user_data, FunctionPlantSettings settings)
    : function_(function), user_data_(user_data), settings_(std::move(settings)) {
  if (function_ == nullptr) throw about("function", ParameterError("function is null: give the address of one"));
  require_within("inputs", static_cast<double>(settings_.inputs), 1.0, optimize::max_inputs);
  require_within("values", static_cast<double>(settings_.values), 1.0, most_values);
  require_within("limits", static_cast<double>(settings_.limits.size()), 0.0, static_cast<double>(max_limits));
  require_in(closed(0.0, optimize::largest_reading), "noise_sd", settings_.noise_sd);
  outputs_.assign(settings_.values + settings_.limits.size(), not_measured);
}

std::span<const double> FunctionPlant::measure(std::span<const double> inputs) noexcept {
  const std::int64_t cycle = cycle_++;
  std::fill(outputs_.begin(), outputs_.end(), not_measured);
  const int status = function_(inputs.data(), inputs.size(), outputs_.data(), outputs_.size(), user_data_);
  if (status != 0 || !std::all_of(outputs_.begin(), outputs_.end(), optimize::is_reading)) return {};
  if (settings_.noise_sd > 0.0) outputs_[0] += settings_.noise_sd * plant_noise(settings_.seed, cycle);
  return outputs_;
}

BenchCycle FunctionPlant::step(std::span<const double> inputs) noexcept {
  BenchCycle c;
  c.cycle = cycle_;
  c.soc_requested_cad = c.soc_applied_cad = c.soc_cad = inputs[0];
  c.nox_true_ppm = c.nox_analyser_ppm = c.nox_fast_ppm = c.nox_soft_ppm = c.nox_soft_corrected_ppm = not_measured;
  c.component_count = 1;
  c.limit_count = settings_.limits.size();
  const std::span<const double> measured = measure(inputs);
  c.misfire = measured.empty();
  c.j = c.components[0] = c.misfire ? not_measured : measured[0];
  for (std::size_t i = 0; i < c.limit_count; ++i)
    c.limit_values[i] = c.misfire ? not_measured : measured[settings_.values + i];
  return c;
}

void FunctionPlant::reset(std::uint64_t seed) noexcept {
  settings_.seed = seed;
  cycle_ = 0;
}

}  // namespace mgdd::loop
