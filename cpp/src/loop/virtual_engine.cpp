#include "mgdd/loop/virtual_engine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mgdd/common/random.hpp"
#include "mgdd/common/units.hpp"

namespace mgdd::loop {
namespace {

constexpr double cycles_per_kcycle = 1000.0;
constexpr double percent = 100.0;
constexpr double changed_fraction = 0.05;
constexpr double wall_heat_upper = 100.0;  // of the field, which drift must not leave

using engine::Indicators;
using Member = double Indicators<double>::*;

double kcycles(std::int64_t cycles) noexcept {
  return static_cast<double>(cycles) / cycles_per_kcycle;
}

BenchSettings checked(BenchSettings settings) {
  validate(settings);
  return settings;
}

std::vector<Member> members_of(const std::vector<std::string>& names) {
  std::vector<Member> members;
  for (const std::string& name : names) {
    Member member = nullptr;
    for (const auto& field : engine::indicator_fields<double>()) {
      if (field.name == name) member = field.member;
    }
    members.push_back(member);
  }
  return members;
}

std::vector<double BenchCycle::*> readings_of(const std::vector<std::string>& names) {
  std::vector<double BenchCycle::*> members;
  for (const std::string& name : names) {
    double BenchCycle::* member = nullptr;
    for (const BenchLimit& limit : bench_limits) {
      if (limit.name == name) member = limit.member;
    }
    members.push_back(member);
  }
  return members;
}

std::size_t longest_delay(const SensorDynamics& sensor, const std::vector<ScheduledPoint>& schedule) {
  std::size_t longest = 0;
  for (const ScheduledPoint& entry : schedule)
    longest = std::max(longest, sensor.delay_at(entry.point.speed_rpm));
  return longest;
}

bool differs(double now, double before) noexcept {
  return std::abs(now - before) > changed_fraction * std::abs(before);
}

double routed_ppm(NoxSensor sensor, const BenchCycle& c) noexcept {
  switch (sensor) {
    case NoxSensor::analyser:
      return c.nox_analyser_ppm;
    case NoxSensor::fast:
      return c.nox_fast_ppm;
    case NoxSensor::soft:
      return c.nox_soft_ppm;
    case NoxSensor::soft_corrected:
      return c.nox_soft_corrected_ppm;
    case NoxSensor::true_value:
      return c.nox_true_ppm;
    case NoxSensor::none:
      break;
  }
  return 0.0;
}

}  // namespace

VirtualEngine::VirtualEngine(const BenchSettings& settings)
    : settings_(checked(settings)),
      model_(settings_.cylinder, engine::crank_grid(settings_.cylinder, settings_.step_cad), settings_.integrator),
      work_(model_.make_workspace()),
      pressure_sensor_(model_, settings_.pressure),
      limit_members_(members_of(settings_.limits)),
      limit_readings_(readings_of(settings_.limits)),
      closed_(closed_part(settings_.cylinder)),
      window_(timing_window(settings_.cylinder)),
      seed_(settings_.seed),
      analyser_(longest_delay(settings_.analyser, settings_.schedule)),
      fast_(longest_delay(settings_.fast_sensor, settings_.schedule)),
      soft_through_analyser_(longest_delay(settings_.analyser, settings_.schedule)) {
  for (const ScheduledPoint& entry : settings_.schedule) {
    const double rpm = entry.point.speed_rpm;
    prepared_.push_back({model_.charge(entry.point), settings_.analyser.delay_at(rpm),
                         settings_.fast_sensor.delay_at(rpm), settings_.analyser.gain_at(rpm),
                         settings_.fast_sensor.gain_at(rpm)});
    model_.run(prepared_.back().charge, window_[1], work_);
    model_.require_physical(work_);
  }
  for (const BenchInput input : settings_.inputs) {
    windows_.push_back(window_of(input, settings_.cylinder));
    egr_steered_ = egr_steered_ || input == BenchInput::egr;
    model_moves_ = model_moves_ || input == BenchInput::egr || input == BenchInput::second_fraction;
  }
  model_moves_ = model_moves_ || settings_.wall_heat_drift_per_kcycle != 0.0;
  if (settings_.delay_whole_objective) {
    component_lags_.assign(settings_.performance.size(),
                           TransportLag(longest_delay(settings_.analyser, settings_.schedule)));
  }
}

void VirtualEngine::reset(std::uint64_t seed) noexcept {
  seed_ = seed;
  cycle_ = 0;
  last_inputs_.fill(0.0);
  last_t_max_k_ = last_imep_bar_ = ln_bias_ = 0.0;
  last_components_.fill(0.0);
  imep_bar_.fill(0.0);
}

std::size_t VirtualEngine::index_at(std::int64_t cycle) const noexcept {
  const auto after = std::upper_bound(settings_.schedule.begin() + 1, settings_.schedule.end(), cycle,
                                      [](std::int64_t c, const ScheduledPoint& entry) { return c < entry.cycle; });
  return static_cast<std::size_t>(after - settings_.schedule.begin()) - 1;
}

const engine::OperatingPoint& VirtualEngine::point_at(std::int64_t cycle) const noexcept {
  return settings_.schedule[index_at(cycle)].point;
}

bool VirtualEngine::point_changes_at(std::int64_t cycle) const noexcept {
  const engine::OperatingPoint& now = point_at(cycle);
  const engine::OperatingPoint& before = point_at(cycle - 1);
  return differs(now.speed_rpm, before.speed_rpm) || differs(now.fuel_mg, before.fuel_mg);
}

std::size_t VirtualEngine::analyser_delay_cycles() const noexcept {
  return prepared_[index_at(cycle_)].analyser_delay;
}
double VirtualEngine::analyser_gain() const noexcept {
  return prepared_[index_at(cycle_)].analyser_gain;
}

double VirtualEngine::noise_at(BenchStream stream, std::int64_t cycle) const noexcept {
  return random::normal(seed_, static_cast<std::uint64_t>(stream), static_cast<std::uint64_t>(cycle));
}

engine::Cylinder VirtualEngine::drifted_cylinder(std::int64_t cycle) const noexcept {
  engine::Cylinder drifted = settings_.cylinder;
  drifted.wall_heat.wall_heat_scale = std::clamp(
      drifted.wall_heat.wall_heat_scale + settings_.wall_heat_drift_per_kcycle * kcycles(cycle), 0.0, wall_heat_upper);
  return drifted;
}

double VirtualEngine::drifted_soc_cad(double soc_cad, std::int64_t cycle) const noexcept {
  return soc_cad + settings_.soc_drift_cad_per_kcycle * kcycles(cycle);
}

// Drift must not carry the burn out of the cycle.
double VirtualEngine::burning_soc_cad(double soc_cad, std::int64_t cycle) const noexcept {
  double burning = drifted_soc_cad(soc_cad, cycle);
  if (settings_.soc_scatter_cad > 0.0) burning += settings_.soc_scatter_cad * noise_at(BenchStream::soc, cycle);
  return std::clamp(burning, closed_[0], closed_[1]);
}

bool VirtualEngine::misfires_at(std::int64_t cycle) const noexcept {
  return random::bernoulli(settings_.misfire_probability, seed_, static_cast<std::uint64_t>(BenchStream::misfire),
                           static_cast<std::uint64_t>(cycle));
}

// The noise of a cycle is a function of its number, so the state needs no trace.
PressureTrace VirtualEngine::pressure() noexcept {
  if (cycle_ == 0) return {};
  const std::int64_t last = cycle_ - 1;
  Filling filling = fill(last, last_inputs_);
  if (misfires_at(last)) filling.charge.fuel_heat_j = 0.0;
  model_.run(filling.charge, burning_soc_cad(last_inputs_[0], last), work_);
  return pressure_sensor_.read(model_, work_, seed_, static_cast<std::uint64_t>(BenchStream::pressure), last);
}

std::array<double, max_limits> VirtualEngine::noise_free_limits(std::int64_t cycle,
                                                                std::span<const double> inputs) noexcept {
  std::array<double, max_limits> out{};
  out.fill(std::numeric_limits<double>::quiet_NaN());
  if (std::any_of(inputs.begin(), inputs.end(), [](double x) { return std::isnan(x); })) return out;
  const BenchInputs applied = applied_of(inputs);
  const Filling filling = fill(cycle, applied);
  const Burned steady = burn(filling, std::clamp(drifted_soc_cad(applied[0], cycle), closed_[0], closed_[1]));
  for (std::size_t i = 0; i < limit_members_.size() && !steady.unphysical; ++i) {
    if (limit_members_[i]) {
      out[i] = steady.indicators.*(limit_members_[i]);
    } else if (limit_readings_[i]) {
      out[i] = limit_readings_[i] == &BenchCycle::t_evo_k
                   ? steady.t_evo_k
                   : nox_of(settings_.true_nox, steady.indicators.t_max_k, filling);
    }
  }
  return out;
}

VirtualEngine::Burned VirtualEngine::burn(const Filling& filling, double soc_cad) noexcept {
  Burned out;
  model_.run(filling.charge, soc_cad, work_);
  out.unphysical = model_.first_unphysical(work_) < model_.angles_cad().size();
  if (out.unphysical) return out;
  out.indicators = model_.indicators(filling.charge, soc_cad, work_);
  if (filling.charge.fuel_heat_j != filling.injected_j)
    out.indicators.efficiency_gross = out.indicators.work_gross_j / filling.injected_j;
  out.t_evo_k = work_.pressure_pa.back() * model_.volume_m3().back() / filling.charge.gas_j_per_k;
  return out;
}

double VirtualEngine::nox_of(engine::NoxModel model, double t_max_k, const Filling& filling) const noexcept {
  if (egr_steered_) model.intake_o2_fraction = filling.intake_o2_fraction;
  return model.ppm(t_max_k);
}

// Fills every sensor with its steady value at the first request, free of scatter and noise.
void VirtualEngine::start(double soc_cad) noexcept {
  const Burned steady = burn(filling_, soc_cad);
  if (!steady.unphysical) last_t_max_k_ = steady.indicators.t_max_k;
  const double nox = nox_of(settings_.true_nox, last_t_max_k_, filling_);
  analyser_.fill(nox);
  fast_.fill(nox);
  soft_through_analyser_.fill(nox_of(settings_.soft_sensor.model, last_t_max_k_, filling_));
  if (!steady.unphysical) settings_.performance.components(signals_of(steady.indicators, nox), last_components_);
  for (std::size_t i = 0; i < component_lags_.size(); ++i)
    component_lags_[i].fill(last_components_[i]);
}

BenchCycle VirtualEngine::step(std::span<const double> inputs) noexcept {
  BenchCycle c = begin(inputs);
  Filling filling = filling_;
  filling.charge = charge_of(c);
  const Burned burned = burn(filling, c.soc_cad);
  c.indicators = burned.indicators;
  c.t_evo_k = burned.t_evo_k;
  c.unphysical = burned.unphysical;
  conclude(c);
  return c;
}

engine::Charge<double> VirtualEngine::charge_of(const BenchCycle& cycle) const noexcept {
  engine::Charge<double> charge = filling_.charge;
  if (cycle.misfire) charge.fuel_heat_j = 0.0;
  return charge;
}

BenchCycle VirtualEngine::begin(std::span<const double> inputs) noexcept {
  BenchCycle c;
  c.cycle = cycle_;
  c.soc_requested_cad = inputs[0];
  c.operating_point_changed = point_changes_at(cycle_);
  last_inputs_ = c.applied = applied_of(inputs);
  c.soc_applied_cad = c.applied[0];
  for (std::size_t i = 0; i < std::min(inputs.size(), windows_.size()); ++i)
    c.clamped = c.clamped || c.applied[i] != inputs[i];

  filling_ = fill(cycle_, c.applied);
  c.intake_o2_fraction = filling_.intake_o2_fraction;
  if (cycle_ == 0) start(c.soc_applied_cad);

  c.soc_cad = burning_soc_cad(c.soc_applied_cad, cycle_);
  c.misfire = misfires_at(cycle_);
  return c;
}

void VirtualEngine::conclude(BenchCycle& c) noexcept {
  const Prepared& at = prepared_[index_at(cycle_)];
  if (c.misfire) c.indicators.efficiency_gross = c.indicators.work_gross_j / at.charge.fuel_heat_j;
  if (settings_.efficiency_noise_percent > 0.0 && !c.misfire && !c.unphysical) {
    const double points = settings_.efficiency_noise_percent * noise(BenchStream::efficiency);
    const double work_j = points / percent * at.charge.fuel_heat_j;
    const double imep_bar = work_j / model_.geometry().swept_m3 / units::pa_per_bar;
    c.indicators.work_closed_j += work_j;
    c.indicators.work_gross_j += work_j;
    c.indicators.imep_closed_bar += imep_bar;
    c.indicators.imep_gross_bar += imep_bar;
    c.indicators.efficiency_gross += points / percent;
  }
  measure_nox(at, c);
  judge(at, c);
  measure_limits(c);
  ++cycle_;
}

void VirtualEngine::measure_nox(const Prepared& at, BenchCycle& c) noexcept {
  if (!c.unphysical) last_t_max_k_ = c.indicators.t_max_k;
  const auto read = [&](double level, double noise_fraction, BenchStream stream) {
    return noise_fraction > 0.0 ? std::max(0.0, level * (1.0 + noise_fraction * noise(stream))) : level;
  };
  c.nox_true_ppm = nox_of(settings_.true_nox, last_t_max_k_, filling_);
  c.nox_analyser_ppm = read(analyser_.step(c.nox_true_ppm, at.analyser_delay, at.analyser_gain),
                            settings_.analyser.noise_fraction, BenchStream::analyser);
  c.nox_fast_ppm = read(fast_.step(c.nox_true_ppm, at.fast_delay, at.fast_gain), settings_.fast_sensor.noise_fraction,
                        BenchStream::fast);
  c.nox_soft_ppm = nox_of(settings_.soft_sensor.model, last_t_max_k_, filling_);
  c.nox_soft_corrected_ppm = c.nox_soft_ppm * std::exp(ln_bias_);
  const double delayed = soft_through_analyser_.step(c.nox_soft_ppm, at.analyser_delay, at.analyser_gain);
  ln_bias_ = settings_.soft_sensor.next_bias(ln_bias_, c.nox_analyser_ppm, delayed);
}

void VirtualEngine::judge(const Prepared& at, BenchCycle& c) noexcept {
  const engine::Performance& performance = settings_.performance;
  const bool whole = settings_.delay_whole_objective;
  const double nox = whole ? c.nox_true_ppm : routed_ppm(settings_.nox_sensor, c);
  if (!c.unphysical) performance.components(signals_of(c.indicators, nox), last_components_);
  c.component_count = performance.size();
  for (std::size_t i = 0; i < c.component_count; ++i) {
    const double now = last_components_[i];
    c.components[i] = whole ? component_lags_[i].step(now, at.analyser_delay, at.analyser_gain) : now;
    c.j += c.components[i];
  }
}

void VirtualEngine::measure_limits(BenchCycle& c) noexcept {
  if (!c.unphysical) last_imep_bar_ = c.indicators.imep_gross_bar;
  imep_bar_[static_cast<std::size_t>(cycle_) % cov_window_cycles] = last_imep_bar_;
  c.limit_count = limit_members_.size();
  for (std::size_t i = 0; i < c.limit_count; ++i) {
    c.limit_values[i] = limit_members_[i]    ? c.indicators.*(limit_members_[i])
                        : limit_readings_[i] ? c.*(limit_readings_[i])
                                             : cov_imep_percent();
  }
}

// Two passes over the window: a running sum would drift and depend on where a run was cut.
double VirtualEngine::cov_imep_percent() const noexcept {
  const std::size_t n = std::min(static_cast<std::size_t>(cycle_) + 1, cov_window_cycles);
  if (n < 2) return 0.0;
  double mean = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    mean += imep_bar_[i] / static_cast<double>(n);
  for (std::size_t i = 0; i < n; ++i)
    squares += (imep_bar_[i] - mean) * (imep_bar_[i] - mean);
  return percent * std::sqrt(squares / static_cast<double>(n - 1)) / std::abs(mean);
}

}  // namespace mgdd::loop
