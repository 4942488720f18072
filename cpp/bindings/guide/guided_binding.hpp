// Seekers with a guide, as Python holds them.
#pragma once

#include <vector>

#include "guarded.hpp"
#include "mgdd/guide/feed_forward.hpp"
#include "mgdd/guide/guided_engine.hpp"
#include "mgdd/optimize/ask_tell/seeker_history.hpp"
#include "mgdd/optimize/ask_tell/variant_seeker.hpp"

namespace mgdd::bindings {

using BoundFeedForward = Guarded<guide::FeedForward<optimize::RecordedSeeker<optimize::VariantSeeker>>>;
using BoundGuidedEngine = Guarded<guide::GuidedEngine>;

/// What the guide says, as Python gives it; what has too many entries stays empty, and is refused where it is offered.
guide::GuideValue guide_value_from(const std::vector<double>& optimum, const std::vector<double>& curvature);

}  // namespace mgdd::bindings
