// Watches which inputs make a plant fail, as a misfire or a trip does, and keeps a seeker out of them. Four failures
// on one side of what works, with no later success as far out, set an edge there; more are needed where cycles fail by
// chance, as those do that a later success as far out contradicts. From then on no more is asked than
// what has worked, and a seeker learns from that as from a plant that clamps. Beyond the edge one cycle is tried at a
// time, at the edge and half way to it in turn, after a wait that doubles with each failure; what works moves the edge
// or takes it away. Failures of what has just worked as well say nothing of the input: then no edge stays, and other
// inputs that have worked are asked in turn. Inputs in their own units. noexcept and allocation-free.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/ask_tell/reading.hpp"

namespace mgdd::optimize {

class FailureWatch {
 public:
  /// Without `edges` it only counts, for a seeker that keeps out of what fails by itself.
  explicit FailureWatch(Eigen::Index inputs, bool edges = true) noexcept;

  /// Where else to look while nothing has worked yet: the start first, then ever farther from it within the bounds.
  void roam(const Inputs& start, const Inputs& lower, const Inputs& upper) noexcept;

  /// True where every cycle so far has failed, and twelve have.
  bool lost() const noexcept { return !worked_ && failing_everywhere() && start_.size() > 0; }
  /// Where to look then, another place in every cycle.
  Inputs elsewhere() const noexcept;

  /// What to ask of the plant where a seeker wants `wanted`: the same object as long as nothing speaks against it. One
  /// call per cycle.
  const Inputs& admit(const Inputs& wanted) noexcept;
  /// The same for an input that goes to the plant as it is.
  const Inputs& pass(const Inputs& input) noexcept;
  /// Another input than `admit` gave, where that cannot be set.
  const Inputs& settle(const Inputs& input, const Inputs& wanted) noexcept;
  /// What `admit` gave last where it differs from what was wanted; nullptr where it was the same.
  const Inputs* instead() const noexcept { return differs_ ? &sent_ : nullptr; }
  /// What `admit` or `pass` gave last.
  const Inputs& sent() const noexcept { return sent_; }
  /// The input of the last cycle where it is the first that has ever worked, and not what was wanted; else nullptr.
  const Inputs* found() const noexcept { return found_ ? &sent_ : nullptr; }

  /// What became of the input that `admit` gave.
  void worked() noexcept;
  void failed() noexcept;

  /// The nearest input, per input, that is known to fail on the upper and the lower side; infinite: none.
  Inputs failing_above() const noexcept { return edge(0); }
  Inputs failing_below() const noexcept { return -edge(1); }
  /// True after so many failures in a row that other inputs have failed as well, or none has worked yet.
  bool failing_everywhere() const noexcept;
  /// `input` moved to where no edge is beyond.
  Inputs keep(const Inputs& input) const noexcept;
  /// A new operating point: the edges are void. What has worked is kept as somewhere to go back to.
  void forget() noexcept;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("failing_sent", self.sent_);
    v("failing_differs", self.differs_);
    v("failing_good", self.good_);
    v("failing_worked", self.worked_);
    v("failing_in_a_row", self.in_a_row_, counts_end);
    v("failing_probe", self.probe_, std::int64_t{-1}, 2 * self.sent_.size());
    v("failing_cycles", self.cycles_);
    v("failing_by_chance", self.by_chance_);
    v("failing_side", self.failures_.side);
    v("failing_at", self.failures_.at);
    v("failing_since", self.failures_.since);
    for (std::size_t s = 0; s < 2; ++s) {
      const std::string name = s == 0 ? "failing_above_" : "failing_below_";
      v(name + "farthest", self.sides_[s].farthest);
      v(name + "reach", self.sides_[s].reach);
      v(name + "edge", self.sides_[s].edge);
      v(name + "wait", self.sides_[s].wait);
      v(name + "held", self.sides_[s].held);
      v(name + "again", self.sides_[s].again);
    }
  }

 private:
  struct Side {         // inputs times +1 (upper) or -1 (lower side)
    Inputs farthest;    // that has ever worked
    Inputs reach;       // the same of late: less where an edge has come nearer
    Inputs edge;        // the nearest that is known to fail
    Inputs wait, held;  // cycles until the next try beyond, and how many have passed
    Inputs again;       // 1: that one is at the edge itself
  };
  struct Failures {  // the last ones that no later success contradicts, newest last
    using Column = std::array<double, 24>;
    Column side;   // 2 i + side; -1: none
    Column at;     // input times sign of the side
    Column since;  // the farthest on that side that has worked later
  };
  Inputs edge(std::size_t side) const noexcept;
  Inputs middle() const noexcept { return 0.5 * (sides_[0].reach - sides_[1].reach); }
  void count_cycle() noexcept;
  /// The nearest place on this side from which on more have failed, and none worked since, than chance explains.
  double fails_from(double side) const noexcept;
  void set_edge(Side& side, Eigen::Index i, double failing, double good) noexcept;

  bool edges_;
  std::array<Side, 2> sides_;
  Inputs sent_, good_;
  Inputs start_{}, lower_{}, upper_{};  // of the space; empty: not known
  bool found_ = false;                  // by the last cycle
  bool differs_ = false;
  bool worked_ = false;        // anything at all
  std::int64_t in_a_row_ = 0;  // failures
  double cycles_ = 0.0;        // of late
  double by_chance_ = 0.0;     // of them, those that failed where a later one worked
  Failures failures_{};
  std::int64_t probe_ = -1;  // 2 i + side while a try beyond the edge of input i is out, else -1
};

}  // namespace mgdd::optimize
