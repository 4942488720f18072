// A seeker with the optimum of a model as feed-forward: at a new operating point the estimate moves as far as the
// guide's optimum does, and the seeker learns only what is left, the trim = estimate - feed-forward.
// Structure: Tan 2018, section 5.2 (reconstruction); rules and trust are ours:
//  - new point: the seeker is restarted, the guide tested (`trust.hpp`), and its whole trusted move is made at once;
//  - following (the point drifts): the trusted move is made through a first-order filter, the seeker goes on;
//  - calibration (another model at the same point): the feed-forward moves by at most `calibration_rate` per cycle and
//    the trim takes the opposite step, so that the applied input does not move by itself. A first value given so is in
//    force at once, and the estimate keeps the seeker's start.
// Without a guide every call is that of the seeker, bit for bit. Inputs in their own unit.
// `offer`, `ask` and `tell` are noexcept and allocation-free where those of the seeker are.
#pragma once

#include <cstdint>
#include <utility>

#include "mgdd/common/state.hpp"
#include "mgdd/guide/guide_path.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"

namespace mgdd::guide {

template <class S>
class FeedForward {
 public:
  /// ParameterError or ShapeError naming the field.
  explicit FeedForward(S seeker, FeedForwardSettings settings = {})
      : seeker_(std::move(seeker)),
        path_(std::move(settings), seeker_.estimate().size()),
        protocol_(seeker_.settings().space, seeker_.component_count() + seeker_.limit_count()),
        applied_(seeker_.applied()) {}

  /// What the guide says of the operating point of the next cycle. A refused value lowers the trust and moves nothing;
  /// the first valid one after a new point is taken as one for a new point. The first of all restarts the seeker and
  /// moves the estimate to the guide's optimum; as a calibration it leaves the estimate where it stands.
  GuideStatus offer(const GuideValue& value, GuideCause cause) noexcept {
    if (protocol_.asked) return GuideStatus::busy;
    const GuidePath::Order order = path_.take(value, cause, seeker_.estimate(), seeker_.settings().space);
    if (order.restart) restart();
    if (order.move.size() > 0) seeker_.shift_estimate(order.move);
    return order.status;
  }

  const optimize::Inputs& ask() noexcept {
    if (!protocol_.asked) {
      const optimize::Inputs move = path_.follow();
      if (move.size() > 0) seeker_.shift_estimate(move);
    }
    applied_ = path_.testing() ? protocol_.ask(path_.test_input(seeker_.estimate())) : protocol_.pass(seeker_.ask());
    return applied_;
  }

  optimize::TellStatus tell(const optimize::Reading& reading) noexcept(noexcept(seeker_.tell(reading))) {
    const auto& settings = seeker_.settings();
    const optimize::TellStatus status = protocol_.check(reading, component_count(), limit_count(), applied_.size());
    if (status != optimize::TellStatus::accepted && status != optimize::TellStatus::misfire) return status;
    const bool fired = status == optimize::TellStatus::accepted;
    optimize::Inputs told;
    const optimize::Inputs applied = optimize::applied_input(reading, applied_, told);
    const double j = fired ? optimize::objective_of(reading, settings.maximize) : 0.0;
    if (path_.testing()) {
      if (fired) {
        const optimize::Inputs move =
            path_.tested(j, worst_excess(settings.limits, reading.limits), applied - seeker_.estimate());
        if (move.size() > 0) seeker_.shift_estimate(move);
      }
    } else {
      seeker_.tell(reading);
      if (fired) path_.searched(applied, j);
    }
    path_.advance();
    protocol_.count(status, reading);
    return status;
  }

  /// A new operating point of which the guide says nothing: the feed-forward stands, the seeker begins anew, and the
  /// next value of the guide counts as one for a new point.
  void hold() noexcept {
    restart();
    path_.open();
  }
  /// The seeker begins anew; what the guide said stands.
  void restart() noexcept {
    seeker_.restart();
    protocol_.failures.forget();
  }
  void shift_estimate(const optimize::Inputs& by) noexcept { seeker_.shift_estimate(by); }
  /// Of a seeker that draws.
  void reseed(std::uint64_t seed) noexcept
    requires requires(S s) { s.reseed(seed); }
  {
    seeker_.reseed(seed);
  }
  /// The same around another seeker that stands where this one does, for example without its record.
  template <class T>
  FeedForward<T> around(T seeker) const {
    FeedForward<T> out(std::move(seeker));
    out.path_ = path_;
    out.protocol_ = protocol_;
    out.applied_ = applied_;
    return out;
  }

  const optimize::Inputs& estimate() const noexcept { return seeker_.estimate(); }
  /// The input of the last ask.
  const optimize::Inputs& applied() const noexcept { return applied_; }
  const optimize::Protocol& protocol() const noexcept { return protocol_; }
  std::size_t component_count() const noexcept { return seeker_.component_count(); }
  std::size_t limit_count() const noexcept { return seeker_.limit_count(); }
  optimize::LimitState limit_state(std::size_t i) const noexcept { return limit_state_of(seeker_, i); }
  double limit_delay(std::size_t i) const noexcept { return limit_delay_of(seeker_, i); }
  double excess(const optimize::Inputs& at) const noexcept { return excess_of(seeker_, at); }
  const auto& settings() const noexcept { return seeker_.settings(); }
  const S& seeker() const noexcept { return seeker_; }
  S& seeker() noexcept { return seeker_; }  ///< for its history
  const GuidePath& path() const noexcept { return path_; }
  /// What the seeker has learnt beside the guide; the whole estimate while there is none.
  optimize::Inputs trim() const noexcept { return seeker_.estimate() - path_.feed_forward(); }

  void require_usable() const {
    path_.require_usable();
    if constexpr (requires { seeker_.require_usable(); }) seeker_.require_usable();
  }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    S::visit(self.seeker_, v);
    Prefixed<V> own{v, "guide."};
    optimize::Protocol::visit(self.protocol_, own);
    own("applied", self.applied_);
    GuidePath::visit(self.path_, own);
  }

 private:
  template <class T>
  friend class FeedForward;

  S seeker_;
  GuidePath path_;
  optimize::Protocol protocol_;
  optimize::Inputs applied_;
};

}  // namespace mgdd::guide
