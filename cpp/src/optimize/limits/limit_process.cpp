#include "mgdd/optimize/limits/limit_process.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace mgdd::optimize {
namespace {

constexpr double least_share = 1e-3;   // of a limit, that a reading counts as at least
constexpr double clear_of_zero = 3.0;  // sd of a reading there, above which the logarithm of a reading has a scatter
constexpr double expected_bend = 3.0;  // in scales of the limit: few readings must not promise too much
constexpr double calm = 0.1;           // over what is expected of J: limits wander less, or are seen to
constexpr double calm_sd = 2.0;        // logarithm

double learnt_of(const Limit& limit, bool logarithm, double value) noexcept {
  if (!logarithm) return value;
  return limit.upper * (1.0 + std::log(std::max(value / limit.upper, least_share)));
}
double read_of(const Limit& limit, bool logarithm, double learnt) noexcept {
  return logarithm ? limit.upper * std::exp(learnt / limit.upper - 1.0) : learnt;
}

// Not where it comes as near to zero as its noise.
bool stands_above_zero(const Limit& limit, double lowest, double noise_sd) noexcept {
  return limit.upper > 0.0 && lowest > std::max(clear_of_zero * noise_sd, least_share * limit.upper);
}
bool above_zero(const Limit& limit, const Surface& guide, double spans) {
  if (guide.empty()) return limit.upper > 0.0;
  const auto [least, most] = std::ranges::minmax(guide.values());
  return stands_above_zero(limit, least, 0.0) && most >= spans * least;
}

ProcessModel::Settings settings_of(const Limit& limit, ProcessModel::Settings out, const Surface& guide,
                                   bool logarithm) {
  out.bends_down = false;
  out.bend = expected_bend * limit.scale;
  out.wander = calm;
  out.wander_sd = calm_sd;
  if (guide.empty()) return out;
  std::vector<double> values = guide.values();
  for (double& value : values)
    value = learnt_of(limit, logarithm, value);
  out.guide.surface = Surface(guide.axes(), std::move(values));
  return out;
}

}  // namespace

LimitProcess::LimitProcess(const Limit& limit, ProcessModel::Settings settings, const Surface& guide,
                           Eigen::Index freedom, double spans)
    : limit_(limit),
      guided_(!guide.empty()),
      logarithm_(above_zero(limit, guide, spans)),
      freedom_(freedom),
      model_(settings_of(limit, std::move(settings), guide, logarithm_)) {}

// The form follows the readings; with a guide it stays that of the guide.
void LimitProcess::record(const Inputs& z, double value, const Inputs& about, double readings, double sd) noexcept {
  const bool was = logarithm_;
  if (was) sd /= std::max(value / limit_.upper, least_share);
  model_.scattered(sd, readings);
  model_.record(z, learnt_of(limit_, was, value), about, readings);
  if (guided_) return;
  // In a logarithm what lies near zero looks like an outlier: there the new reading counts, and is weighed without it.
  const double lowest = std::min(read_of(limit_, was, model_.lowest()), was ? value : unlimited);
  double noise = 0.0;
  if (model_.count() > model_.fewest() + 1) noise = model_.noise_sd() * (was ? lowest / limit_.upper : 1.0);
  const bool now = stands_above_zero(limit_, lowest, was ? noise : 2.0 * noise);
  if (now == was) return;
  model_.retell([&](double told) { return learnt_of(limit_, now, read_of(limit_, was, told)); });
  logarithm_ = now;
}

double LimitProcess::sd(int point) const noexcept {
  return model_.widening(freedom_) * model_.sd(point) / limit_.scale;
}

double LimitProcess::excess(int point, double quantile) const noexcept {
  const double sd = quantile == 0.0 ? 0.0 : model_.sd(point);
  return (model_.mean(point) + quantile * model_.widening(freedom_) * sd + limit_.margin - limit_.upper) / limit_.scale;
}

}  // namespace mgdd::optimize
