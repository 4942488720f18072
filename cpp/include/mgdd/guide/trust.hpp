// How far a guide is believed, between 0 and 1: the share of the move that it predicts which measurements confirm.
// At a new operating point J is measured at both ends of the move D, the old place first. Where J is a parabola along
// D with its optimum at the share a,  J(b D) - J(0) = K (a b - b^2/2),  K = -J'' D^2,  so that two readings give a and
// its error. Before, a lies near the trust so far, or, with the probability `doubt`, anywhere; trust is its mean after,
// between 0 and 1. Ours; the curvature is the guide's: the shape of a model is right more often than its optimum.
// J in the unit of the objective, maximised. noexcept and allocation-free after construction.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include "mgdd/optimize/belief/local_model.hpp"

namespace mgdd::guide {

/// What the last test of a guide said: J fell, rose, or did neither by more than the noise.
enum class Verdict { untested, undecided, confirmed, wrong };

struct TrustSettings {
  double initial = 1.0;              ///< before the first test, in [0, 1]
  int probe_cycles = 1;              ///< readings at each end of the move; 0 = never tested
  int probe_settling = 0;            ///< cycles before them that do not count: of a sensor with delay and lag
  double prior_sd = 0.15;            ///< [-] of the share about the trust before, of a guide as good as it was, > 0
  double doubt = 0.1;                ///< [-] probability that it is not, in [0, 1)
  double curvature_spread = 0.2;     ///< [-] relative standard deviation of the guide's curvature
  double significance = 3.0;         ///< standard errors between undecided and a verdict, > 0
  std::optional<double> noise_sd{};  ///< of one reading of J, > 0; none: learnt from the readings
};
void validate(const TrustSettings& settings);

class Trust {
 public:
  /// Throws ParameterError naming the field.
  Trust(TrustSettings settings, Eigen::Index inputs);

  double value() const noexcept { return value_; }
  Verdict verdict() const noexcept { return static_cast<Verdict>(verdict_); }
  const TrustSettings& settings() const noexcept { return settings_; }
  /// Of one reading of J; NaN while it is not known.
  double noise_sd() const noexcept;

  /// One cycle of a search: what is left of J about a plane through the last readings is its noise.
  void record(const optimize::Inputs& applied, double j) noexcept;
  /// A new operating point: the plane is void, the noise is not.
  void forget() noexcept { plane_.forget(); }

  /// Share of the move at which the guide should be tested: its trust, or more where that would show nothing. 0: the
  /// noise hides what the move may change, or is not known. `bend` is K, 0 where the guide does not say its curvature.
  double trial_share(double bend) const noexcept;
  /// Learns from a test: J was higher by `rise` at the share `tried` of the move than at the share `old`, which is 0
  /// unless the plant applied something else. The share of the move to take.
  double judge(double rise, double old, double tried, double bend) noexcept;
  /// The tried place broke a limit that the old one kept: the move is not taken.
  double condemn() noexcept;
  /// The guide gave what cannot be used.
  void refuse() noexcept;

  /// ParameterError for a restored state that cannot be.
  void require_usable() const;

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("trust", self.value_);
    v("verdict", self.verdict_, std::int64_t{4});
    v("noise_variance", self.noise_variance_);
    optimize::LocalModel::visit(self.plane_, v, "plane");
  }

 private:
  double rise_error() const noexcept;
  double expected_share(double measured, double variance) const noexcept;

  TrustSettings settings_;
  optimize::LocalModel plane_;
  double value_;
  std::int64_t verdict_ = 0;
  double noise_variance_ = -1.0;  // below 0: not known
};

}  // namespace mgdd::guide
