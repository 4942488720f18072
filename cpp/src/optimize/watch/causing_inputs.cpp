#include "mgdd/optimize/watch/causing_inputs.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {

namespace {

constexpr double error_memory = 200.0;  // readings behind the comparison of delays
constexpr double fewest_readings = 6.0;
constexpr double evidence = 8.0;    // natural logarithm of the likelihood ratio that moves a delay
constexpr double no_error = 1e-18;  // of a squared reading: errors below are none

}  // namespace

CausingInputs::CausingInputs(const std::vector<UncertainLag>& lags, Eigen::Index inputs) : inputs_(inputs) {
  for (const UncertainLag& uncertain : lags) {
    Source source{static_cast<std::int64_t>(paths_.size()), 0, 0};
    for (int off = -uncertain.delay_uncertainty; off <= uncertain.delay_uncertainty; ++off) {
      const ComponentLag lag{uncertain.lag.delay_cycles + off, uncertain.lag.lag_cycles};
      if (lag.delay_cycles < 0.0) continue;
      if (off == 0) source.taken = source.count;
      ++source.count;
      const auto whole = static_cast<std::int64_t>(lag.delay_cycles);
      const auto arrival = static_cast<std::int64_t>(std::ceil(lag.delay_cycles));
      const auto lags_of = [&](double n) { return arrival + static_cast<std::int64_t>(std::ceil(n * lag.lag_cycles)); };
      paths_.push_back({.direct = lag == ComponentLag{},
                        .whole = whole,
                        .wait = lags_of(2.0),
                        .settling = lags_of(3.0),
                        .fraction = lag.delay_cycles - static_cast<double>(whole),
                        .keep = lag.lag_cycles > 0.0 ? std::exp(-1.0 / lag.lag_cycles) : 0.0,
                        .input = Inputs::Zero(inputs),
                        .model = LocalModel(inputs, uncertain.memory)});
      rows_ = std::max(rows_, arrival + 1);
    }
    sources_.push_back(source);
  }
  if (rows_ > 1) ring_.assign(static_cast<std::size_t>(rows_ * inputs), 0.0);
}

std::int64_t CausingInputs::settling() const noexcept {
  std::int64_t most = 0;
  for (std::size_t i = 0; i < sources_.size(); ++i)
    most = std::max(most, path(i).settling);
  return most;
}

// Gaussian errors of equal count: the logarithm of the likelihood ratio is n/2 times that of the ratio of variances.
bool CausingInputs::judge(std::size_t i, const Inputs& applied, double value) noexcept {
  Source& source = sources_[i];
  if (source.count < 2) return false;
  Path* const paths = &paths_[static_cast<std::size_t>(source.first)];
  bool ready = true;
  for (std::int64_t p = 0; p < source.count; ++p) {
    if (cycles_ <= paths[p].wait) return false;
    ready = ready && paths[p].model.cycles() >= fewest_readings - 1.0;
    const Inputs& cause = paths[p].of(applied);
    paths[p].off = value - paths[p].model.predict(cause);
    paths[p].model.record(cause, value);
  }
  if (!ready) return false;
  source.judged = std::min(source.judged + 1.0, error_memory);
  std::int64_t best = source.taken;
  for (std::int64_t p = 0; p < source.count; ++p) {
    paths[p].error += (paths[p].off * paths[p].off - paths[p].error) / source.judged;
    if (paths[p].error < paths[best].error) best = p;
  }
  const double least = no_error * value * value + 1e-300;
  const double ratio = (paths[source.taken].error + least) / (paths[best].error + least);
  if (!(0.5 * source.judged * std::log(ratio) > evidence)) return false;
  source.taken = best;
  return true;
}

Inputs CausingInputs::applied_before(std::int64_t cycles) const noexcept {
  const std::int64_t row = (cycles_ - 1 - cycles) % rows_;
  return Eigen::Map<const Inputs>(&ring_[static_cast<std::size_t>(row * inputs_)], inputs_);
}

void CausingInputs::forget() noexcept {
  cycles_ = 0;
  std::fill(ring_.begin(), ring_.end(), 0.0);
  for (Source& source : sources_)
    source.judged = 0.0;
  for (Path& path : paths_) {
    path.input.setZero();
    path.model.forget();
    path.error = 0.0;
  }
}

void CausingInputs::pass_on(const Inputs& applied) noexcept {
  if (rows_ > 1) {
    const auto slot = static_cast<std::size_t>(((cycles_ - 1) % rows_) * inputs_);
    std::copy(applied.begin(), applied.end(), ring_.begin() + static_cast<std::ptrdiff_t>(slot));
  }
  for (Path& path : paths_) {
    if (path.direct) continue;
    Inputs arriving = applied;
    if (path.whole > 0 || path.fraction > 0.0) {
      const std::int64_t further = path.whole + (path.fraction > 0.0 ? 1 : 0);
      if (cycles_ <= further) continue;
      arriving = applied_before(path.whole);
      if (path.fraction > 0.0) arriving += path.fraction * (applied_before(further) - arriving);
      if (cycles_ == further + 1) path.input = arriving;
    } else if (cycles_ == 1) {
      path.input = arriving;
    }
    path.input = path.keep > 0.0 ? arriving + path.keep * (path.input - arriving) : arriving;
  }
}

}  // namespace mgdd::optimize
