#include "mgdd/guide/trust.hpp"

#include <algorithm>
#include <cmath>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/enum_names.hpp"

namespace mgdd::guide {
namespace {

constexpr double anything_sd = 1.0;        // of the share, of a guide that is not as good as it was
constexpr double noise_memory = 40.0;      // cycles behind the plane
constexpr double fewest_cycles = 10.0;     // before what is left about it is called noise
constexpr double informative_share = 2.0;  // errors of a reading that a trial must be able to change
constexpr double smallest_trial = 0.05;    // of the move
constexpr double exact_share = 1e-6;       // error of a share where there is no noise
constexpr double least_distance = 0.01;    // of the move, between the two places that were measured
constexpr double refusal_share = 0.9;      // of the trust left after a value that cannot be used
constexpr double unmeasured_share = 0.5;   // ... of the doubt, or of the trust, left after a verdict without curvature

}  // namespace

void validate(const TrustSettings& s) {
  require_within("initial", s.initial, 0.0, 1.0);
  if (s.probe_cycles < 0) throw ParameterError("probe_cycles", s.probe_cycles, "must be >= 0");
  if (s.probe_settling < 0) throw ParameterError("probe_settling", s.probe_settling, "must be >= 0");
  require_positive("prior_sd", s.prior_sd);
  if (!(s.doubt >= 0.0 && s.doubt < 1.0)) throw ParameterError("doubt", s.doubt, "must be in [0, 1)");
  require_in(closed(0.0, unbounded), "curvature_spread", s.curvature_spread);
  require_positive("significance", s.significance);
  if (s.noise_sd) require_positive("noise_sd", *s.noise_sd);
}

Trust::Trust(TrustSettings settings, Eigen::Index inputs)
    : settings_((validate(settings), settings)), plane_(inputs, noise_memory), value_(settings.initial) {}

double Trust::noise_sd() const noexcept {
  if (settings_.noise_sd) return *settings_.noise_sd;
  return noise_variance_ < 0.0 ? std::numeric_limits<double>::quiet_NaN() : std::sqrt(noise_variance_);
}

void Trust::record(const optimize::Inputs& applied, double j) noexcept {
  plane_.record(applied, j);
  const double parameters = static_cast<double>(applied.size()) + 1.0;
  const double n = plane_.cycles();
  if (n >= fewest_cycles) noise_variance_ = plane_.residual_variance() * n / (n - parameters);
}

double Trust::rise_error() const noexcept {
  return noise_sd() * std::sqrt(2.0 / std::max(1, settings_.probe_cycles));
}

double Trust::trial_share(double bend) const noexcept {
  const double error = rise_error();
  if (settings_.probe_cycles == 0 || std::isnan(error)) return 0.0;
  if (!(bend > 0.0)) return 1.0;
  return bend > error ? std::min(1.0, std::max({value_, informative_share * error / bend, smallest_trial})) : 0.0;
}

// Mean of the share after a measurement of it: of the two explanations, weighted by how likely they make it.
double Trust::expected_share(double measured, double variance) const noexcept {
  struct Explanation {
    double sd, probability;
  };
  const double off = measured - value_;
  const auto far = [&](const Explanation& e) { return 0.5 * off * off / (e.sd * e.sd + variance); };
  const Explanation good{settings_.prior_sd, 1.0 - settings_.doubt}, other{anything_sd, settings_.doubt};
  const double least = std::min(far(good), far(other));
  double gain = 0.0, weight = 0.0;
  for (const Explanation& e : {good, other}) {
    const double total = e.sd * e.sd + variance;
    const double likely = e.probability / std::sqrt(total) * std::exp(least - far(e));
    gain += likely * e.sd * e.sd / total;
    weight += likely;
  }
  return value_ + gain / weight * off;
}

double Trust::judge(double rise, double old, double tried, double bend) noexcept {
  if (!(tried - old > least_distance)) return value_;  // the plant did not go there
  const double error = rise_error();
  const bool wrong = rise<-settings_.significance * error, confirmed = rise> settings_.significance * error;
  verdict_ = static_cast<std::int64_t>(wrong ? Verdict::wrong : confirmed ? Verdict::confirmed : Verdict::undecided);
  if (bend > 0.0) {
    const double slope = rise / (bend * (tried - old));
    const double by_noise = std::max(error / (bend * (tried - old)), exact_share);
    const double by_curvature = settings_.curvature_spread * slope;
    const double variance = by_noise * by_noise + by_curvature * by_curvature;
    value_ = std::clamp(expected_share(slope + 0.5 * (old + tried), variance), 0.0, 1.0);
    return value_;
  }
  if (wrong) return condemn();
  if (confirmed) value_ = 1.0 - unmeasured_share * (1.0 - value_);
  return value_;
}

double Trust::condemn() noexcept {
  verdict_ = static_cast<std::int64_t>(Verdict::wrong);
  value_ *= unmeasured_share;
  return 0.0;
}

void Trust::refuse() noexcept {
  value_ *= refusal_share;
}

void Trust::require_usable() const {
  if (!(value_ >= 0.0 && value_ <= 1.0)) throw ParameterError("state column 'trust' must lie in [0, 1]");
}

}  // namespace mgdd::guide
