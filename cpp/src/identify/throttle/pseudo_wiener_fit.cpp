#include "mgdd/identify/throttle/pseudo_wiener_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Dense>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/identify/output_error.hpp"
#include "mgdd/math/latin_hypercube.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::identify {
namespace {

using throttle::PseudoWienerKind;
using throttle::PwP;
using throttle::PwR;
using throttle::PwW;

constexpr std::size_t numbers_per_side = 7;
constexpr std::string_view above_prefix = "above_";
const std::vector<std::string> pw_r_default{"tau_s", "gain_deg_per_s2_per_duty", "preload_duty", "spring_duty_per_deg",
                                            "coulomb_duty"};

optimize::Parameter parameter_of(const FieldInfo& field, std::string_view name) {
  return {std::string(name), field.domain.lower, field.domain.upper, field.domain.log_scaled};
}

std::vector<PseudoWienerUnknown> unknowns(const PwR&, const PseudoWienerFitOptions& o) {
  const auto rows = throttle::fields(PseudoWienerKind::pw_r);
  const std::size_t limp_home = rows.size() - 1;
  std::vector<PseudoWienerUnknown> out;
  for (const std::string& name : o.free.empty() ? pw_r_default : o.free) {
    if (name == rows[limp_home].name) {
      out.push_back({parameter_of(rows[limp_home], name), {limp_home}});
      continue;
    }
    std::size_t at = 0;
    while (at < numbers_per_side && rows[at].name.substr(above_prefix.size()) != name)
      ++at;
    if (at == numbers_per_side) throw about("free", ParameterError("free: '" + name + "' is not a parameter of pw_r"));
    const std::size_t below = at + numbers_per_side;
    if (o.sides == Sides::shared) {
      out.push_back({parameter_of(rows[at], name), {at, below}});
    } else {
      if (o.sides != Sides::below) out.push_back({parameter_of(rows[at], rows[at].name), {at}});
      if (o.sides != Sides::above) out.push_back({parameter_of(rows[below], rows[below].name), {below}});
    }
  }
  return out;
}

std::vector<PseudoWienerUnknown> by_name(PseudoWienerKind kind, std::size_t n_default,
                                         const PseudoWienerFitOptions& o) {
  const auto rows = throttle::fields(kind);
  std::vector<PseudoWienerUnknown> out;
  if (o.free.empty()) {
    for (std::size_t i = 0; i < n_default; ++i)
      out.push_back({parameter_of(rows[i], rows[i].name), {i}});
    return out;
  }
  for (const std::string& name : o.free) {
    const auto found = std::ranges::find(rows, name, &FieldInfo::name);
    if (found == rows.end()) {
      throw about("free", ParameterError("free: '" + name + "' is not a parameter of " + std::string(name_of(kind))));
    }
    out.push_back({parameter_of(*found, name), {static_cast<std::size_t>(found - rows.begin())}});
  }
  return out;
}
std::vector<PseudoWienerUnknown> unknowns(const PwW&, const PseudoWienerFitOptions& o) {
  return by_name(PseudoWienerKind::pw_w, throttle::n_pw_w - 1, o);
}
std::vector<PseudoWienerUnknown> unknowns(const PwP& p, const PseudoWienerFitOptions& o) {
  return by_name(PseudoWienerKind::pw_p, 3 + 2 * static_cast<std::size_t>(p.plays), o);
}

/// The five numbers of one side are one pass, those of both are another.
template <class P>
using Residual = OutputError<throttle::PseudoWienerFamily<P>, dynamics::Passes<5, 10>>;

template <class P>
Residual<P> residual_of(const std::vector<ThrottleRecord>& logs, const P& base,
                        const std::vector<PseudoWienerUnknown>& unknowns) {
  std::vector<SimulationRecord> records;
  for (const ThrottleRecord& log : logs) {
    records.push_back({.dt_s = base.frame.sample_s,
                       .input = log.duty,
                       .output = log.angle_deg,
                       .start = {log.angle_deg.front()},
                       .free_start = {},
                       .weight = {}});
  }
  std::vector<SharedNumbers> free;
  for (const PseudoWienerUnknown& unknown : unknowns)
    free.push_back(unknown.numbers);
  typename Residual<P>::Parameters numbers{};
  const auto places = throttle::numbers(base);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    numbers[i] = *places[i];
  return {{base}, numbers, std::move(free), std::move(records)};
}

/// The model at the unknowns x.
template <class P>
P model_at(const Residual<P>& residual, const Eigen::VectorXd& x) {
  P p = residual.family().base;
  const auto numbers = residual.parameters(x);
  const auto places = throttle::numbers(p);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    *places[i] = numbers[i];
  return p;
}

double between(double share, double lower, double upper) {
  return lower * std::pow(upper / lower, share);
}

/// Output of the two lags and, for PW-P, of the play, over all records.
template <class P>
Eigen::VectorXd inner_signal(const P& p, const std::vector<ThrottleRecord>& records, Eigen::Index n) {
  const auto model = throttle::model_of(p);
  Eigen::VectorXd x(n);
  Eigen::Index row = 0;
  for (const ThrottleRecord& record : records) {
    auto state = model.at_rest(record.angle_deg.front(), 0.0);
    dynamics::run(
        model, state, record.duty.size(), [&](std::size_t k) { return record.duty[k]; },
        [&](std::size_t, double) {
          if constexpr (std::is_same_v<P, PwP>) {
            x[row++] = state.play_duty[0];
          } else {
            x[row++] = state.second_duty;
          }
          return true;
        });
  }
  return x;
}

Eigen::VectorXd measured(const std::vector<ThrottleRecord>& records, Eigen::Index n) {
  Eigen::VectorXd y(n);
  Eigen::Index row = 0;
  for (const ThrottleRecord& record : records) {
    for (const double angle : record.angle_deg)
      y[row++] = angle;
  }
  return y;
}

/// Starts of PW-R: the grid tau {30, 10, 20, 40 ms} x preload {0.1, 0.05, 0.15, 0.3}, the rest at common values.
std::vector<PwR> starts(const PwR& base, const std::vector<ThrottleRecord>&, Eigen::Index,
                        const PseudoWienerFitOptions& o, int count) {
  constexpr std::array<double, 4> taus{0.03, 0.01, 0.02, 0.04};
  constexpr std::array<double, 4> preloads{0.1, 0.05, 0.15, 0.3};
  std::vector<PwR> out;
  for (int i = 0; i < count; ++i) {
    PwR p = base;
    const auto at = static_cast<std::size_t>(i);
    for (auto* side : {&p.above, &p.below}) {
      if ((side == &p.above && o.sides == Sides::below) || (side == &p.below && o.sides == Sides::above)) continue;
      side->tau_s = taus[at % 4];
      side->gain_deg_per_s2_per_duty = 5e4;
      side->preload_duty = preloads[(at / 4 + at) % 4];
      side->spring_duty_per_deg = at % 2 == 0 ? 1e-3 : 5e-3;
      side->coulomb_duty = 0.05;
    }
    out.push_back(p);
  }
  return out;
}

/// Starts of PW-W: both lags by a Latin hypercube over 3 ms to 3 s, the map by linear least squares behind them.
std::vector<PwW> starts(const PwW& base, const std::vector<ThrottleRecord>& records, Eigen::Index n,
                        const PseudoWienerFitOptions& o, int count) {
  const Eigen::MatrixXd cube = latin_hypercube(static_cast<std::size_t>(count), 2, o.seed);
  const Eigen::VectorXd y = measured(records, n);
  constexpr int knots = throttle::wiener_knots;
  const double width = (base.knot_upper_duty - base.knot_lower_duty) / (knots - 1);
  std::vector<PwW> out;
  for (int i = 0; i < count; ++i) {
    PwW p = base;
    p.first_s = between(cube(i, 0), 3e-3, 3.0);
    p.second_s = between(cube(i, 1), 3e-3, 3.0);
    p.base_deg = 0.0;
    p.rise_deg.fill(10.0);
    const Eigen::VectorXd x = inner_signal(p, records, n);
    Eigen::Matrix<double, knots, knots> normal = Eigen::Matrix<double, knots, knots>::Identity() * (1e-4 * double(n));
    Eigen::Matrix<double, knots, 1> right = Eigen::Matrix<double, knots, 1>::Constant(1e-3 * double(n));
    for (Eigen::Index k = 0; k < n; ++k) {
      Eigen::Matrix<double, knots, 1> row;
      row[0] = 1.0;
      for (int j = 1; j < knots; ++j)
        row[j] = std::clamp((x[k] - base.knot_lower_duty) / width - (j - 1), 0.0, 1.0);
      normal += row * row.transpose();
      right += row * y[k];
    }
    const Eigen::Matrix<double, knots, 1> map = normal.ldlt().solve(right);
    p.base_deg = std::clamp(map[0], -100.0, 100.0);
    for (int j = 1; j < knots; ++j)
      p.rise_deg[static_cast<std::size_t>(j - 1)] = std::clamp(map[j], 1.0, 300.0);
    out.push_back(p);
  }
  return out;
}

/// Starts of PW-P: lags and width of the play by a Latin hypercube, offset and gain by linear least squares.
std::vector<PwP> starts(const PwP& base, const std::vector<ThrottleRecord>& records, Eigen::Index n,
                        const PseudoWienerFitOptions& o, int count) {
  const Eigen::MatrixXd cube = latin_hypercube(static_cast<std::size_t>(count), 3, o.seed);
  const Eigen::VectorXd y = measured(records, n);
  std::vector<PwP> out;
  for (int i = 0; i < count; ++i) {
    PwP p = base;
    p.first_s = between(cube(i, 0), 3e-3, 3.0);
    p.second_s = between(cube(i, 1), 3e-3, 3.0);
    p.radius_duty.fill(0.0);
    p.gain_deg_per_duty.fill(0.0);
    p.radius_duty[0] = 0.002 + 0.12 * cube(i, 2) * cube(i, 2);
    p.gain_deg_per_duty[0] = 100.0;
    const Eigen::VectorXd x = inner_signal(p, records, n);
    const double mean_x = x.mean();
    const double spread = (x.array() - mean_x).square().sum();
    const double slope = ((x.array() - mean_x) * (y.array() - y.mean())).sum() / (spread + 1e-9 * double(n));
    const double gain = std::clamp(slope, 20.0, 3000.0);
    p.offset_deg = std::clamp(y.mean() - gain * mean_x - p.limp_home_deg, -200.0, 200.0);
    for (std::size_t j = 0; j < static_cast<std::size_t>(p.plays); ++j) {
      p.radius_duty[j] = p.radius_duty[0] * (1.0 + double(j));
      p.gain_deg_per_duty[j] = gain / p.plays;
    }
    out.push_back(p);
  }
  return out;
}

template <class P>
std::vector<P> variants(const P& base, const PseudoWienerFitOptions& o) {
  std::vector<P> out;
  for (const double delay : o.delays) {
    P p = base;
    p.frame.delay_samples = delay;
    if constexpr (!std::is_same_v<P, PwR>) {
      if (o.try_lag_starts) {
        for (const auto start : {throttle::LagStart::rest, throttle::LagStart::inverse_map}) {
          p.lag_start = start;
          out.push_back(p);
        }
        continue;
      }
    }
    out.push_back(p);
  }
  return out;
}

template <class P>
PseudoWienerFit fit(const std::vector<ThrottleRecord>& records, const P& base, const PseudoWienerFitOptions& o) {
  const std::vector<PseudoWienerUnknown> free = unknowns(base, o);
  std::vector<optimize::Parameter> parameters;
  for (const PseudoWienerUnknown& u : free)
    parameters.push_back(u.parameter);
  optimize::validate(parameters);
  Eigen::Index n = 0;
  for (const ThrottleRecord& record : records)
    n += static_cast<Eigen::Index>(record.duty.size());

  optimize::LeastSquaresOptions search = o.search;
  search.evaluate_together = false;
  optimize::LeastSquares solver(parameters, n, search);
  PseudoWienerFit best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const P& variant : variants(base, o)) {
    Residual<P> residual = residual_of(records, variant, free);
    const std::vector<P> from = o.only_given_start ? std::vector<P>{variant} : starts(variant, records, n, o, o.starts);
    for (const P& start : from) {
      const auto values = throttle::numbers(start);
      Eigen::VectorXd x(static_cast<Eigen::Index>(free.size()));
      for (std::size_t i = 0; i < free.size(); ++i) {
        x[static_cast<Eigen::Index>(i)] =
            std::clamp(*values[free[i].numbers.front()], parameters[i].lower, parameters[i].upper);
      }
      optimize::FitReport report = solver.solve(residual, x);
      const bool usable = report.values.size() == x.size() && std::isfinite(report.cost);
      best.rmse_deg.push_back(usable ? report.rmse : std::numeric_limits<double>::infinity());
      if (usable && report.cost < best_cost) {
        best_cost = report.cost;
        best.model = model_at<P>(residual, report.values);
        best.report = std::move(report);
      }
    }
  }
  if (!std::isfinite(best_cost)) {
    throw ConvergenceError("no search of the pseudo-Wiener fit could be evaluated: check the log and the start values");
  }
  std::ranges::sort(best.rmse_deg);
  const double limit = best.rmse_deg.front() * std::sqrt(1.0 + o.same_cost);
  best.n_best = static_cast<int>(std::ranges::count_if(best.rmse_deg, [&](double rmse) { return rmse <= limit; }));
  return best;
}

