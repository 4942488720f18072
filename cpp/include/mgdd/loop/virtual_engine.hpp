// A virtual engine test bench: SOC and further inputs in, what a real bench would measure of that cycle out. The plant
// is the cycle model with scatter, misfire, drift and a schedule of operating points; its sensors are a NOx analyser, a
// fast NOx sensor, a soft sensor and a pressure sensor. Angles in °CA aTDC, NOx in ppm. `step` is noexcept and
// allocation-free. All randomness is a function of (seed, stream, cycle): the same seed gives the same run however it
// is cut.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/emissions.hpp"
#include "mgdd/engine/performance.hpp"
#include "mgdd/loop/pressure_sensor.hpp"
#include "mgdd/loop/transport_lag.hpp"

namespace mgdd::loop {

/// Which NOx value enters the performance.
enum class NoxSensor { none, analyser, fast, soft, soft_corrected, true_value };

/// What can be steered. `egr` is the recirculated share of the charge's mass, cooled to the intake temperature.
enum class BenchInput { soc_cad, intake_pressure_kpa, burn_duration_cad, second_fraction, egr };
inline constexpr std::size_t max_bench_inputs = names<BenchInput>().size();
using BenchInputs = std::array<double, max_bench_inputs>;  ///< in the order of BenchSettings::inputs

/// Streams of the random numbers that the bench draws; others are free for seekers and studies.
enum class BenchStream : std::uint64_t { soc = 0, efficiency = 1, misfire = 2, analyser = 3, fast = 4, pressure = 5 };
inline constexpr std::uint64_t first_free_stream = 16;

/// From cycle `cycle` on the engine runs at `point`.
struct ScheduledPoint {
  std::int64_t cycle = 0;
  engine::OperatingPoint point{};

  bool operator==(const ScheduledPoint&) const = default;
};

inline constexpr std::size_t max_limits = 8;
inline constexpr std::string_view cov_imep_name = "cov_imep_percent";
inline constexpr std::size_t cov_window_cycles = 50;

struct BenchSettings {
  engine::Cylinder cylinder{};
  /// First at cycle 0, cycles increasing, fuel > 0.
  std::vector<ScheduledPoint> schedule = std::vector<ScheduledPoint>(1);
  double step_cad = engine::default_step_cad;
  engine::Integrator integrator = engine::Integrator::trapezoid;

  double soc_scatter_cad = 0.3;             ///< standard deviation of SOC from cycle to cycle, in [0, 5]
  double efficiency_noise_percent = 0.25;   ///< standard deviation of efficiency in points, with the work and IMEP that
                                            ///< belong to it; in [0, 20]
  double misfire_probability = 0.0;         ///< [-] per cycle
  double soc_drift_cad_per_kcycle = 0.0;    ///< offset of SOC, per 1000 cycles, in [-100, 100]
  double wall_heat_drift_per_kcycle = 0.0;  ///< [-] change of wall_heat_scale per 1000 cycles, in [-100, 100]

  PressureSensorSettings pressure{};

  std::vector<BenchInput> inputs =
      std::vector(1, BenchInput::soc_cad);  ///< what is steered, SOC first; the rest is the point's

  engine::NoxModel true_nox{.map = engine::NoxMap::arrhenius};
  engine::SoftSensor soft_sensor{};
  SensorDynamics analyser{.delay_s = 3.0, .lag_s = 2.0, .noise_fraction = 0.01};
  SensorDynamics fast_sensor{.delay_s = 0.05, .lag_s = 0.05, .noise_fraction = 0.03};  ///< ours: of an in-stack sensor

