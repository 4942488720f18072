#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/optimize/laws/gaussian_process_seeking.hpp"
#include "mgdd/optimize/laws/process_laws.hpp"

namespace mgdd::optimize {
void require_guides(const std::string& name, const std::vector<Surface>& guides, std::size_t count,
                    const std::string& whose, Eigen::Index inputs) {
  if (!guides.empty() && guides.size() != count) {
    throw about(name, ShapeError(name + " has " + std::to_string(guides.size()) + " entries: must have one per " +
                                 whose + ", " + std::to_string(count)));
  }
  for (const Surface& guide : guides) {
    if (guide.empty()) continue;
    if (guide.axes().size() != static_cast<std::size_t>(inputs)) {
      throw about(name, ShapeError(name + " is over " + std::to_string(guide.axes().size()) +
                                   " inputs: must be over the " + std::to_string(inputs) + " that are sought"));
    }
    const auto [least, most] = std::minmax_element(guide.values().begin(), guide.values().end());
    if (*least == *most) throw ParameterError(name, *least, "must not say the same everywhere: leave it out");
  }
}

void require_finite_bounds(const SearchSpace& space) {
  for (Eigen::Index i = 0; i < space.size(); ++i) {
    const std::string name = space.inputs.empty() ? "" : " of " + space.inputs[static_cast<std::size_t>(i)].name;
    for (const auto& [side, value] : {std::pair{"lower", space.lower[i]}, std::pair{"upper", space.upper[i]}}) {
      if (!std::isfinite(value)) {
        throw ParameterError(side + name, value, "must be finite: inputs are counted in their ranges");
      }
    }
  }
}

GaussianProcessSeekingSettings resolved(GaussianProcessSeekingSettings s) {
  const Eigen::Index n = s.space.size();
  s.space = resolved(std::move(s.space));
  validate(s.space, Inputs::Zero(n));
  require_finite_bounds(s.space);
  if (s.noise_sd) require_positive("noise_sd", *s.noise_sd);
  require_in(Domain{0.0, 1e6}, "horizon", s.horizon);
  require_in(Domain{10.0, 1e9}, "memory_cycles", s.memory_cycles);
  require_in(Domain{10.0, most_kept}, "kept", s.kept);
  require_in(Domain{1e-3, 0.5}, "first_step", s.first_step);
  require_in(Domain{0.5, 0.9999}, "limit_probability", s.limit_probability);
  validate(s.sensor, "");
  validate(s.limits);
  for (Limit& limit : s.limits) {
    if (limit.scale == 0.0) limit.scale = limit.upper != 0.0 ? std::abs(limit.upper) : 1.0;
  }
  if (s.components.empty()) {
    s.components.push_back(s.sensor);
  } else if (s.sensor != ComponentLag{}) {
    throw ParameterError("delay_cycles", s.sensor.delay_cycles, "must be left out where components say their own");
  }
  validate(s.components);
  require_in(Domain{0.0, 20.0}, "delay_uncertainty", s.delay_uncertainty);
  require_guides("guide", s.guide, s.components.size(), "component of J", n);
  require_guides("limit_guides", s.limit_guides, s.limits.size(), "limit", n);
  return s;
}

}  // namespace mgdd::optimize
