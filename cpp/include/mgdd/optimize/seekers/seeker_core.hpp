// What the seekers hold alike, and how each answers for it: settings, estimate, the input of the last ask, the count of
// asks and tells, limits, and where the plant is clamped. `take` is noexcept and allocation-free.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "mgdd/optimize/seekers/clamp_watch.hpp"
#include "mgdd/optimize/seekers/constraint_filter.hpp"
#include "mgdd/optimize/seekers/first_readings.hpp"
#include "mgdd/optimize/seekers/outliers.hpp"
#include "mgdd/optimize/seekers/seeker.hpp"

namespace mgdd::optimize {

template <class S>
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

 protected:
  /// `memory` gives how many measurements stand behind what is learnt of the limits.
  SeekerCore(S checked, double (*memory)(const S&))
      : settings_(std::move(checked)),
        filter_(settings_.limits, settings_.space.size(), memory(settings_)),
        clamp_(settings_.space.size()),
        outliers_(component_count(), settings_.limits, settings_.space.size()),
        protocol_(settings_.space, component_count() + settings_.limits.size()),
        estimate_(settings_.space.start),
        applied_(estimate_) {}

  /// What to ask of the plant where `applied_` is wanted.
  const Inputs& send() noexcept { return protocol_.ask(clamp_.stretched(applied_, estimate_, settings_.space)); }
  /// Counts a reading and takes its limits; of an accepted one `learn(what of it may be learnt, the input that the
  /// plant applied)`, else `miss(that input)`: nothing was read, but what comes late has moved on by a cycle.
  template <class Learn, class Miss>
  TellStatus take(const Reading& reading, Learn&& learn, Miss&& miss) noexcept {
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
      learn(read, applied);
    } else {
      filter_.skip(applied);
      miss(applied);
    }
    return status;
  }
  template <class Learn>
  TellStatus take(const Reading& reading, Learn&& learn) noexcept {
    return take(reading, std::forward<Learn>(learn), [](const Inputs&) noexcept {});
  }
  /// The same where J may come late: there a dither goes on, and `learn(reading, applied)` with the last one.
  template <class Learn>
  TellStatus take_late(const Reading& reading, FirstReadings& first, LastReading& last, Learn&& learn) noexcept {
    const auto keep = [&](const Reading& read, const Inputs& applied) {
      last.keep(read);
      learn(read, applied);
    };
    return take(reading, keep, [&](const Inputs& applied) {
      if (first.open()) {
        first.skip(applied);
      } else if (last.stands_in()) {
        learn(last.reading(), applied);
      }
    });
  }
  /// What a new operating point makes void.
  void forget() noexcept {
    filter_.forget();
    clamp_.forget();
    protocol_.failures.forget();
    outliers_.forget();
  }
  /// After a reading: what the first ones made of `self` is void where one of them was far out, those of J unless they
  /// are judged together; and where nothing but another input has worked, the search goes on there.
  template <class Self>
  static void look_back(Self& self, bool judged_together) noexcept {
    if (self.outliers_.limits_spoiled() || (self.outliers_.spoiled() && !judged_together)) self.begin_anew();
    if (const Inputs* const works = self.protocol_.failures.found()) self.shift_estimate(*works - self.estimate_);
  }
  template <class Self, class V>
  static void visit_core(Self& self, V& v) {
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