  engine::Performance performance{};
  NoxSensor nox_sensor = NoxSensor::soft;
  bool delay_whole_objective = false;  ///< every component passes the analyser's delay and lag, NOx being the true one
  std::vector<std::string> limits{};   ///< at most 8 names of indicators, of `bench_limits`, or cov_imep_percent
  std::uint64_t seed = 0;
};
constexpr auto fields_of(const BenchSettings&) {
  using S = BenchSettings;
  using P = PressureSensorSettings;
  return std::tuple{
      field<&S::cylinder>("cylinder", "the engine", DefaultForm::required),
      field<&S::schedule>("schedule", "first cycle of each operating point", DefaultForm::required),
      field<&S::performance>("performance", "what is to be maximised: gross efficiency in percent", DefaultForm::none),
      field<&S::nox_sensor>("nox_sensor", "whose NOx enters the performance"),
      field<&S::limits>("limits", "indicators to report as limits"),
      field<&S::inputs>("inputs", "what is steered, soc_cad first; whatever is not named stays as the point has it"),
      field<&S::soc_scatter_cad>(
          {"soc_scatter_cad", "°CA", closed(0.0, 5.0), "standard deviation of SOC from cycle to cycle"}),
      field<&S::efficiency_noise_percent>(
          {"efficiency_noise_percent", "%", closed(0.0, 20.0),
           "standard deviation of the measured efficiency in points, with the work and IMEP that belong to it"}),
      field<&S::misfire_probability>(
          {"misfire_probability", "-", closed(0.0, 1.0), "misfires per cycle, drawn at random"}),
      field<&S::soc_drift_cad_per_kcycle>(
          {"soc_drift_cad_per_kcycle", "°CA", closed(-100.0, 100.0), "offset of SOC per 1000 cycles"}),
      field<&S::wall_heat_drift_per_kcycle>(
          {"wall_heat_drift_per_kcycle", "-", closed(-100.0, 100.0), "change of wall_heat_scale per 1000 cycles"}),
      field<&S::pressure, &P::noise_bar>(
          {"pressure_noise_bar", "bar", closed(0.0, 20.0),
           "noise of each sample of the pressure trace, standard deviation; indicators have none of it"}),
      field<&S::pressure, &P::tdc_error_cad>(
          {"tdc_error_cad", "°CA", closed(-5.0, 5.0), "angles of the pressure trace read that much high"}),
      field<&S::pressure, &P::gain_error>(
          {"pressure_gain_error", "-", closed(-0.5, 0.5), "share by which the pressure trace reads high"}),
      field<&S::pressure, &P::offset_bar>(
          {"pressure_offset_bar", "bar", closed(-5.0, 5.0), "by which the pressure trace is pegged too high"}),
      field<&S::pressure, &P::drift_bar_per_kcycle>({"pressure_drift_bar_per_kcycle", "bar", closed(-100.0, 100.0),
                                                     "change of pressure_offset_bar per 1000 cycles"}),
      field<&S::true_nox>("true_nox", "NOx of the plant from its own maximum gas temperature: an Arrhenius map",
                          DefaultForm::none),
      field<&S::soft_sensor>("soft_sensor", "the soft sensor: an affine-log map of the same constants",
                             DefaultForm::none),
      field<&S::analyser>("analyser", "NOx analyser: 3 s late, lag 2 s, noise 1 %", DefaultForm::none),
      field<&S::fast_sensor>("fast_sensor", "fast NOx sensor: 0.05 s late, lag 0.05 s, noise 3 %", DefaultForm::none),
      field<&S::delay_whole_objective>(
          "delay_whole_objective",
          "every component passes the delay and lag of the analyser, without its noise; NOx is the true one"),
      field<&S::step_cad>({"step_cad", "°CA", {}, "step of the cycle model, as in mgdd.engine.simulate"}),
      field<&S::integrator>("integrator", "of the cycle model, as in mgdd.engine.simulate"),
      field<&S::seed>("seed", "of all noise"),
  };
}

/// ParameterError names field, value and bound.
void validate(const BenchSettings& settings);

/// Earliest and latest SOC whose burn starts between IVC and EVO [°CA aTDC].
std::array<double, 2> closed_part(const engine::Cylinder& cylinder) noexcept;

/// Earliest and latest SOC that a bench takes: [-60, 20] °CA aTDC as far as the valves are closed.
std::array<double, 2> timing_window(const engine::Cylinder& cylinder) noexcept;

/// Range that a bench takes of an input: `timing_window` of the timing, fixed for the others.
std::array<double, 2> window_of(BenchInput input, const engine::Cylinder& cylinder) noexcept;

/// One measured cycle.
struct BenchCycle {
  std::int64_t cycle = 0;
  double soc_requested_cad = 0.0;
  double soc_applied_cad = 0.0;             ///< request as far as the timing window takes it
  double soc_cad = 0.0;                     ///< of the burn: request, clamped, with drift and scatter
  engine::Indicators<double> indicators{};  ///< efficiency, work and IMEP with their noise
  bool misfire = false;                     ///< nothing burned: indicators of the motored cycle, efficiency of the
                                            ///< fuel that was injected
  BenchInputs applied{};                    ///< every request as far as its window takes it
  bool clamped = false;                     ///< a request lay outside its window
  bool unphysical = false;                  ///< no such cycle exists: indicators are NaN, J is that of the last one
  bool operating_point_changed = false;     ///< speed or fuel moved by more than 5 % from the cycle before
  double nox_true_ppm = 0.0;
  double nox_analyser_ppm = 0.0;
  double nox_fast_ppm = 0.0;
  double nox_soft_ppm = 0.0;
  double nox_soft_corrected_ppm = 0.0;
  double intake_o2_fraction = engine::air_o2_fraction;    ///< where EGR is steered
  double t_evo_k = engine::Indicators<double>{}.t_max_k;  ///< gas at EVO, as it begins to leave; NaN in SIMD lanes
  std::array<double, engine::Performance::max_terms> components{};
  std::size_t component_count = 0;
  double j = 0.0;                                 ///< sum of the components
  std::array<double, max_limits> limit_values{};  ///< in the order of BenchSettings::limits
  std::size_t limit_count = 0;

