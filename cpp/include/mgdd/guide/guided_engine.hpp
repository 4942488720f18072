// The whole guided loop of an engine, one cycle at a time (Tan 2018, figure 6-1; rules and curve are ours): a rough
// cycle model says where the best timing should be, as a curve or as feed-forward; a seeker learns what is left from
// the measured J; and the model itself learns from the measured pressure.
//  - `at(point)`: at a new operating point the model is asked again, its curve or optimum goes to the seeker;
//  - `tell`: the reading goes to the seeker, the pressure to the calibration; where that moves the model, its new
//    answer goes to the seeker in a way that does not move the applied input by itself.
// Work per cycle is bounded: one tell, one update of the calibration, one search or curve of the model. Angles °CA
// aTDC. `at`, `ask` and `tell` are noexcept and allocation-free.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "mgdd/common/state.hpp"
#include "mgdd/guide/curve_seeking.hpp"
#include "mgdd/guide/feed_forward.hpp"
#include "mgdd/guide/model_optimum.hpp"
#include "mgdd/guide/online_calibration.hpp"
#include "mgdd/optimize/ask_tell/variant_seeker.hpp"

namespace mgdd::guide {

struct GuidedEngineSettings {
  double changed_share = 0.05;     ///< change of speed, fuel or intake that makes a new operating point, in (0, 1)
  double calibrated_sd_cad = 2.0;  ///< of a calibrated model's best timing about the plant's, > 0
  double recalibrated_cad = 0.1;   ///< move of the model's best timing below which a calibration is not passed on, >= 0
  bool keep_start = false;         ///< begin at the seeker's start, not at the model's best timing; the trim takes the
                                   ///< distance, and a curve is believed as it is
};
void validate(const GuidedEngineSettings& settings);

/// What one cycle was made of, before it was told.
struct GuidedCycle {
  double guide_cad = 0.0;         ///< the model's best timing
  double feed_forward_cad = 0.0;  ///< of it in force; of a curve: its best timing
  double trim_cad = 0.0;          ///< estimate less feed-forward: what was measured
  double estimate_cad = 0.0;
  double estimate_sd_cad = 0.0;  ///< NaN where the seeker states none
  double trust = 0.0;
};

class GuidedEngine {
 public:
  using Seeking = std::variant<CurveSeeking, FeedForward<optimize::VariantSeeker>>;

  /// The model's first answer goes to the seeker, which keeps what it has learnt; ParameterError where it has none, or
  /// a setting is out of its domain.
  GuidedEngine(Seeking seeking, ModelOptimum model, std::optional<OnlineCalibration> calibration,
               const engine::OperatingPoint& point, const GuidedEngineSettings& settings = {});

  /// The operating point of the next cycle. Between ask and tell it has no effect.
  GuideStatus at(const engine::OperatingPoint& point) noexcept;

  const optimize::Inputs& ask() noexcept;
  optimize::TellStatus tell(const optimize::Reading& reading) noexcept { return tell(reading, {}); }
  /// The same with the pressure of the cycle on the angles of the calibration [bar]; empty: none was measured.
  optimize::TellStatus tell(const optimize::Reading& reading, std::span<const double> pressure_bar) noexcept;
  /// The operating point has changed in a way that `at` does not see.
  void restart() noexcept;
  void shift_estimate(const optimize::Inputs& by) noexcept;
  /// Another seed where its seeker draws.
  void reseed(std::uint64_t seed) noexcept;

  const optimize::Inputs& estimate() const noexcept;
  const optimize::Inputs& applied() const noexcept;
  const optimize::Protocol& protocol() const noexcept;
  std::size_t component_count() const noexcept;
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }
  /// What the settings of all seekers share.
  const optimize::VariantSeeker::Settings& settings() const noexcept { return settings_; }
  optimize::LimitState limit_state(std::size_t i) const noexcept;
  double limit_delay(std::size_t i) const noexcept;
  const GuidedEngineSettings& guidance() const noexcept { return guidance_; }

  GuidedCycle now() const noexcept;
  const Seeking& seeking() const noexcept { return seeking_; }
  const ModelOptimum& model() const noexcept { return model_; }
  const std::optional<OnlineCalibration>& calibration() const noexcept { return calibration_; }
  std::int64_t refusals() const noexcept { return refusals_; }  ///< answers of the model that could not be used
  std::int64_t recalibrations() const noexcept { return recalibrations_; }

  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    Prefixed<V> inner{v, "seeking."};
    std::visit([&](auto& s) { std::decay_t<decltype(s)>::visit(s, inner); }, self.seeking_);
    if (self.calibration_) {
      Prefixed<V> own{v, "calibration."};
      OnlineCalibration::visit(*self.calibration_, own);
    }
    visit_point(v, "point.", self.point_);
    visit_point(v, "advised.", self.advised_);
    v("guide_cad", self.guide_cad_);
    v("refusals", self.refusals_, counts_end);
    v("recalibrations", self.recalibrations_, counts_end);
    v("owed", self.owed_);
  }

 private:
  template <class V, class Point>
  static void visit_point(V& v, std::string_view prefix, Point& point) {
    Prefixed<V> own{v, prefix};
    for (const auto& field : engine::operating_point_fields<double>())
      own(field.info.name, field.in(point));
    own("burn_duration_cad", point.burn_duration_cad);
    own("trapped_mass_g", point.trapped_mass_g);
    own("ivc_temperature_k", point.ivc_temperature_k);
  }
  GuideStatus begin();
  GuideStatus advise(GuideCause cause, bool opened = false) noexcept;
  void recalibrate(const engine::Cylinder& calibrated) noexcept;

  Seeking seeking_;
  ModelOptimum model_;
  std::optional<OnlineCalibration> calibration_;
  engine::OperatingPoint point_, advised_;  // now, and where the model was asked last
  GuidedEngineSettings guidance_;
  optimize::VariantSeeker::Settings settings_;
  std::vector<double engine::Indicators<double>::*> limited_;  // of the limits; empty where one is not an indicator
  double guide_cad_ = 0.0;
  std::int64_t refusals_ = 0, recalibrations_ = 0;
  bool owed_ = false;  // the model has no answer for this operating point yet
};

}  // namespace mgdd::guide
