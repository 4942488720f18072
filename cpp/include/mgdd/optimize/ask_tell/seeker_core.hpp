// What the seekers hold alike, and how each answers for it: settings, estimate, the input of the last ask, the count of
// asks and tells, limits, and where the plant is clamped. `tell` is noexcept and allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"
#include "mgdd/optimize/watch/clamp_watch.hpp"
#include "mgdd/optimize/watch/outliers.hpp"

namespace mgdd::optimize {

/// `Self` learns: `learn(what of a reading may be learnt, the input that the plant applied)`.
template <class Self, class S>
class SeekerCore {
 public:
  const S& settings() const noexcept { return settings_; }
  const Inputs& estimate() const noexcept { return estimate_; }
  /// The input of the last ask; what the plant made of it stands in the reading.
  const Inputs& applied() const noexcept { return protocol_.sent(clamp_.sent(applied_)); }
  const Protocol& protocol() const noexcept { return protocol_; }
  std::size_t component_count() const noexcept {
    if constexpr (requires(const S& s) { s.components; }) return settings_.components.size();
    return 1;
  }
  /// How far the plant follows.
  const ClampWatch& clamp() const noexcept { return clamp_; }
  /// What has been learnt of the limits.
  const ConstraintFilter& filter() const noexcept { return filter_; }
  std::size_t limit_count() const noexcept { return settings_.limits.size(); }
  /// By how much an input is expected over a limit, in its scale; at most 0 where all are kept.
  double excess(const Inputs& at) const noexcept { return filter_.worst_excess(at); }

  /// Counts a reading, takes its limits and learns of it. What the first readings made is void where one of them was
  /// far out, of J unless judged together; where nothing but another input has worked, the search goes on there.
  TellStatus tell(const Reading& reading) noexcept {
    Self& self = static_cast<Self&>(*this);
    const TellStatus status = protocol_.check(reading, component_count(), limit_count(), applied_.size());
    protocol_.count(status, reading);
    if (status != TellStatus::accepted && status != TellStatus::misfire) return status;
    Inputs told;
    const Inputs& applied = protocol_.applied(reading, clamp_.sent(applied_), told);
    if (status == TellStatus::accepted) {
      Reading read = reading;
      const std::span<const double> admitted = outliers_.admit(reading.components, reading.limits);
      read.components = admitted.first(component_count());
      read.limits = admitted.subspan(component_count());
      filter_.record(applied, read.limits);
      self.learn(read, applied);
    } else {
      filter_.skip(applied);
      self.miss(applied);
    }
    if (outliers_.limits_spoiled() || (outliers_.spoiled() && !self.judged_together())) self.begin_anew();
    if (const Inputs* const works = protocol_.failures.found()) self.shift_estimate(*works - estimate_);
    return status;
  }

 private:
  friend Self;
  /// `memory` gives how many measurements stand behind what is learnt of the limits.
  SeekerCore(S checked, double (*memory)(const S&))
      : settings_(std::move(checked)),
        filter_(settings_.limits, settings_.space.size(), memory(settings_)),
        clamp_(settings_.space.size()),
        outliers_(component_count(), settings_.limits, settings_.space.size()),
        protocol_(settings_.space, component_count() + settings_.limits.size()),
        estimate_(settings_.space.start),
        applied_(estimate_) {}

 protected:
  /// What to ask of the plant where `applied_` is wanted.
  const Inputs& send() noexcept {
    return protocol_.ask(clamp_.stretched(applied_, estimate_, settings_.space),
                         [this](const Inputs& at) { return excess(at); });
  }
  /// A cycle without a reading: what comes late has moved on, and a dither may go on with it.
  void miss(const Inputs&) noexcept {}
  /// What a new operating point makes void.
  void forget() noexcept {
    filter_.forget();
    clamp_.forget();
    protocol_.failures.forget();
    outliers_.forget();
  }
  template <class Any, class V>
  static void visit_core(Any& self, V& v) {
    Protocol::visit(self.protocol_, v);
    v("estimate", self.estimate_);
    v("applied", self.applied_);
    ConstraintFilter::visit(self.filter_, v);
    ClampWatch::visit(self.clamp_, v);
    Outliers::visit(self.outliers_, v);
  }

  S settings_;
  ConstraintFilter filter_;
  ClampWatch clamp_;
  Outliers outliers_;
  Protocol protocol_;
  Inputs estimate_, applied_;
};

}  // namespace mgdd::optimize