  std::span<const double> component_values() const noexcept { return {components.data(), component_count}; }
  std::span<const double> limits() const noexcept { return {limit_values.data(), limit_count}; }
};

/// What can be limited besides indicators.
struct BenchLimit {
  std::string_view name;
  double BenchCycle::* member;
};
inline constexpr std::array<BenchLimit, 6> bench_limits{{
    {"t_evo_k", &BenchCycle::t_evo_k},
    {"nox_true_ppm", &BenchCycle::nox_true_ppm},
    {"nox_analyser_ppm", &BenchCycle::nox_analyser_ppm},
    {"nox_fast_ppm", &BenchCycle::nox_fast_ppm},
    {"nox_soft_ppm", &BenchCycle::nox_soft_ppm},
    {"nox_soft_corrected_ppm", &BenchCycle::nox_soft_corrected_ppm},
}};

class VirtualEngine {
 public:
  /// ParameterError by `validate`; ConvergenceError if a scheduled point has no physical cycle.
  explicit VirtualEngine(const BenchSettings& settings);

  /// Runs one cycle. Requests stand in the order of `BenchSettings::inputs` and are clamped to `windows`; NaN and what
  /// is left out repeat the last one, at first the value of the operating point. Before the first cycle every sensor
  /// stands at its steady value for the first request.
  BenchCycle step(std::span<const double> inputs) noexcept;
  BenchCycle step(double soc_cad) noexcept { return step({&soc_cad, 1}); }

  /// The halves of `step` for who runs the cycle elsewhere, as `VirtualEngineLanes` does: what burns, its charge, and
  /// what is measured of it. Once for each cycle and in this order; between them `indicators` and `unphysical` are
  /// filled in.
  BenchCycle begin(std::span<const double> inputs) noexcept;
  engine::Charge<double> charge_of(const BenchCycle& cycle) const noexcept;  ///< no fuel in a misfire
  void conclude(BenchCycle& cycle) noexcept;

  /// Limited quantities of a cycle at that request without scatter, noise and misfire, drift included: in the order of
  /// BenchSettings::limits, the true steady NOx for every sensor. NaN for the COV of IMEP, for NaN requests and where
  /// no such cycle exists. Nothing moves.
  std::array<double, max_limits> noise_free_limits(std::int64_t cycle, std::span<const double> inputs) noexcept;
  std::array<double, max_limits> noise_free_limits(std::int64_t cycle, double soc_cad) noexcept {
    return noise_free_limits(cycle, {&soc_cad, 1});
  }

  /// What the pressure sensor read of the last cycle, by the crank grid of the cylinder; empty before the first one.
  /// The trace stands until the next call. Indicators of a cycle are those of the true pressure.
  PressureTrace pressure() noexcept;

  /// Back to cycle 0, with another seed.
  void reset(std::uint64_t seed) noexcept;
  void reset() noexcept { reset(seed_); }

  /// Everything a run depends on besides the settings, for `save_state` and `restore_state`: bit for bit.
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("cycle", self.cycle_, counts_end);
    v("seed", self.seed_);
    for (std::size_t i = 0; i < self.settings_.inputs.size(); ++i)
      v("last_" + std::string(name_of(self.settings_.inputs[i])), self.last_inputs_[i]);
    v("last_t_max_k", self.last_t_max_k_);
    v("last_imep_bar", self.last_imep_bar_);
    v("ln_bias", self.ln_bias_);
    v("last_components", self.last_components_);
    v("imep_gross_bar", self.imep_bar_);
    TransportLag::visit(self.analyser_, v, "analyser");
    TransportLag::visit(self.fast_, v, "fast");
    TransportLag::visit(self.soft_through_analyser_, v, "soft_through_analyser");
    for (std::size_t i = 0; i < self.component_lags_.size(); ++i)
      TransportLag::visit(self.component_lags_[i], v, "component" + std::to_string(i));
  }

