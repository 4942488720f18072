#include "mgdd/optimize/seekers/causing_inputs.hpp"

#include <algorithm>
#include <cmath>

namespace mgdd::optimize {

CausingInputs::CausingInputs(const std::vector<ComponentLag>& lags, Eigen::Index inputs) : inputs_(inputs) {
  for (const ComponentLag& lag : lags) {
    Path path;
    path.direct = lag == ComponentLag{};
    path.whole = static_cast<std::int64_t>(lag.delay_cycles);
    path.fraction = lag.delay_cycles - static_cast<double>(path.whole);
    if (lag.lag_cycles > 0.0) path.keep = std::exp(-1.0 / lag.lag_cycles);
    const auto arrival = static_cast<std::int64_t>(std::ceil(lag.delay_cycles));
    path.wait = arrival + static_cast<std::int64_t>(std::ceil(2.0 * lag.lag_cycles));
    path.input = Inputs::Zero(inputs);
    rows_ = std::max(rows_, arrival + 1);
    settling_ = std::max(settling_, arrival + static_cast<std::int64_t>(std::ceil(3.0 * lag.lag_cycles)));
    paths_.push_back(std::move(path));
  }
  if (rows_ > 1) ring_.assign(static_cast<std::size_t>(rows_ * inputs), 0.0);
}

Inputs CausingInputs::applied_before(std::int64_t cycles) const noexcept {
  const std::int64_t row = (cycles_ - 1 - cycles) % rows_;
  return Eigen::Map<const Inputs>(&ring_[static_cast<std::size_t>(row * inputs_)], inputs_);
}

void CausingInputs::forget() noexcept {
  cycles_ = 0;
  std::fill(ring_.begin(), ring_.end(), 0.0);
  for (Path& path : paths_)
    path.input.setZero();
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
