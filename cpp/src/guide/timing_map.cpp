#include "mgdd/guide/timing_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "mgdd/common/bounds.hpp"

namespace mgdd::guide {
namespace {

std::size_t cells_of(const TimingMapSettings& s) noexcept {
  std::size_t cells = 1;
  for (const std::vector<double>& axis : s.axes)
    cells *= axis.size();
  return cells;
}

TimingMapSettings checked(TimingMapSettings s) {
  validate(s);
  return s;
}

}  // namespace

void validate(const TimingMapSettings& s) {
  if (s.axes.empty() || s.axes.size() > 2) {
    throw about("axes", ShapeError("axes has " + std::to_string(s.axes.size()) + " entries: must have one or two"));
  }
  for (std::size_t a = 0; a < s.axes.size(); ++a)
    require_axis("axes[" + std::to_string(a) + "]", s.axes[a]);
  if (s.values_cad.size() != cells_of(s)) {
    throw about("values_cad", ShapeError("values_cad has " + std::to_string(s.values_cad.size()) +
                                         " entries: the axes have " + std::to_string(cells_of(s)) + " cells"));
  }
  for (std::size_t i = 0; i < s.values_cad.size(); ++i) {
    if (!std::isfinite(s.values_cad[i])) {
      throw ParameterError("values_cad[" + std::to_string(i) + "]", s.values_cad[i], "must be finite", "°CA aTDC");
    }
  }
  require_positive("prior_sd_cad", s.prior_sd_cad, "°CA");
  require_in(above(0.0, 1.0), "forgetting", s.forgetting);
}

TimingMap::TimingMap(TimingMapSettings settings)
    : settings_(checked(std::move(settings))),
      values_(settings_.values_cad),
      variance_(values_.size(), settings_.prior_sd_cad * settings_.prior_sd_cad),
      support_(values_.size(), 0.0) {}

TimingMap::Place TimingMap::place_of(std::span<const double> point) const noexcept {
  Place at;
  const std::vector<std::vector<double>>& axes = settings_.axes;
  if (point.size() != axes.size()) return at;
  for (const double coordinate : point) {
    if (!std::isfinite(coordinate)) return at;
  }
  if (point.size() == 2) {
    static_cast<TablePlace<corners>&>(at) = place_in(axes[0], axes[1], point[0], point[1]);
  } else {
    const TablePlace<2> on_line = place_in(axes[0], point[0]);
    std::copy(on_line.cell.begin(), on_line.cell.end(), at.cell.begin());
    std::copy(on_line.weight.begin(), on_line.weight.end(), at.weight.begin());
    at.outside = on_line.outside;
  }
  at.known = true;
  return at;
}

TimingLookup TimingMap::lookup(std::span<const double> point) const noexcept {
  const Place at = place_of(point);
  if (!at.known) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    return {nan, nan, 0.0, true};
  }
  TimingLookup out;
  double variance = 0.0;
  for (std::size_t c = 0; c < corners; ++c) {
    out.value_cad += at.weight[c] * values_[at.cell[c]];
    out.support += at.weight[c] * support_[at.cell[c]];
    variance += at.weight[c] * at.weight[c] * variance_[at.cell[c]];
  }
  out.sd_cad = std::sqrt(variance);
  out.held_outside = at.outside;
  return out;
}

bool TimingMap::learn(std::span<const double> point, double value_cad, double sd_cad) noexcept {
  const Place at = place_of(point);
  if (!at.known || at.outside || !std::isfinite(value_cad) || !(sd_cad > 0.0 && std::isfinite(sd_cad))) return false;
  const double prior = settings_.prior_sd_cad * settings_.prior_sd_cad;
  double predicted = 0.0, total = sd_cad * sd_cad;
  for (std::size_t c = 0; c < corners; ++c) {
    const double w = at.weight[c], kept = std::pow(settings_.forgetting, w);
    const std::size_t i = at.cell[c];
    if (!(w > 0.0)) continue;
    variance_[i] = std::min(prior, variance_[i] / kept);
    support_[i] = kept * support_[i] + w;
    predicted += w * values_[i];
    total += w * w * variance_[i];
  }
  for (std::size_t c = 0; c < corners; ++c) {
    const double w = at.weight[c];
    const std::size_t i = at.cell[c];
    if (!(w > 0.0)) continue;
    const double gain = w * variance_[i] / total;
    values_[i] += gain * (value_cad - predicted);
    variance_[i] *= 1.0 - gain * w;
  }
  return true;
}

void TimingMap::require_usable() const {
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (!(variance_[i] > 0.0)) throw ParameterError("state column 'variance' must be > 0");
    if (!(support_[i] >= 0.0)) throw ParameterError("state column 'support' must be >= 0");
  }
}

}  // namespace mgdd::guide
