#include "mgdd/guide/guided_engine.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/variant.hpp"

namespace mgdd::guide {
namespace {

using IndicatorMember = double engine::Indicators<double>::*;
using optimize::Inputs;
using optimize::Reading;
using optimize::TellStatus;

optimize::VariantSeeker::Settings shared_settings(const GuidedEngine::Seeking& seeking) {
  return std::visit(
      [](const auto& s) {
        return optimize::VariantSeeker::Settings{s.settings().space, s.settings().maximize, s.settings().limits};
      },
      seeking);
}

// Of the model's cycle, by the names of the limits; empty where one is not an indicator.
std::vector<IndicatorMember> indicators_of(const std::vector<optimize::Limit>& limits) {
  std::vector<IndicatorMember> out;
  for (const optimize::Limit& limit : limits) {
    for (const auto& field : engine::indicator_fields<double>()) {
      if (field.name == limit.name) out.push_back(field.member);
    }
  }
  return out.size() == limits.size() ? out : std::vector<IndicatorMember>{};
}

bool differs(double now, double before, double share) noexcept {
  return std::abs(now - before) > share * std::abs(before);
}

}  // namespace

void validate(const GuidedEngineSettings& settings) {
  require_in(above(0.0, 1.0), "changed_share", settings.changed_share);
  require_in(above(0.0, 1e3), "calibrated_sd_cad", settings.calibrated_sd_cad);
  require_in(closed(0.0, 1e3), "recalibrated_cad", settings.recalibrated_cad);
}

GuidedEngine::GuidedEngine(Seeking seeking, ModelOptimum model, std::optional<OnlineCalibration> calibration,
                           const engine::OperatingPoint& point, const GuidedEngineSettings& settings)
    : seeking_(std::move(seeking)),
      model_(std::move(model)),
      calibration_(std::move(calibration)),
      point_(point),
      advised_(point),
      guidance_(settings),
      settings_(shared_settings(seeking_)),
      limited_(indicators_of(settings_.limits)) {
  validate(settings);
  if (settings_.space.size() != 1) {
    throw about("seeker", ShapeError("seeker has " + std::to_string(settings_.space.size()) +
                                     " inputs: the timing of an engine is one"));
  }
  if (!settings_.maximize) {
    throw about("maximize", ParameterError("maximize = False: a guided engine maximises its performance"));
  }
  if (calibration_ && !(calibration_->settings().cylinder.geometry == model_.settings().cylinder.geometry)) {
    throw about("calibration", ParameterError("calibration is of a cylinder of another geometry than the model: make "
                                              "both of the same cylinder"));
  }
  if (begin() != GuideStatus::followed) {
    throw about("model", ParameterError("model has no best timing that can guide at this operating point: widen the "
                                        "bounds, or give another model"));
  }
  refusals_ = 0;
}

// The model's first answer. A curve-guided seeker that keeps its start and has not run yet is made anew with the
// model's curves, since `guide` moves it to their best.
GuideStatus GuidedEngine::begin() {
  auto* const by_curve = std::get_if<CurveSeeking>(&seeking_);
  const bool moves_nothing = guidance_.keep_start && by_curve == nullptr;
  const GuideStatus status = advise(moves_nothing ? GuideCause::calibration : GuideCause::new_point);
  if (status != GuideStatus::followed || !guidance_.keep_start || by_curve == nullptr) return status;
  if (by_curve->protocol().cycle > 0) return status;  // the error of the guide that it has learnt stays
  CurveSeekingSettings own = by_curve->settings();
  const bool draws_limits = own.limit_curves.size() == limited_.size();
  model_.tabulate(point_, own.curve, draws_limits ? std::span(limited_) : std::span<IndicatorMember>(),
                  draws_limits ? std::span(own.limit_curves) : std::span<Curve>());
  *by_curve = CurveSeeking(std::move(own));
  return status;
}

GuideStatus GuidedEngine::advise(GuideCause cause, bool opened) noexcept {
  if (calibration_ && calibration_->updates() > 0) model_.put_cylinder(calibration_->cylinder());
  GuideStatus status = GuideStatus::refused;
  if (auto* const curve_seeking = std::get_if<CurveSeeking>(&seeking_)) {
    Curve curve;
    std::array<Curve, ModelOptimum::max_curves> own;
    const std::span<Curve> limit_curves(own.data(), limited_.size());
    // A curve that is best out of the bounds is not handed on: `guide` would begin anew with every cycle that asks
    // again.
    const bool drawn = model_.tabulate(point_, curve, limited_, limit_curves);
    if (drawn && curve.best() >= settings_.space.lower[0] && curve.best() <= settings_.space.upper[0]) {
      const bool taken = cause == GuideCause::calibration ? curve_seeking->believe(curve, guidance_.calibrated_sd_cad)
                                                          : curve_seeking->guide(curve, limit_curves);
      if (taken) {
        status = GuideStatus::followed;
        guide_cad_ = curve.best();
      }
    } else if (opened) {
      curve_seeking->restart();
    }
  } else {
    auto& trimmed = *std::get_if<FeedForward<optimize::VariantSeeker>>(&seeking_);
    const ModelOptimumResult found = model_.find(point_);
    status = trimmed.offer(guide_value(found), cause);
    if (status == GuideStatus::followed) guide_cad_ = found.soc_cad;
    if (status == GuideStatus::refused && opened) trimmed.hold();
  }
  if (status == GuideStatus::refused) ++refusals_;
  return status;
}

GuideStatus GuidedEngine::at(const engine::OperatingPoint& point) noexcept {
  if (protocol().asked) return GuideStatus::busy;
  bool finite = true, moved = false, opened = false;
  for (const auto& f : engine::operating_point_fields<double>()) {
    finite = finite && std::isfinite(f.in(point));
    moved = moved || f.in(point) != f.in(point_);
    opened = opened || differs(f.in(point), f.in(advised_), guidance_.changed_share);
  }
  if (!finite) {
    ++refusals_;
    return GuideStatus::refused;
  }
  point_ = point;
  if (opened || owed_) {
    if (opened) advised_ = point;
    // Asked again at a point that is open already: as a new point once more, the seeker would begin anew in every
    // cycle.
    const GuideStatus status = advise(opened ? GuideCause::new_point : GuideCause::following, opened);
    owed_ = status == GuideStatus::refused;
    return status;
  }
  // A curve hardly changes within a small step; a feed-forward follows it.
  if (!moved || std::holds_alternative<CurveSeeking>(seeking_)) return GuideStatus::followed;
  advised_ = point;
  return advise(GuideCause::following);
}

const Inputs& GuidedEngine::ask() noexcept {
  return on(seeking_, [](auto& s) -> const Inputs& { return s.ask(); });
}

TellStatus GuidedEngine::tell(const Reading& reading, std::span<const double> pressure_bar) noexcept {
  const Inputs asked = applied();
  const TellStatus status = on(seeking_, [&](auto& s) { return s.tell(reading); });
  if (!calibration_ || pressure_bar.empty()) return status;
  if (status != TellStatus::accepted && status != TellStatus::misfire) return status;
  Inputs told;
  const double soc_cad = applied_input(reading, asked, told)[0];
  if (calibration_->offer(pressure_bar, point_, soc_cad, status == TellStatus::misfire) ==
          CalibrationStatus::accepted &&
      calibration_->update() == CalibrationStatus::updated) {
    recalibrate(calibration_->cylinder());
  }
  return status;
}

// The model takes over what was calibrated as soon as that moves its best timing.
void GuidedEngine::recalibrate(const engine::Cylinder& calibrated) noexcept {
  model_.put_cylinder(calibrated);
  const ModelOptimumResult found = model_.find(point_);
  if (!found.found || std::abs(found.soc_cad - guide_cad_) < guidance_.recalibrated_cad) return;
  if (advise(GuideCause::calibration) == GuideStatus::followed) ++recalibrations_;
}

void GuidedEngine::restart() noexcept {
  on(seeking_, [](auto& s) { s.restart(); });
}
void GuidedEngine::shift_estimate(const Inputs& by) noexcept {
  on(seeking_, [&](auto& s) { s.shift_estimate(by); });
}
void GuidedEngine::reseed(std::uint64_t seed) noexcept {
  on(seeking_, [seed](auto& s) {
    if constexpr (requires { s.reseed(seed); }) s.reseed(seed);
  });
}

const Inputs& GuidedEngine::estimate() const noexcept {
  return on(seeking_, [](const auto& s) -> const Inputs& { return s.estimate(); });
}
const Inputs& GuidedEngine::applied() const noexcept {
  return on(seeking_, [](const auto& s) -> const Inputs& { return s.applied(); });
}
const optimize::Protocol& GuidedEngine::protocol() const noexcept {
  return on(seeking_, [](const auto& s) -> const optimize::Protocol& { return s.protocol(); });
}
std::size_t GuidedEngine::component_count() const noexcept {
  return on(seeking_, [](const auto& s) { return s.component_count(); });
}

optimize::LimitState GuidedEngine::limit_state(std::size_t i) const noexcept {
  return on(seeking_, [&](const auto& s) { return optimize::limit_state_of(s, i); });
}

double GuidedEngine::limit_delay(std::size_t i) const noexcept {
  return on(seeking_, [&](const auto& s) { return optimize::limit_delay_of(s, i); });
}

GuidedCycle GuidedEngine::now() const noexcept {
  GuidedCycle out;
  out.guide_cad = out.feed_forward_cad = guide_cad_;
  out.estimate_cad = estimate()[0];
  out.estimate_sd_cad = std::numeric_limits<double>::quiet_NaN();
  if (const auto* const curve_seeking = std::get_if<CurveSeeking>(&seeking_)) {
    out.estimate_sd_cad = curve_seeking->estimate_sd();
    out.trust = curve_seeking->trust();
  } else {
    const auto& trimmed = *std::get_if<FeedForward<optimize::VariantSeeker>>(&seeking_);
    out.feed_forward_cad = trimmed.path().feed_forward()[0];
    out.trust = trimmed.path().trust().value();
  }
  out.trim_cad = out.estimate_cad - out.feed_forward_cad;
  return out;
}

void GuidedEngine::require_usable() const {
  std::visit([](const auto& s) { s.require_usable(); }, seeking_);
  if (calibration_) calibration_->require_usable();
}

}  // namespace mgdd::guide