void check(const std::vector<ThrottleRecord>& records) {
  if (records.empty()) throw about("records", ShapeError("records is empty: a fit needs at least one log"));
  for (std::size_t i = 0; i < records.size(); ++i) {
    const ThrottleRecord& r = records[i];
    const std::string name = "records[" + std::to_string(i) + "]";
    if (r.duty.size() != r.angle_deg.size()) {
      throw ShapeError(name + ": duty has " + std::to_string(r.duty.size()) + " samples, angle_deg has " +
                       std::to_string(r.angle_deg.size()));
    }
    if (r.duty.size() < 50) {
      throw DataError(name + " has " + std::to_string(r.duty.size()) + " samples: a fit needs at least 50");
    }
    for (std::size_t k = 0; k < r.duty.size(); ++k) {
      if (!(std::abs(r.duty[k]) <= 1.0) || !std::isfinite(r.angle_deg[k])) {
        throw DataError(name + ", sample " + std::to_string(k) + ": duty must be in [-1, 1] and angle_deg finite");
      }
    }
  }
}

}  // namespace

void PseudoWienerFitOptions::validate() const {
  require_within("starts", starts, 1.0, 10000.0);
  require_positive("same_cost", same_cost);
  if (delays.empty()) throw about("delays", ParameterError("delays is empty: name at least one, 0 for none"));
  for (const double delay : delays)
    require_within("delays", delay, 0.0, throttle::max_delay_samples, "samples");
  search.validate();
}

PseudoWienerFit fit_pseudo_wiener(const std::vector<ThrottleRecord>& records, const throttle::PseudoWiener& base,
                                  const PseudoWienerFitOptions& options) {
  options.validate();
  check(records);
  throttle::validate(base);
  return std::visit([&](const auto& p) { return fit(records, p, options); }, base);
}

}  // namespace mgdd::identify
