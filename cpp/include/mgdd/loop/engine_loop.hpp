// The closed loop: a seeker on the virtual bench or a function, one ask, one cycle, one tell; what such a run comes to.
// `loop_step` and `LoopStatistics::add` are noexcept and allocation-free. The same seeker driven from Python one
// ask/tell at a time goes the same way, bit for bit. Angles in °CA aTDC.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "mgdd/guide/curve_seeking.hpp"
#include "mgdd/loop/function_plant.hpp"
#include "mgdd/loop/virtual_engine.hpp"
#include "mgdd/optimize/ask_tell/seekers.hpp"

namespace mgdd::loop {

/// Every seeker that a loop of the core steers.
using Seeker = std::variant<optimize::ExtremumSeeking, optimize::Spsa, optimize::GradientDescent,
                            optimize::GoldenSection, optimize::GaussianProcessSeeking, guide::CurveSeeking>;

/// One cycle of a run: what the bench gave, and the estimate that stood before it.
struct LoopCycle {
  BenchCycle bench{};
  double estimate_cad = 0.0;
};

/// ParameterError unless the seeker has the inputs of the bench, each in its window, as many components as the bench's
/// performance (or one, for their sum) and the bench's limits in the same order.
void require_match(const VirtualEngine& bench, const optimize::Inputs& estimate, std::size_t components,
                   const std::vector<optimize::Limit>& limits);
void require_match(const FunctionPlant& plant, const optimize::Inputs& estimate, std::size_t components,
                   const std::vector<optimize::Limit>& limits);

template <class Plant, optimize::AnySeeker S>
void require_match(const Plant& plant, const S& seeker) {
  require_match(plant, seeker.estimate(), seeker.component_count(), seeker.settings().limits);
}

/// What the seeker asks of the next cycle of a plant, valid until it is told. First it hears of the operating point
/// where the plant has one: a seeker with a guide in every cycle, any other is restarted by a new one.
template <class Plant, class S>
std::span<const double> ask(const Plant& plant, S& seeker, double& estimate_cad) noexcept {
  if constexpr (requires { seeker.at_cycle(plant.cycle()); }) {
    seeker.at_cycle(plant.cycle());
  } else if constexpr (requires { seeker.at(plant.point()); }) {
    seeker.at(plant.point());
  } else if constexpr (requires { plant.point_changes_at(plant.cycle()); }) {
    if (plant.point_changes_at(plant.cycle())) seeker.restart();
  }
  estimate_cad = seeker.estimate()[0];
  const optimize::Inputs& asked = seeker.ask();
  return {asked.data(), static_cast<std::size_t>(asked.size())};
}

/// What the plant gave: of a bench also what it applied, and the pressure for a seeker that calibrates its model.
/// Noexcept as the seeker's `tell` is.
template <class Plant, class S>
void tell(Plant& plant, const BenchCycle& c, S& seeker) noexcept(noexcept(seeker.tell(optimize::Reading{}))) {
  const bool summed = seeker.component_count() == 1;
  const std::span<const double> components = summed ? std::span<const double>(&c.j, 1) : c.component_values();
  const std::size_t applied =
      std::is_same_v<Plant, VirtualEngine> ? static_cast<std::size_t>(seeker.estimate().size()) : 0;
  const optimize::Reading reading{components, c.limits(), c.misfire || c.unphysical, {c.applied.data(), applied}};
  if constexpr (requires { seeker.tell(reading, plant.pressure().pressure_bar); }) {
    seeker.tell(reading, seeker.calibration() ? plant.pressure().pressure_bar : std::span<const double>());
  } else {
    seeker.tell(reading);
  }
}

/// One cycle. Noexcept as the seeker's `tell` is.
template <class Plant, class S>
LoopCycle loop_step(Plant& plant, S& seeker) noexcept(noexcept(tell(plant, BenchCycle{}, seeker))) {
  LoopCycle out;
  out.bench = plant.step(ask(plant, seeker, out.estimate_cad));
  tell(plant, out.bench, seeker);
  return out;
}

/// What to look for in a run.
struct LoopCriteria {
  double optimum_cad = std::numeric_limits<double>::quiet_NaN();  ///< NaN: cycles and rms are not judged
  double arrival_cad = 1.0;                                       ///< |estimate - optimum| that counts as arrived
  std::int64_t tail_cycles = 100;                                 ///< behind `final_cad`
  std::optional<std::int64_t> exceed_from{};  ///< first cycle that counts for the limits; none: see `counted_from`
  std::vector<double> exceed_above{};         ///< per limit of the bench: values above count; empty: not judged
  std::vector<double> limits{};  ///< per limit of the bench: what `LoopSummary::limits` are of; infinite: of no limit;
                                 ///< empty: those of the seeker
};

/// First cycle of a run of that length that counts for the limits: `exceed_from`, or 1000, or the middle of a run that
/// is shorter than 2000 cycles.
std::int64_t counted_from(const LoopCriteria& criteria, std::int64_t cycles) noexcept;

/// One limit over a run, as measured: above is above the limit itself, and every cycle counts that has a reading.
/// Cycles are counted from the first of the run; "judged" are those from `counted_from` on.
struct LimitFigures {
  double limit = std::numeric_limits<double>::quiet_NaN();
  double worst = std::numeric_limits<double>::quiet_NaN();        ///< largest reading
  double worst_cycle = std::numeric_limits<double>::quiet_NaN();  ///< first cycle with it
  std::int64_t read_cycles = 0;
  std::int64_t above_cycles = 0;
  std::int64_t judged_read_cycles = 0;
  std::int64_t judged_above_cycles = 0;

