#include "mgdd/loop/engine_loop.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"

namespace mgdd::loop {
namespace {

constexpr std::int64_t longest_settling = 1000;  // cycles that do not count for the limits unless the caller says so

void require_same_limits(const std::string& plant, const std::vector<std::string>& measured,
                         const std::vector<optimize::Limit>& limits) {
  std::vector<std::string> names;
  for (const optimize::Limit& limit : limits)
    names.push_back(limit.name);
  if (names == measured) return;
  const auto list = [](const std::vector<std::string>& all) {
    std::string out = "[";
    for (const std::string& name : all)
      out += (out.size() > 1 ? ", " : "") + name;
    return out + "]";
  };
  throw ParameterError("limits of the seeker " + list(names) + " and of the " + plant + " " + list(measured) +
                       " differ: name the same ones in the same order");
}

}  // namespace

void require_match(const VirtualEngine& bench, const optimize::Inputs& estimate, std::size_t components,
                   const std::vector<optimize::Limit>& limits) {
  const std::vector<BenchInput>& inputs = bench.settings().inputs;
  if (static_cast<std::size_t>(estimate.size()) != inputs.size()) {
    std::string taken = inputs.size() == 1 ? "one input, " : std::to_string(inputs.size()) + " inputs, ";
    for (std::size_t i = 0; i < inputs.size(); ++i)
      taken.append(i > 0 ? ", " : "").append(name_of(inputs[i]));
    throw about("start",
                ParameterError("start has " + std::to_string(estimate.size()) + " entries: the bench takes " + taken));
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    const auto [least, greatest] = bench.windows()[i];
    const auto at = static_cast<Eigen::Index>(i);
    if (i == 0) {
      require_within("estimate of the seeker", estimate[at], least, greatest, "°CA aTDC");
    } else {
      require_within(std::string(name_of(inputs[i])) + " of the seeker", estimate[at], least, greatest);
    }
  }
  const std::size_t terms = bench.settings().performance.size();
  if (components != 1 && components != terms) {
    throw about("components", ParameterError("components has " + std::to_string(components) +
                                             " entries: the performance of the bench has " + std::to_string(terms) +
                                             " terms; give as many, or one for their sum"));
  }
  require_same_limits("bench", bench.settings().limits, limits);
}

void require_match(const FunctionPlant& plant, const optimize::Inputs& estimate, std::size_t components,
                   const std::vector<optimize::Limit>& limits) {
  const std::size_t inputs = plant.settings().inputs;
  if (static_cast<std::size_t>(estimate.size()) != inputs) {
    throw about("start", ParameterError("start has " + std::to_string(estimate.size()) + " entries: the plant takes " +
                                        std::to_string(inputs)));
  }
  if (components != 1) {
    throw about("components", ParameterError("components has " + std::to_string(components) +
                                             " entries: the plant measures 1; give as many, or one for their sum"));
  }
  require_same_limits("plant", plant.settings().limits, limits);
}

std::int64_t counted_from(const LoopCriteria& criteria, std::int64_t cycles) noexcept {
  return criteria.exceed_from.value_or(std::min(longest_settling, cycles / 2));
}

void validate(const LoopCriteria& c, std::int64_t cycles) {
  require_positive("arrival_cad", c.arrival_cad);
  if (c.tail_cycles < 1) throw ParameterError("tail_cycles", c.tail_cycles, "must be >= 1");
  if (c.exceed_from && *c.exceed_from < 0) throw ParameterError("exceed_from", *c.exceed_from, "must be >= 0");
  if (c.exceed_from && *c.exceed_from >= cycles && !c.exceed_above.empty()) {
    throw ParameterError("exceed_from", *c.exceed_from,
                         "must be < cycles = " + std::to_string(cycles) + ", or no cycle counts");
  }
  for (const auto& [name, values] : {std::pair{"exceed_above", &c.exceed_above}, std::pair{"limits", &c.limits}}) {
    for (const double value : *values) {
      if (std::isnan(value))
        throw about(name, ParameterError(std::string(name) + " holds NaN: give a number, or leave the limit out"));
    }
  }
}

void LimitFigures::add(double reading, std::int64_t cycle, bool judged) noexcept {
  if (std::isnan(reading)) return;
  ++read_cycles;
  if (judged) ++judged_read_cycles;
  if (!(reading <= worst)) {
    worst = reading;
    worst_cycle = static_cast<double>(cycle);
  }
  if (reading <= limit) return;
  ++above_cycles;
  if (judged) ++judged_above_cycles;
}

LoopStatistics::LoopStatistics(LoopCriteria criteria, std::int64_t cycles)
    : criteria_(std::move(criteria)), planned_(cycles), counted_from_(loop::counted_from(criteria_, cycles)) {
  for (std::size_t i = 0; i < std::min(limits_.size(), criteria_.limits.size()); ++i)
    limits_[i].limit = criteria_.limits[i];
}

void LoopStatistics::add(const LoopCycle& cycle) noexcept {
  const std::int64_t k = seen_++;
  const double estimate = cycle.estimate_cad;
  const BenchCycle& b = cycle.bench;
  lowest_ = std::min(lowest_, estimate);
  highest_ = std::max(highest_, estimate);
  if (b.misfire) ++misfires_;
  if (std::abs(estimate - criteria_.optimum_cad) <= criteria_.arrival_cad) {
    if (first_arrival_ < 0) first_arrival_ = k;
  } else {
    last_away_ = k;
  }
  if (k >= planned_ - criteria_.tail_cycles) tail_.add(estimate);
  if (k >= planned_ / 2) {
    half_.add(estimate);
    square_.add((estimate - criteria_.optimum_cad) * (estimate - criteria_.optimum_cad));
    applied_.add(b.soc_applied_cad);
    if (!b.misfire && !b.unphysical) {
      j_.add(b.j);
      efficiency_.add(100.0 * b.indicators.efficiency_gross);
      nox_.add(b.nox_true_ppm);
    }
  }
  for (std::size_t i = 0; i < std::min(b.limit_count, criteria_.limits.size()); ++i)
    limits_[i].add(b.limit_values[i], k, k >= counted_from_);
  if (k >= counted_from_ && !criteria_.exceed_above.empty()) {
    ++counted_;
    bool over = false;
    for (std::size_t i = 0; i < std::min(b.limit_count, criteria_.exceed_above.size()); ++i)
      over = over || b.limit_values[i] > criteria_.exceed_above[i];
    if (over) ++exceeded_;
  }
}

LoopSummary LoopStatistics::summary() const noexcept {
  LoopSummary out;
  out.cycles = seen_;
  out.final_cad = tail_.value();
  out.mean_cad = half_.value();
  out.mean_applied_cad = applied_.value();
  out.mean_j = j_.value();
  out.mean_efficiency_percent = efficiency_.value();
  out.mean_nox_ppm = nox_.value();
  out.lowest_cad = lowest_;
  out.highest_cad = highest_;
  out.misfires = misfires_;
  out.judged_from = counted_from_;
  out.limits = limits_;
  if (counted_ > 0) out.exceeded_fraction = static_cast<double>(exceeded_) / static_cast<double>(counted_);
  if (!std::isfinite(criteria_.optimum_cad)) return out;
  out.rms_cad = std::sqrt(square_.value());
  if (first_arrival_ >= 0) out.cycles_to = static_cast<double>(first_arrival_);
  if (last_away_ + 1 < seen_) out.cycles_stays = static_cast<double>(last_away_ + 1);
  return out;
}

}  // namespace mgdd::loop
