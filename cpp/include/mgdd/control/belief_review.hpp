// Compares what a plate model has learnt with a belief that has proven itself: both predict, and the squared
// innovations of a sliding plate decide. A belief that predicted better for long is certified; one that soon predicts
// much worse is to be given up for the certified one. Angles in deg, time in s. noexcept, heap-free.
#pragma once

#include <algorithm>
#include <cstdint>

#include "mgdd/common/state.hpp"
#include "mgdd/control/filtered_rate.hpp"

namespace mgdd::control {

struct BeliefReviewSettings {
  double worse = 1.5;         ///< ratio of mean squared innovations from which one predicts worse
  double roll_back_s = 0.05;  ///< of sliding over which a worse belief is given up
  double certify_s = 1.0;     ///< of sliding over which a better one is certified

  bool operator==(const BeliefReviewSettings&) const = default;
};

enum class Verdict { keep, certify, roll_back };

template <class T>
class BeliefReview {
 public:
  /// `noise_deg` of the measured angle: smaller differences decide nothing.
  BeliefReview(const BeliefReviewSettings& s, double sample_s, double noise_deg) noexcept
      : worse_(T(s.worse)),
        noise_(T(noise_deg * noise_deg)),
        short_(s.roll_back_s, sample_s),
        long_(s.certify_s, sample_s) {}

  /// One sample of a sliding plate.
  Verdict judge(T learnt_innovation, T certified_innovation) noexcept {
    const T learnt = learnt_innovation * learnt_innovation, certified = certified_innovation * certified_innovation;
    short_.add(learnt, certified);
    long_.add(learnt, certified);
    if (short_.full() && short_.learnt > worse_ * short_.certified + noise_) return Verdict::roll_back;
    if (long_.full() && long_.certified > worse_ * long_.learnt) return Verdict::certify;
    return Verdict::keep;
  }
  /// After a verdict: both beliefs are one, and begin anew.
  void restart() noexcept {
    short_.restart();
    long_.restart();
  }

  template <class Self, class V>
  static void visit(Self& self, V&& v) {
    v("samples", self.short_.samples, counts_end);
    v("long_samples", self.long_.samples, counts_end);
    visit_number(v, "learnt", self.short_.learnt);
    visit_number(v, "certified", self.short_.certified);
    visit_number(v, "long_learnt", self.long_.learnt);
    visit_number(v, "long_certified", self.long_.certified);
  }

 private:
  // Mean squares with exponential forgetting.
  struct Means {
    Means(double window_s, double sample_s) noexcept
        : share(T(std::min(sample_s / window_s, 1.0))), needed(static_cast<std::int64_t>(window_s / sample_s)) {}
    void add(T of_learnt, T of_certified) noexcept {
      learnt += share * (of_learnt - learnt);
      certified += share * (of_certified - certified);
      samples = std::min(samples + 1, needed);
    }
    bool full() const noexcept { return samples >= needed; }
    void restart() noexcept {
      learnt = certified = T(0.0);
      samples = 0;
    }

    T share;
    std::int64_t needed;
    T learnt{0.0}, certified{0.0};
    std::int64_t samples = 0;
  };

  T worse_, noise_;
  Means short_, long_;
};

}  // namespace mgdd::control