  void add(double reading, std::int64_t cycle, bool judged) noexcept;
};

/// What a run came to. "Second half" is from cycle n/2 on.
struct LoopSummary {
  std::int64_t cycles = 0;
  std::int64_t judged_from = 0;                                         ///< first cycle that counts as judged
  std::array<LimitFigures, max_limits> limits{};                        ///< in the order of the bench
  double final_cad = std::numeric_limits<double>::quiet_NaN();          ///< mean estimate of the last cycles
  double mean_cad = std::numeric_limits<double>::quiet_NaN();           ///< mean estimate, second half
  double rms_cad = std::numeric_limits<double>::quiet_NaN();            ///< about the optimum, second half
  double cycles_to = std::numeric_limits<double>::quiet_NaN();          ///< first estimate that has arrived; NaN: never
  double cycles_stays = std::numeric_limits<double>::quiet_NaN();       ///< from here on it never leaves again
  double exceeded_fraction = std::numeric_limits<double>::quiet_NaN();  ///< of cycles from `counted_from` on; NaN: no
                                                                        ///< threshold, or the run ended before
  double mean_applied_cad = std::numeric_limits<double>::quiet_NaN();   ///< second half
  double mean_j = std::numeric_limits<double>::quiet_NaN();             ///< second half, fired cycles
  double mean_efficiency_percent = std::numeric_limits<double>::quiet_NaN();
  double mean_nox_ppm = std::numeric_limits<double>::quiet_NaN();  ///< true NOx, second half, fired cycles
  double lowest_cad = std::numeric_limits<double>::infinity();     ///< of the estimate
  double highest_cad = -std::numeric_limits<double>::infinity();
  std::int64_t misfires = 0;
};

/// ParameterError naming field, value and bound; also where no cycle of such a run would count for the limits.
void validate(const LoopCriteria& criteria, std::int64_t cycles);

/// The criteria with the limits of the seeker, where they name none.
template <optimize::AnySeeker S>
LoopCriteria with_limits_of(LoopCriteria criteria, const S& seeker) {
  if (criteria.limits.empty()) {
    for (const optimize::Limit& limit : seeker.settings().limits)
      criteria.limits.push_back(limit.upper);
  }
  return criteria;
}

class LoopStatistics {
 public:
  /// `cycles` is the planned length of the run.
  LoopStatistics(LoopCriteria criteria, std::int64_t cycles);

  void add(const LoopCycle& cycle) noexcept;
  /// Of the cycles added so far.
  LoopSummary summary() const noexcept;

 private:
  struct Mean {
    double sum = 0.0;
    std::int64_t count = 0;
    void add(double x) noexcept {
      sum += x;
      ++count;
    }
    double value() const noexcept {
      return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
    }
  };

  LoopCriteria criteria_;
  std::int64_t planned_, counted_from_;
  std::int64_t seen_ = 0, counted_ = 0, exceeded_ = 0;
  std::int64_t first_arrival_ = -1, last_away_ = -1;
  Mean tail_, half_, square_, applied_, j_, efficiency_, nox_;
  double lowest_ = std::numeric_limits<double>::infinity(), highest_ = -std::numeric_limits<double>::infinity();
  std::int64_t misfires_ = 0;
  std::array<LimitFigures, max_limits> limits_{};
};

}  // namespace mgdd::loop
