#include "mgdd/optimize/laws/golden_section.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/text.hpp"

namespace mgdd::optimize {
namespace {

constexpr double golden = 0.38196601125010515;  // (3 - sqrt 5)/2
constexpr std::size_t ring = 256;               // samples behind the parabola
constexpr double reach_share = 0.3;             // of the bracket: how far the refinement looks to both sides
constexpr double near_widths = 1.5;             // from the middle: samples beyond do not shape the parabola
constexpr double first_samples = 2.0;           // of each point before chance is judged
constexpr double bad_scatter = 3.0;             // times noise_sd, of four readings by chance once in 10,000
constexpr double limit_samples = 4.0;           // ... before a limit decides: its noise is not known
constexpr double widest_share = 0.2;            // of the first bracket: the refinement looks no wider
constexpr double width_rate = 0.05;             // how fast the width follows what the parabola says, per triple
constexpr double narrow_share = 0.25;           // of its width, while a limit holds the refinement back
constexpr double least_distance = 0.1;          // of the asked one: two points nearer to each other are one
constexpr double bracket_tolerance = 0.02;      // of the scale of its input
constexpr std::int64_t last_draws = 2;          // in a row: the bracket is as small as the noise allows

GoldenSectionSettings checked(GoldenSectionSettings s) {
  s.space = resolved(std::move(s.space));
  if (s.space.size() != 1) {
    throw about("start",
                ShapeError("start has " + std::to_string(s.space.size()) + " entries: golden section takes one input"));
  }
  validate(s.space, scalar_input(0.0));
  for (const auto& [name, value] : {std::pair{"lower", s.space.lower[0]}, std::pair{"upper", s.space.upper[0]}}) {
    if (!std::isfinite(value)) {
      throw ParameterError(name, value, "must be finite, the bracket starts there");
    }
  }
  if (!(s.noise_sd >= 0.0 && std::isfinite(s.noise_sd))) {
    throw ParameterError("noise_sd", s.noise_sd, "must be >= 0 and finite");
  }
  require_positive("significance", s.significance);
  if (s.tolerance == 0.0) s.tolerance = bracket_tolerance * scale_of(s.space)[0];
  require_positive("tolerance", s.tolerance);
  if (s.samples_max < 1) throw ParameterError("samples_max", s.samples_max, "must be >= 1");
  return s;
}

}  // namespace

GoldenSection::GoldenSection(GoldenSectionSettings settings)
    : SeekerCore(checked(std::move(settings)), [](const GoldenSectionSettings&) { return 20.0; }),
      lower_(settings_.space.lower[0]),
      upper_(settings_.space.upper[0]),
      width_(upper_ - lower_),
      sample_input_(ring, 0.0),
      sample_j_(ring, 0.0) {}

double GoldenSection::inner(std::size_t p) const noexcept {
  return lower_ + (p == 0 ? golden : 1.0 - golden) * (upper_ - lower_);
}

const Inputs& GoldenSection::ask() noexcept {
  if (!refining_) {
    applied_[0] = inner(static_cast<std::size_t>(turn_));
  } else if (settings_.noise_sd > 0.0) {
    applied_[0] = estimate_[0] + (1.0 - static_cast<double>(turn_)) * reach_share * (upper_ - lower_);
    applied_[0] = std::clamp(applied_[0], settings_.space.lower[0], settings_.space.upper[0]);
  } else {
    applied_ = estimate_;
  }
  return send();
}

void GoldenSection::learn(const Reading& reading, const Inputs& applied) noexcept {
  const double j = objective_of(reading, settings_.maximize) + filter_.shaping(applied, reading.limits);
  const auto slot = static_cast<std::size_t>(samples_++) % ring;
  sample_input_[slot] = applied[0];
  sample_j_[slot] = j;
  if (refining_) {
    clamp_.record(applied_, applied, estimate_);
    turn_ = (turn_ + 1) % 3;
    if (turn_ == 0) clamp_.close_window();
    if (turn_ == 0 && settings_.noise_sd > 0.0) refine();
    return;
  }
  if (!clamp_.arrived(applied_, applied, scalar_input(0.5 * (lower_ + upper_)))) return;
  Point& point = points_[static_cast<std::size_t>(turn_)];
  const double from_mean = point.count > 0.0 ? j - point.sum / point.count : 0.0;
  point.squares += from_mean * from_mean * point.count / (point.count + 1.0);
  point.count += 1.0;
  point.sum += j;
  point.missed += applied[0] - applied_[0];
  judge(point, reading);
  next_turn();
  decide();
}

// Limits that come late say something of a point only after it was measured for as long as they take.
void GoldenSection::judge(Point& point, const Reading& reading) noexcept {
  stayed_ = applied_[0] == last_asked_ ? stayed_ + 1 : 0;
  last_asked_ = applied_[0];
  if (limit_count() == 0 || stayed_ < filter_.settling()) return;
  double worst = -unlimited;
  for (std::size_t i = 0; i < limit_count(); ++i) {
    const Limit& limit = filter_.limits()[i];
    worst = std::max(worst, (reading.limits[i] + filter_.margin(i) - limit.upper) / limit.scale);
  }
  point.least = point.judged > 0.0 ? std::min(point.least, worst) : worst;
  point.most = point.judged > 0.0 ? std::max(point.most, worst) : worst;
  point.excess += worst;
  point.judged += 1.0;
}

// Mean of what was read, without the least and the most of enough of them: one may be bad.
double GoldenSection::excess_at(const Point& point) noexcept {
  if (point.judged < limit_samples) return point.excess / point.judged;
  return (point.excess - point.least - point.most) / (point.judged - 2.0);
}

// In turns; but where limits come late, one point until they have judged it.
void GoldenSection::next_turn() noexcept {
  turn_ = points_[0].count <= points_[1].count ? 0 : 1;
  if (filter_.settling() == 0) return;
  const double enough = settings_.noise_sd == 0.0 ? 1.0 : limit_samples;
  const bool now_at_second = last_asked_ == inner(1);
  for (const std::int64_t p : {std::int64_t{now_at_second ? 1 : 0}, std::int64_t{now_at_second ? 0 : 1}}) {
    if (points_[static_cast<std::size_t>(p)].judged >= enough) continue;
    turn_ = p;
    return;
  }
}

// What decides, in this order: that the plant applies both points as one; a limit broken at either point, by the lesser
// excess; J, if it differs by more than chance.
void GoldenSection::decide() noexcept {
  const bool exact = settings_.noise_sd == 0.0;
  const double n = std::min(points_[0].count, points_[1].count);
  const auto mean = [](double sum, const Point& p) { return sum / p.count; };
  if (n < 1.0) return;
  const double asked = inner(1) - inner(0);
  const double missed = mean(points_[1].missed, points_[1]) - mean(points_[0].missed, points_[0]);
  if (asked + missed < least_distance * asked) {               // both are applied as one: the plant does not go there
    if (points_[0].missed > 0.0 && points_[1].missed < 0.0) {  // it stands between them: they are finer than its steps
      draws_ = last_draws;
      return cut(inner(0), inner(1));
    }
    draws_ = 0;
    return points_[0].missed + points_[1].missed > 0.0 ? cut(inner(0), upper_) : cut(lower_, inner(1));
  }
  if (n < (exact ? 1.0 : first_samples)) return;
  const double judged = std::min(points_[0].judged, points_[1].judged);
  const double enough = filter_.settling() > 0 && !exact ? limit_samples : 1.0;
  if (limit_count() > 0 && judged < enough) return;
  const double over0 = limit_count() > 0 ? excess_at(points_[0]) : 0.0;
  const double over1 = limit_count() > 0 ? excess_at(points_[1]) : 0.0;
  if (std::max(over0, over1) > 0.0) {
    if (!exact && judged < limit_samples) return;
    draws_ = 0;
    return over0 > over1 ? cut(inner(0), upper_) : cut(lower_, inner(1));
  }
  const double rise = mean(points_[1].sum, points_[1]) - mean(points_[0].sum, points_[0]);
  // Readings of one point that lie further apart than the noise lets them: one of them is bad, and which is unknown.
  const double scatter =
      std::sqrt((points_[0].squares + points_[1].squares) / std::max(1.0, points_[0].count + points_[1].count - 2.0));
  const double sd = scatter > bad_scatter * settings_.noise_sd ? scatter : settings_.noise_sd;
  const double error = sd * std::sqrt(1.0 / points_[0].count + 1.0 / points_[1].count);
  if (exact ? rise != 0.0 : std::abs(rise) > settings_.significance * error) {  // alike to the last bit says nothing
    draws_ = 0;
    return rise > 0.0 ? cut(inner(0), upper_) : cut(lower_, inner(1));
  }
  if (n < settings_.samples_max) return;
  ++draws_;
  const double end = 0.5 * golden * (upper_ - lower_);
  cut(lower_ + end, upper_ - end);
}

// The new bracket; a point of the old one that is an inner point again keeps its measurements.
void GoldenSection::cut(double lower, double upper) noexcept {
  const bool keeps_right = lower > lower_ && upper == upper_;
  const bool keeps_left = upper < upper_ && lower == lower_;
  const std::array<Point, 2> old = points_;
  points_ = {};
  if (keeps_right) points_[0] = old[1];
  if (keeps_left) points_[1] = old[0];
  lower_ = lower;
  upper_ = upper;
  next_turn();
  const Parabola fit = parabola();
  estimate_[0] = std::clamp(fit.vertex, lower_, upper_);
  const bool exact = settings_.noise_sd == 0.0;
  refining_ = upper_ - lower_ <= settings_.tolerance || (!exact && draws_ >= last_draws);
  if (!refining_) return;
  turn_ = 0;
  if (exact) {  // to the side that no limit forbids, as often as it takes to know that there is none
    const Inputs none = scalar_input(0.0), width = scalar_input(upper_ - lower_);
    for (int k = 0; k < 3; ++k) {
      const Inputs back =
          filter_.project(estimate_, none, {settings_.space, none, none, width, width, InputMatrix::Ones(1, 1)});
      move_within(estimate_, back, settings_.space, none);
    }
    return;
  }
  // Ends that lie less than the noise below the top tell nothing: wide enough that they lie one noise_sd below.
  const double wide = fit.bend < 0.0 ? std::sqrt(8.0 * settings_.noise_sd / -fit.bend) : 0.0;
  const double most = widest_share * (settings_.space.upper[0] - settings_.space.lower[0]);
  width_ = std::min(most, std::max(upper_ - lower_, wide));
  centre_bracket(width_);
}

// Of the parabola through the samples near the bracket; its middle and bend 0 where they do not bend down.
GoldenSection::Parabola GoldenSection::parabola() const noexcept {
  const double middle = 0.5 * (lower_ + upper_);
  const double width = upper_ - lower_;
  // Sums of powers: as a matrix in the loop they would go through memory at every sample.
  double n0 = 0.0, n1 = 0.0, n2 = 0.0, n3 = 0.0, n4 = 0.0, r0 = 0.0, r1 = 0.0, r2 = 0.0;
  const auto n = std::min(static_cast<std::size_t>(samples_), ring);
  for (std::size_t k = 0; k < n; ++k) {
    const double x = (sample_input_[k] - middle) / width;
    if (std::abs(x) > near_widths) continue;
    const double square = x * x;
    const double j = sample_j_[k] - sample_j_[0];
    n0 += 1.0;
    n1 += x;
    n2 += square;
    n3 += x * square;
    n4 += square * square;
    r0 += j;
    r1 += x * j;
    r2 += square * j;
  }
  const Eigen::Matrix3d normal{{n0, n1, n2}, {n1, n2, n3}, {n2, n3, n4}};
  const Eigen::Vector3d right(r0, r1, r2);
  const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
  if (!(factor.vectorD().minCoeff() > 1e-9 * factor.vectorD().maxCoeff())) return {middle, 0.0};
  const Eigen::Vector3d c = factor.solve(right);
  if (!(c[2] < 0.0)) return {middle, 0.0};
  return {middle - 0.5 * c[1] / c[2] * width, 2.0 * c[2] / (width * width)};
}

// After three measurements: the estimate follows the vertex, slowly, with limits kept for both sides; the bracket goes
// with it and grows or shrinks until its ends lie one noise_sd below the top, or until a bend shows at all.
void GoldenSection::refine() noexcept {
  const double reach = reach_share * (upper_ - lower_);
  const Parabola fit = parabola();
  Inputs step = scalar_input(fit.vertex - estimate_[0]);
  clip_each(step, scalar_input(0.25 * reach));
  const Inputs none = scalar_input(0.0), side = scalar_input(reach);
  step = filter_.project(estimate_, step, {settings_.space, none, side, side, side, InputMatrix::Ones(1, 1)});
  move_within(estimate_, step, settings_.space, scalar_input(0.0), clamp_);
  const double most = widest_share * (settings_.space.upper[0] - settings_.space.lower[0]);
  const double wide = fit.bend < 0.0 ? std::sqrt(8.0 * settings_.noise_sd / -fit.bend) : most;
  width_ += width_rate * (std::clamp(wide, settings_.tolerance, most) - width_);
  const double target = filter_.active() ? narrow_share * width_ : width_;
  centre_bracket(upper_ - lower_ + 0.1 * (target - (upper_ - lower_)));
}

// Same distance to both sides of the estimate: one that leaned would pull the estimate its way.
void GoldenSection::centre_bracket(double width) noexcept {
  lower_ = estimate_[0] - 0.5 * width;
  upper_ = estimate_[0] + 0.5 * width;
}

void GoldenSection::restart() noexcept {
  lower_ = settings_.space.lower[0];
  upper_ = settings_.space.upper[0];
  points_ = {};
  turn_ = 0;
  draws_ = 0;
  samples_ = 0;
  refining_ = false;
  forget();
}

// A bracket that still covers the range stays: what the range holds does not move.
void GoldenSection::shift_estimate(const Inputs& by) noexcept {
  const double before = estimate_[0];
  move_within(estimate_, by, settings_.space, scalar_input(0.0));
  if (!refining_) return;
  centre_bracket(upper_ - lower_);
  for (double& x : sample_input_)
    x += estimate_[0] - before;
}

}  // namespace mgdd::optimize
