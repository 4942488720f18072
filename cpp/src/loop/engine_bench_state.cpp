// Saving and restoring a bench between two cycles.
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/loop/engine_bench.hpp"

namespace mgdd::loop {
namespace {

constexpr double half_word = 4294967296.0;         // 2^32: a double holds each half of the seed exactly
constexpr double last_cycle = 9007199254740992.0;  // 2^53

const std::vector<double>& column(const StateColumns& state, const std::string& name, std::size_t size) {
  const auto found = state.find(name);
  if (found == state.end()) throw DataError("state has no column '" + name + "': it is of another bench");
  if (found->second.size() != size) {
    throw DataError("state column '" + name + "' has " + std::to_string(found->second.size()) + " entries: must be " +
                    std::to_string(size));
  }
  const auto bad = std::ranges::find_if_not(found->second, [](double x) { return std::isfinite(x); });
  if (bad != found->second.end()) {
    throw DataError("state column '" + name + "', entry " + std::to_string(bad - found->second.begin()) + ", holds " +
                    text(*bad) + ": must be finite, a run would not survive it");
  }
  return found->second;
}

double whole_number(const std::vector<double>& from, std::size_t at, const char* name, double below) {
  const double x = from[at];
  if (x >= 0.0 && x < below && x == std::floor(x)) return x;
  throw DataError("state column '" + std::string(name) + "' holds " + text(x) + ": must be a whole number >= 0");
}

}  // namespace

StateColumns EngineBench::state() const {
  StateColumns columns{{"cycle", {static_cast<double>(cycle_)}},
                       {"seed", {static_cast<double>(seed_ >> 32), static_cast<double>(seed_ & 0xFFFFFFFFu)}},
                       {"last", {last_soc_cad_, last_t_max_k_, last_imep_bar_, ln_bias_}},
                       {"last_components", {last_components_.begin(), last_components_.end()}},
                       {"imep_gross_bar", {imep_bar_.begin(), imep_bar_.end()}},
                       {"analyser", analyser_.save()},
                       {"fast", fast_.save()},
                       {"soft_through_analyser", soft_through_analyser_.save()}};
  for (std::size_t i = 0; i < component_lags_.size(); ++i)
    columns["component_" + std::to_string(i)] = component_lags_[i].save();
  return columns;
}

void EngineBench::restore(const StateColumns& state) {
  EngineBench next = *this;  // so that a refused state changes nothing
  next.cycle_ = static_cast<std::int64_t>(whole_number(column(state, "cycle", 1), 0, "cycle", last_cycle));
  const std::vector<double>& seed = column(state, "seed", 2);
  next.seed_ = static_cast<std::uint64_t>(whole_number(seed, 0, "seed", half_word)) << 32 |
               static_cast<std::uint64_t>(whole_number(seed, 1, "seed", half_word));
  const std::vector<double>& last = column(state, "last", 4);
  next.last_soc_cad_ = last[0];
  next.last_t_max_k_ = last[1];
  next.last_imep_bar_ = last[2];
  next.ln_bias_ = last[3];
  const auto& components = column(state, "last_components", last_components_.size());
  std::copy(components.begin(), components.end(), next.last_components_.begin());
  const auto& imep = column(state, "imep_gross_bar", imep_bar_.size());
  std::copy(imep.begin(), imep.end(), next.imep_bar_.begin());
  next.analyser_.restore(column(state, "analyser", analyser_.state_size()));
  next.fast_.restore(column(state, "fast", fast_.state_size()));
  next.soft_through_analyser_.restore(column(state, "soft_through_analyser", soft_through_analyser_.state_size()));
  for (std::size_t i = 0; i < component_lags_.size(); ++i)
    next.component_lags_[i].restore(column(state, "component_" + std::to_string(i), component_lags_[i].state_size()));
  const std::size_t expected = this->state().size();
  if (state.size() != expected) {
    throw DataError("state has " + std::to_string(state.size()) + " columns: must be " + std::to_string(expected) +
                    ", it is of another bench");
  }
  *this = std::move(next);
}

}  // namespace mgdd::loop
