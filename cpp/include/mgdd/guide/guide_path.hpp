// What a feed-forward keeps in mind: what the guide said, which of its moves are in force, and the test under way.
// Inputs in their own unit. noexcept and allocation-free after construction.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "mgdd/guide/trust.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/limits/constraint_filter.hpp"

namespace mgdd::guide {

enum class GuideCause { new_point, following, calibration };

/// followed: taken; refused: not finite, out of bounds, of another size; busy: between ask and tell.
enum class GuideStatus { followed, refused, busy };

/// What a guide says of one operating point.
struct GuideValue {
  optimize::Inputs optimum;
  optimize::Inputs curvature{};  ///< J'' of the maximised objective per input, < 0 [unit of J / squared unit of the
                                 ///< input]; empty: not known
};

struct FeedForwardSettings {
  optimize::Inputs calibration_rate{};  ///< per cycle and input, > 0; empty: 1
  double following_share = 0.2;         ///< of what the guide is ahead while the point drifts, per cycle, in (0, 1]
  TrustSettings trust{};
};

/// Largest share in [0, 1] of `move` that stays within the bounds.
double share_within(const optimize::Inputs& from, const optimize::Inputs& move,
                    const optimize::SearchSpace& space) noexcept;
/// Worst scaled excess over the limits, at most 0 where all are kept.
double worst_excess(const std::vector<optimize::Limit>& limits, std::span<const double> values) noexcept;

/// The bookkeeping of one feed-forward: what the guide said, what is in force, and the test under way.
class GuidePath {
 public:
  GuidePath(FeedForwardSettings settings, Eigen::Index inputs);

  /// What the seeker has to do about a value of the guide.
  struct Order {
    GuideStatus status;
    bool restart = false;
    optimize::Inputs move{};  ///< of the estimate; empty: none
  };
  Order take(const GuideValue& value, GuideCause cause, const optimize::Inputs& estimate,
             const optimize::SearchSpace& space) noexcept;

  /// A new operating point without a value.
  void open() noexcept {
    open_ = known_;
    trust_.forget();
  }

  bool known() const noexcept { return known_; }  ///< has a valid value been taken?
  bool testing() const noexcept { return stage_ > 0; }
  bool at_trial() const noexcept { return stage_ > side(); }  ///< of a test: at the new place, not at the old one
  optimize::Inputs test_input(const optimize::Inputs& estimate) const noexcept;

  /// One reading of a test, `away` from the estimate; the move of the estimate after the last one, else empty.
  optimize::Inputs tested(double j, double excess, const optimize::Inputs& away) noexcept;
  /// One reading of the search.
  void searched(const optimize::Inputs& applied, double j) noexcept { trust_.record(applied, j); }
  /// Of what the guide is ahead since the point has drifted, the part that the estimate moves in this cycle; empty:
  /// none.
  optimize::Inputs follow() noexcept;
  /// One more cycle: a calibration goes on.
  void advance() noexcept;

  const optimize::Inputs& feed_forward() const noexcept { return feed_forward_; }
  const optimize::Inputs& guide() const noexcept { return target_; }  ///< its last valid optimum
  const Trust& trust() const noexcept { return trust_; }
  const FeedForwardSettings& settings() const noexcept { return settings_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("guide", self.guide_);
    v("target", self.target_);
    v("feed_forward", self.feed_forward_);
    v("pending", self.pending_);
    v("move", self.move_);
    v("bend", self.bend_);
    v("tried", self.tried_);
    v("test_stage", self.stage_, 2 * self.side() + 1);
    v("test_sums", self.sums_);
    v("guided", self.known_);
    v("open_point", self.open_);
    Trust::visit(self.trust_, v);
  }
  void require_usable() const { trust_.require_usable(); }

 private:
  std::int64_t side() const noexcept;
  optimize::Inputs trusted(double share) noexcept;

  FeedForwardSettings settings_;
  Trust trust_;
  optimize::Inputs guide_, feed_forward_;  // guide_: as far as it has been followed
  optimize::Inputs target_;                // what the guide said last
  optimize::Inputs pending_;               // of a calibration, still to be taken over by the trim
  optimize::Inputs move_;                  // of the guide, under test
  double bend_ = 0.0, tried_ = 0.0;
  std::int64_t stage_ = 0;        // cycle of the test from 1 on; 0 = none
  std::array<double, 6> sums_{};  // J, excess and share of the move, at the old place and at the trial
  bool known_ = false;
  bool open_ = false;  // a new operating point for which no valid value has come yet
};

}  // namespace mgdd::guide
