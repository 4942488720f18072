// Binds guide/guided_engine.hpp: the whole guided loop of an engine.
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "guide/guided_binding.hpp"
#include "optimize/seeker_binding.hpp"
#include "optimize/seeker_inputs.hpp"

namespace mgdd::bindings {
namespace {

using namespace guide;
using AnySeeker = std::variant<optimize::ExtremumSeeking, optimize::Spsa, optimize::GradientDescent,
                               optimize::GoldenSection, optimize::GaussianProcessSeeking, CurveSeeking>;

GuidedEngine::Seeking seeking_of(const py::object& seeker, const FeedForwardSettings& settings) {
  AnySeeker any = seeker_of<AnySeeker>(seeker, "seeker");
  return std::visit(
      [&](auto& found) -> GuidedEngine::Seeking {
        if constexpr (std::is_same_v<std::decay_t<decltype(found)>, CurveSeeking>) {
          return std::move(found);
        } else {
          return FeedForward(optimize::VariantSeeker(std::move(found)), settings);
        }
      },
      any);
}

// Everything is copied: what Python holds goes its own way.
BoundGuidedEngine make_guided(const py::object& seeker, const Guarded<ModelOptimum>& model,
                              std::optional<const Guarded<OnlineCalibration>*> calibration,
                              const engine::OperatingPoint& point, double changed_share, double calibrated_sd_cad,
                              double recalibrated_cad, double calibration_rate_cad, std::optional<double> noise_sd,
                              bool keep_start) {
  FeedForwardSettings trimmed;
  trimmed.calibration_rate = optimize::scalar_input(calibration_rate_cad);
  trimmed.trust.noise_sd = noise_sd;
  std::optional<OnlineCalibration> own;
  if (calibration) own.emplace(*(*calibration)->use());
  return {"GuidedEngine", GuidedEngine(seeking_of(seeker, trimmed), ModelOptimum(*model.use()), std::move(own), point,
                                       {changed_share, calibrated_sd_cad, recalibrated_cad, keep_start})};
}

py::dict to_dict(const GuidedEngine& engine) {
  const GuidedCycle now = engine.now();
  py::dict out;
  out["guide_cad"] = now.guide_cad;
  out["feed_forward_cad"] = now.feed_forward_cad;
  out["trim_cad"] = now.trim_cad;
  out["estimate_cad"] = now.estimate_cad;
  out["estimate_sd_cad"] = now.estimate_sd_cad;
  out["trust"] = now.trust;
  const auto& calibration = engine.calibration();
  out["wall_heat_scale"] =
      (calibration ? calibration->cylinder() : engine.model().settings().cylinder).wall_heat.wall_heat_scale;
  return out;
}

}  // namespace

void bind_guided_engine(py::module_& m) {
  using py::arg;
  py::class_<BoundGuidedEngine> cls(m, "GuidedEngine", "The guided loop of an engine; see mgdd.guide.GuidedEngine.");
  cls.def(py::init(&make_guided), arg("seeker"), arg("model"), arg("calibration"), arg("point"), py::kw_only(),
          arg("changed_share"), arg("calibrated_sd_cad"), arg("recalibrated_cad"), arg("calibration_rate_cad"),
          arg("noise_sd"), arg("keep_start"));
  bind_asking(cls);
  cls.def(
         "_tell",
         [](BoundGuidedEngine& b, const py::object& j, const py::object& limits, bool misfire,
            const py::object& applied, const std::optional<InputArray>& pressure_bar) {
           ReadingBuffer buffer;
           const optimize::Reading reading = reading_from(b.constant(), j, limits, misfire, applied, buffer);
           std::vector<double> trace;
           if (pressure_bar) trace = to_column(*pressure_bar, "pressure_bar");
           const auto r = b.use();
           optimize::require(r->tell(reading, trace), r->protocol(), reading, r->component_count(), r->limit_count(),
                             1);
         },
         arg("J"), arg("limits"), arg("misfire"), arg("applied"), arg("pressure_bar"), "tell, with the pressure.")
      .def(
          "_at",
          [](BoundGuidedEngine& b, const engine::OperatingPoint& point) {
            switch (b.use()->at(point)) {
              case GuideStatus::busy:
                throw ParameterError("at() between ask() and tell(): tell what was measured first");
              case GuideStatus::refused:
                return "refused";
              case GuideStatus::followed:
                break;
            }
            return "followed";
          },
          arg("point"), "The operating point of the next cycle.")
      .def(
          "_now", [](const BoundGuidedEngine& b) { return to_dict(*b.use()); }, "What the next cycle is made of.")
      .def_property_readonly(
          "applied", [](const BoundGuidedEngine& b) { return input_array(b.use()->applied()); },
          "The input of the last ask, shape (1,).")
      .def_property_readonly(
          "trust", [](const BoundGuidedEngine& b) { return b.use()->now().trust; }, "Trust in the guide, 0 to 1.")
      .def_property_readonly(
          "estimate_sd", [](const BoundGuidedEngine& b) { return b.use()->now().estimate_sd_cad; },
          "Standard deviation of the estimate as stated [°CA]; NaN where the seeker states none.")
      .def_property_readonly(
          "cylinder",
          [](const BoundGuidedEngine& b) {
            const auto engine = b.use();
            return engine->calibration() ? engine->calibration()->cylinder() : engine->model().settings().cylinder;
          },
          "The guide's cylinder as calibrated.")
      .def_property_readonly(
          "refusals", [](const BoundGuidedEngine& b) { return b.use()->refusals(); },
          "Answers of the model, and operating points, that could not be used.")
      .def_property_readonly(
          "recalibrations", [](const BoundGuidedEngine& b) { return b.use()->recalibrations(); },
          "How often a calibration moved what the guide says.")
      .def_property_readonly(
          "calibration_status",
          [](const BoundGuidedEngine& b) {
            const auto engine = b.use();
            return std::string(engine->calibration() ? name_of(engine->calibration()->status()) : "none");
          },
          "What became of the last cycle in the calibration; ``none`` without one.")
      .def_property(
          "state", [](const BoundGuidedEngine& b) { return save_state(*b.use()); },
          [](BoundGuidedEngine& b, const StateColumns& columns) { restore_state(*b.use(), columns); },
          "What the run needs to go on bit for bit, the history excepted: named lists of numbers, JSON-able.");
}

}  // namespace mgdd::bindings
