// Binds guide/feed_forward.hpp: a seeker of any kind with the optimum of a guide as feed-forward.
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "guide/guided_binding.hpp"
#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_inputs.hpp"

namespace mgdd::bindings {
namespace {

using Recorded = optimize::RecordedSeeker<optimize::VariantSeeker>;
using Core = guide::FeedForward<Recorded>;

// Seeker, state and history are copied: the one that Python holds goes its own way.
BoundFeedForward make_feed_forward(const py::object& seeker, const py::object& calibration_rate, double following_share,
                                   double trust, int probe_cycles, int probe_settling, double trust_sd, double doubt,
                                   double curvature_spread, double significance, std::optional<double> noise_sd) {
  Recorded recorded(optimize::VariantSeeker(seeker_of(seeker, "seeker")));
  guide::FeedForwardSettings settings;
  settings.calibration_rate = inputs_from(calibration_rate, "calibration_rate", recorded.estimate().size());
  settings.following_share = following_share;
  settings.trust = {trust, probe_cycles, probe_settling, trust_sd, doubt, curvature_spread, significance, noise_sd};
  return {"FeedForward", Core(std::move(recorded), std::move(settings))};
}

std::vector<double> known_or_nan(const Core& core, const optimize::Inputs& values) {
  if (core.path().known()) return list_of(values);
  return std::vector<double>(static_cast<std::size_t>(values.size()), std::numeric_limits<double>::quiet_NaN());
}

}  // namespace

guide::GuideValue guide_value_from(const std::vector<double>& optimum, const std::vector<double>& curvature) {
  guide::GuideValue value;
  if (optimum.size() <= optimize::max_inputs)
    value.optimum = optimize::Inputs::Map(optimum.data(), static_cast<Eigen::Index>(optimum.size()));
  if (curvature.size() <= optimize::max_inputs)
    value.curvature = optimize::Inputs::Map(curvature.data(), static_cast<Eigen::Index>(curvature.size()));
  return value;
}

void bind_feed_forward(py::module_& m) {
  using py::arg;
  py::class_<BoundFeedForward> cls(m, "FeedForward", "A seeker with feed-forward; see mgdd.guide.FeedForward.");
  cls.def(py::init(&make_feed_forward), arg("seeker"), py::kw_only(), arg("calibration_rate"), arg("following_share"),
          arg("trust"), arg("probe_cycles"), arg("probe_settling"), arg("trust_sd"), arg("doubt"),
          arg("curvature_spread"), arg("significance"), arg("noise_sd"));
  bind_asking(cls);
  cls.def(
         "_offer",
         [](BoundFeedForward& b, const std::vector<double>& optimum, const std::vector<double>& curvature,
            const std::string& cause) {
           const guide::GuideCause why = parse_name<guide::GuideCause>("cause", cause);
           const guide::GuideStatus status = b.use()->offer(guide_value_from(optimum, curvature), why);
           if (status == guide::GuideStatus::busy) {
             throw ParameterError("at() between ask() and tell(): tell what was measured first");
           }
           return status == guide::GuideStatus::followed;
         },
         arg("optimum"), arg("curvature"), arg("cause"), "What the guide says; False where it cannot be used.")
      .def(
          "_hold", [](BoundFeedForward& b) { b.use()->hold(); },
          "A new operating point of which the guide says nothing.")
      .def_property_readonly(
          "applied", [](const BoundFeedForward& b) { return input_array(b.use()->applied()); },
          "The input of the last ask, shape (inputs,).")
      .def_property_readonly(
          "guide_optimum",
          [](const BoundFeedForward& b) {
            const auto core = b.use();
            return to_array(known_or_nan(*core, core->path().guide()));
          },
          "Last valid optimum of the guide, shape (inputs,); NaN before there is one.")
      .def_property_readonly(
          "feed_forward",
          [](const BoundFeedForward& b) {
            const auto core = b.use();
            return to_array(known_or_nan(*core, core->path().feed_forward()));
          },
          "Feed-forward in force, shape (inputs,); NaN before there is one.")
      .def_property_readonly(
          "trim",
          [](const BoundFeedForward& b) {
            const auto core = b.use();
            return to_array(known_or_nan(*core, core->trim()));
          },
          "Estimate less feed-forward, what the seeker has learnt itself, shape (inputs,); NaN without a guide.")
      .def_property_readonly(
          "trust", [](const BoundFeedForward& b) { return b.use()->path().trust().value(); },
          "Trust in the guide, 0 to 1: share of its next move that is made.")
      .def_property_readonly(
          "verdict", [](const BoundFeedForward& b) { return as_str(name_of(b.use()->path().trust().verdict())); },
          "What the last test of the guide said: ``untested``, ``undecided``, ``confirmed`` or ``wrong``.")
      .def_property_readonly(
          "noise_sd", [](const BoundFeedForward& b) { return b.use()->path().trust().noise_sd(); },
          "Standard deviation of one reading of J, as given or learnt; NaN while it is not known.")
      .def_property_readonly(
          "testing",
          [](const BoundFeedForward& b) {
            const auto core = b.use();
            return core->path().testing() ? (core->path().at_trial() ? 2 : 1) : 0;
          },
          "1: the next cycle measures the old place, 2: the new one, 0: no test of the guide is under way.")
      .def_property(
          "_core_state", [](const BoundFeedForward& b) { return save_state(*b.use()); },
          [](BoundFeedForward& b, const StateColumns& columns) { restore_state(*b.use(), columns); },
          "State of the feed-forward and of its seeker.")
      .def_property_readonly(
          "_seeker_state", [](const BoundFeedForward& b) { return save_state(b.use()->seeker()); },
          "State of the seeker.")
      .def_property_readonly(
          "_seeker_history",
          [](const BoundFeedForward& b) {
            const auto core = b.use();
            return history_columns(core->seeker().history());
          },
          "History of the seeker, as its _history_columns.")
      .def(
          "_set_seeker_history",
          [](BoundFeedForward& b, const std::map<std::string, InputArray>& given) {
            b.use()->seeker().history().restore(columns_from(given));
          },
          arg("columns"), "History of the seeker, as its _history_columns gave it.");
}

}  // namespace mgdd::bindings