  const BenchSettings& settings() const noexcept { return settings_; }
  /// Cylinder as it has drifted so far, and what follows from it.
  const engine::CycleModel<double>& model() const noexcept { return model_; }
  std::int64_t cycle() const noexcept { return cycle_; }  ///< index of the next cycle
  std::uint64_t seed() const noexcept { return seed_; }
  /// Operating point of the next cycle, and of any other.
  const engine::OperatingPoint& point() const noexcept { return point_at(cycle_); }
  const engine::OperatingPoint& point_at(std::int64_t cycle) const noexcept;
  /// Speed or fuel of that cycle differ by more than 5 % from the cycle before.
  bool point_changes_at(std::int64_t cycle) const noexcept;
  /// Earliest and latest SOC that is not clamped [°CA aTDC].
  std::array<double, 2> window_cad() const noexcept { return window_; }
  /// Least and greatest value that is not clamped, of each input.
  const std::vector<std::array<double, 2>>& windows() const noexcept { return windows_; }
  /// D and g of the analyser at the next cycle.
  std::size_t analyser_delay_cycles() const noexcept;
  double analyser_gain() const noexcept;

 private:
  /// What an operating point fixes: computed once.
  struct Prepared {
    engine::Charge<double> charge;
    std::size_t analyser_delay = 0, fast_delay = 0;
    double analyser_gain = 1.0, fast_gain = 1.0;
  };
  /// What stands in the cylinder before a cycle.
  struct Filling {
    engine::Charge<double> charge{};
    double intake_o2_fraction = engine::air_o2_fraction;
    double injected_j = 0.0;  ///< heat of the fuel, of which the charge may burn less
  };
  /// What was measured without sensors of NOx.
  struct Burned {
    engine::Indicators<double> indicators{};
    double t_evo_k = engine::Indicators<double>{}.t_max_k;
    bool unphysical = true;
  };
  std::size_t index_at(std::int64_t cycle) const noexcept;
  engine::Cylinder drifted_cylinder(std::int64_t cycle) const noexcept;
  BenchInputs applied_of(std::span<const double> inputs) const noexcept;
  Filling fill(std::int64_t cycle, const BenchInputs& inputs) noexcept;
  Burned burn(const Filling& filling, double soc_cad) noexcept;
  double nox_of(engine::NoxModel model, double t_max_k, const Filling& filling) const noexcept;
  void start(double soc_cad) noexcept;
  void measure_nox(const Prepared& at, BenchCycle& c) noexcept;
  void judge(const Prepared& at, BenchCycle& c) noexcept;
  void measure_limits(BenchCycle& c) noexcept;
  double cov_imep_percent() const noexcept;
  double drifted_soc_cad(double soc_cad, std::int64_t cycle) const noexcept;
  double burning_soc_cad(double soc_cad, std::int64_t cycle) const noexcept;
  bool misfires_at(std::int64_t cycle) const noexcept;
  double noise(BenchStream stream) const noexcept { return noise_at(stream, cycle_); }
  double noise_at(BenchStream stream, std::int64_t cycle) const noexcept;

  BenchSettings settings_;
  engine::CycleModel<double> model_;
  engine::CycleWorkspace<double> work_;
  PressureSensor pressure_sensor_;
  std::vector<Prepared> prepared_;
  std::vector<double engine::Indicators<double>::*> limit_members_;  // null for what follows
  std::vector<double BenchCycle::*> limit_readings_;                 // null for indicators and the COV of IMEP
  std::array<double, 2> closed_, window_;
  std::vector<std::array<double, 2>> windows_;
  bool egr_steered_ = false, model_moves_ = false;

  std::uint64_t seed_ = 0;
  std::int64_t cycle_ = 0;
  BenchInputs last_inputs_{};
  Filling filling_{};  // of the cycle that runs
  double last_t_max_k_ = 0.0;
  double last_imep_bar_ = 0.0;
  double ln_bias_ = 0.0;
  std::array<double, engine::Performance::max_terms> last_components_{};
  TransportLag analyser_, fast_, soft_through_analyser_;
  std::vector<TransportLag> component_lags_;
  std::array<double, cov_window_cycles> imep_bar_{};
};

}  // namespace mgdd::loop
