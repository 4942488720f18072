#include "mgdd/identify/throttle/smooth_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::identify {
namespace {

using optimize::FitReport;
using optimize::LeastSquares;
using throttle::SmoothPlant;
using Set = std::array<double, 10>;

constexpr std::size_t friction_width = 3, preload_width = 6;
constexpr double reached_factor = 1.005;

// The search runs in coordinates in which the flat valley of this plant is an axis. From duty and angle alone, torque
// constant and resistance act nearly only as Km/R, viscous friction and back-EMF only as Kv + N^2 Km Ke/R; what tells
// them apart is the inductance. Slots: Km/R for Km, the total for Ke; all others are the parameters themselves.
constexpr std::size_t km = 0, kv = 1, ke = 8, resistance = 9, limp_home = 7;

Set to_search(const Set& p, double n_squared) noexcept {
  Set q = p;
  q[km] = p[km] / p[resistance];
  q[ke] = p[kv] + n_squared * q[km] * p[ke];
  return q;
}

// Back, clipped to the bounds of the parameters; `chain` is d parameter / d search coordinate, zero where clipped.
Set from_search(const Set& q, double n_squared, const SmoothThrottleFitOptions& options, Eigen::MatrixXd& chain) {
  Set p = q;
  p[km] = q[km] * q[resistance];
  const double slope = 1.0 / (n_squared * q[km]);
  p[ke] = (q[ke] - q[kv]) * slope;
  chain.setIdentity(10, 10);
  chain(km, km) = q[resistance];
  chain(km, resistance) = q[km];
  chain(ke, ke) = slope;
  chain(ke, kv) = -slope;
  chain(ke, km) = -p[ke] / q[km];
  for (std::size_t i = 0; i < 10; ++i) {
    const double inside = std::clamp(p[i], options.lower[i], options.upper[i]);
    if (inside != p[i]) chain.row(static_cast<Eigen::Index>(i)).setZero();
    p[i] = inside;
  }
  return p;
}

std::vector<optimize::Parameter> search_parameters(const SmoothThrottleFitOptions& o, double n_squared,
                                                   const std::vector<std::size_t>& free) {
  Set lower = o.lower, upper = o.upper;
  lower[km] = o.lower[km] / o.upper[resistance];
  upper[km] = o.upper[km] / o.lower[resistance];
  lower[ke] = o.lower[kv] + n_squared * lower[km] * o.lower[ke];
  upper[ke] = o.upper[kv] + n_squared * upper[km] * o.upper[ke];
  std::vector<optimize::Parameter> parameters;
  for (const std::size_t i : free) {
    parameters.push_back({std::string(SmoothPlant::parameter_names[i]), lower[i], upper[i], i != kv && i != limp_home});
  }
  return parameters;
}

// One search of one start within a stage.
struct Search {
  LeastSquares solver;
  Set coordinates;
  bool open = true;
  Set parameters{};  // asked for
  NormalSums sums{};
  Eigen::MatrixXd chain{};
  Set best{};  // lowest sum of squares so far
  NormalSums best_sums{};
  double lowest = std::numeric_limits<double>::infinity();
};

std::size_t samples_of(const SmoothThrottleStage& stage, std::size_t n) {
  const auto samples = static_cast<std::size_t>(std::llround(stage.fraction * static_cast<double>(n)));
  return std::clamp(samples, std::min<std::size_t>(n, 20), n);
}

void validate(const SmoothPlant& plant, const SmoothThrottleRecord& record, const std::vector<Set>& starts,
              const SmoothThrottleFitOptions& options) {
  require_positive("inertia_kgm2", plant.inertia_kgm2);
  require_positive("gear_ratio", plant.gear_ratio);
  require_positive("inductance_h", plant.inductance_h);
  require_positive("supply_v", plant.supply_v);
  require_positive("dt_s", record.dt_s);
  if (record.duty.size() != record.angle_deg.size() || record.duty.size() < 20) {
    throw about("duty", ShapeError("duty has " + std::to_string(record.duty.size()) + " samples, angle_deg " +
                                   std::to_string(record.angle_deg.size()) + ": must be equal and at least 20"));
  }
  const auto finite = [](double v) { return std::isfinite(v); };
  if (!std::ranges::all_of(record.duty, finite) || !std::ranges::all_of(record.angle_deg, finite) ||
      !std::ranges::all_of(record.start, finite)) {
    throw DataError("duty, angle_deg, start: must be finite numbers");
  }
  if (starts.empty()) throw about("starts", ShapeError("starts: must be at least one"));
  for (std::size_t i = 0; i < 10; ++i) {
    const std::string name(SmoothPlant::parameter_names[i]);
    require_positive("lower " + name, options.lower[i]);
    require_within("upper " + name, options.upper[i], options.lower[i], 1e300);
    for (const Set& start : starts)
      require_within("start " + name, start[i], options.lower[i], options.upper[i]);
  }
  if (options.stages.empty()) throw about("stages", ShapeError("stages: must be at least one"));
  for (const SmoothThrottleStage& stage : options.stages) {
    require_within("fraction", stage.fraction, 1e-6, 1.0);
    require_positive("cost_tolerance", stage.cost_tolerance);
    for (const std::size_t i : stage.free)
      require_within("free", static_cast<double>(i), 0.0, 9.0);
  }
}

// One sweep for every search in `group`; a lone search uses the kernel that has its columns in the lanes.
void evaluate(const SmoothPlant& plant, const SmoothThrottleRecord& record, std::size_t n_samples,
              std::span<Search*> group, const std::vector<std::size_t>& free, const SmoothThrottleFitOptions& options) {
  constexpr std::size_t width = smooth_throttle_lanes;
  std::array<Set, width> sets{};
  std::array<NormalSums, width> sums;
  for (std::size_t lane = 0; lane < group.size(); ++lane) {
    Search& search = *group[lane];
    const Eigen::VectorXd& x = search.solver.ask();
    for (std::size_t i = 0; i < free.size(); ++i)
      search.coordinates[free[i]] = x[static_cast<Eigen::Index>(i)];
    search.parameters = from_search(search.coordinates, plant.gear_ratio * plant.gear_ratio, options, search.chain);
    sets[lane] = search.parameters;
  }
  std::fill(sets.begin() + static_cast<std::ptrdiff_t>(group.size()), sets.end(), sets[0]);  // empty lanes
  if (group.size() == 1) {
    accumulate(plant, record, n_samples, sets[0], sums[0]);
  } else {
    accumulate(plant, record, n_samples, std::span<const Set, width>(sets), std::span<NormalSums, width>(sums));
  }
  for (std::size_t lane = 0; lane < group.size(); ++lane)
    group[lane]->sums = sums[lane];
}

using Matrix10 = Eigen::Matrix<double, 10, 10, Eigen::RowMajor>;

bool tell(Search& search, const std::vector<std::size_t>& free) {
  const auto n = static_cast<Eigen::Index>(free.size());
  const Eigen::Map<const Matrix10> jj(search.sums.jacobian_squared[0].data());
  const Eigen::Map<const Eigen::Matrix<double, 10, 1>> jr(search.sums.gradient.data());
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(n + 1);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(n + 1, n);
  const bool usable = std::isfinite(search.sums.sum_squares) && jj.allFinite() && jr.allFinite();
  if (usable) {
    if (search.sums.sum_squares < search.lowest) {
      search.lowest = search.sums.sum_squares;
      search.best = search.parameters;
      search.best_sums = search.sums;
    }
    Eigen::MatrixXd chain(10, n);
    for (Eigen::Index i = 0; i < n; ++i)
      chain.col(i) = search.chain.col(static_cast<Eigen::Index>(free[static_cast<std::size_t>(i)]));
    condense(chain.transpose() * jj * chain, chain.transpose() * jr, search.sums.sum_squares, residual, jacobian);
  }
  return search.solver.tell(usable, residual, jacobian);
}

// The report in the parameters themselves, with the uncertainty of all samples.
FitReport describe(const Search& search, const SmoothThrottleStage& stage, const SmoothThrottleFitOptions& options,
                   std::size_t n_samples) {
  FitReport report = search.solver.report();
  const auto n = static_cast<Eigen::Index>(stage.free.size());
  if (!std::isfinite(search.lowest)) return report;
  Eigen::MatrixXd a(n, n);
  Eigen::VectorXd g(n), residual;
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t p = stage.free[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < n; ++k)
      a(i, k) = search.best_sums.jacobian_squared[p][stage.free[static_cast<std::size_t>(k)]];
    g[i] = search.best_sums.gradient[p];
    report.values[i] = search.best[p];
    report.lower[i] = options.lower[p];
    report.upper[i] = options.upper[p];
    report.bounds_active[i] = report.values[i] <= report.lower[i] ? -1 : report.values[i] >= report.upper[i] ? 1 : 0;
  }
  Eigen::MatrixXd jacobian;
  condense(a, g, search.best_sums.sum_squares, residual, jacobian);
  report.n_residuals = static_cast<Eigen::Index>(n_samples);
  report.cost = 0.5 * search.best_sums.sum_squares;
  report.rmse = std::sqrt(search.best_sums.sum_squares / static_cast<double>(n_samples));
  report.residual.resize(0);
  report.unidentifiable.clear();
  report.findings.clear();
  const optimize::LeastSquaresOptions limits;
  optimize::describe_uncertainty(report, jacobian, Eigen::VectorXd::Ones(n),
                                 {limits.correlation_limit, limits.rank_tolerance});
  return report;
}

// Names a width whose standard error is large: beyond a bound or a null direction, which the report names itself.
void name_undetermined(FitReport& report, double limit) {
  for (const std::size_t width : {friction_width, preload_width}) {
    const std::string name(SmoothPlant::parameter_names[width]);
    const auto at = std::ranges::find(report.names, name);
    if (at == report.names.end() || std::ranges::find(report.unidentifiable, name) != report.unidentifiable.end()) {
      continue;
    }
    const auto i = static_cast<Eigen::Index>(at - report.names.begin());
    const double relative = report.standard_error[i] / report.values[i];
    if (!(relative <= limit)) {
      report.unidentifiable.push_back(name);
      report.findings.push_back(name + " has a standard error of " + text(100.0 * relative) +
                                " %: the record hardly depends on this smoothing width; fix it");
    }
  }
}

}  // namespace

void condense(const Eigen::MatrixXd& jacobian_squared, const Eigen::VectorXd& gradient, double sum_squares,
              Eigen::VectorXd& residual, Eigen::MatrixXd& jacobian) {
  constexpr double rounding = 1e-14;  // of the largest eigenvalue, with unit columns
  const Eigen::Index n = gradient.size();
  Eigen::VectorXd scale = jacobian_squared.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < n; ++i)
    scale[i] = scale[i] > 0.0 ? scale[i] : 1.0;
  const Eigen::VectorXd over = scale.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(over.asDiagonal() * jacobian_squared * over.asDiagonal());
  const double floor = rounding * eigen.eigenvalues().cwiseAbs().maxCoeff();
  residual.setZero(n + 1);
  jacobian.setZero(n + 1, n);
  double explained = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double lambda = eigen.eigenvalues()[i];
    if (!(lambda > floor)) continue;
    const auto direction = eigen.eigenvectors().col(i);
    const double root = std::sqrt(lambda);
    jacobian.row(i) = root * direction.cwiseProduct(scale).transpose();
    residual[i] = direction.dot(over.cwiseProduct(gradient)) / root;
    explained += residual[i] * residual[i];
  }
  residual[n] = std::sqrt(std::max(0.0, sum_squares - explained));
}

SmoothThrottleFitOptions smooth_throttle_options(const Set& centre) {
  SmoothThrottleFitOptions options;
  for (std::size_t i = 0; i < 10; ++i) {
    options.lower[i] = 0.1 * centre[i];
    options.upper[i] = 10.0 * centre[i];
  }
  // Friction, springs and the two groups first, then the friction and preload widths; what only the inductance
  // separates comes last, when the groups are known: freed early it runs to a bound and stays there.
  const std::vector<std::size_t> steady{km, 2, 4, 5, limp_home, ke};
  const std::vector<std::size_t> widths{km, 2, friction_width, 4, 5, preload_width, limp_home, ke};
  std::vector<std::size_t> all(10);
  std::iota(all.begin(), all.end(), std::size_t{0});
  options.stages = {{0.05, steady, 1e-3, 60, 1e-2},
                    {0.05, widths, 1e-3, 60, 1e-2},
                    {0.25, widths, 1e-4, 60, 1e-3},
                    {1.0, all, 1e-9, 60, 1e-6}};
  return options;
}

SmoothThrottleFit fit_smooth_throttle(const SmoothPlant& plant, const SmoothThrottleRecord& record,
                                      const std::vector<Set>& starts, const SmoothThrottleFitOptions& options) {
  validate(plant, record, starts, options);
  SmoothThrottleFit fit;
  const double n_squared = plant.gear_ratio * plant.gear_ratio;
  const std::size_t n = record.duty.size();
  std::vector<Set> sets = starts;
  double samples_swept = 0.0;
  for (const SmoothThrottleStage& stage : options.stages) {
    const std::size_t n_samples = samples_of(stage, n);
    const auto unknowns = search_parameters(options, n_squared, stage.free);
    optimize::LeastSquaresOptions search_options;
    search_options.cost_tolerance = stage.cost_tolerance;
    search_options.max_iterations = stage.max_iterations;
    search_options.initial_damping = stage.initial_damping;
    search_options.stop = options.stop;
    const auto n_free = static_cast<Eigen::Index>(stage.free.size());

    std::vector<Search> searches;
    searches.reserve(sets.size());
    for (const Set& set : sets) {
      searches.push_back({LeastSquares(unknowns, n_free + 1, search_options), to_search(set, n_squared)});
      Eigen::VectorXd x(n_free);
      for (Eigen::Index i = 0; i < n_free; ++i) {
        const auto& unknown = unknowns[static_cast<std::size_t>(i)];
        x[i] = std::clamp(searches.back().coordinates[stage.free[static_cast<std::size_t>(i)]], unknown.lower,
                          unknown.upper);
      }
      searches.back().solver.prepare(x);
      searches.back().best = set;
    }
    // A search that ends leaves its lane to the next one.
    while (true) {
      std::vector<Search*> group;
      const std::size_t width = options.lanes ? smooth_throttle_lanes : 1;
      for (Search& search : searches) {
        if (search.open && group.size() < width) group.push_back(&search);
      }
      if (group.empty()) break;
      evaluate(plant, record, n_samples, group, stage.free, options);
      samples_swept += static_cast<double>(group.size() * n_samples);
      for (Search* search : group)
        search->open = tell(*search, stage.free);
    }
    fit.reports.clear();
    for (std::size_t i = 0; i < sets.size(); ++i) {
      sets[i] = searches[i].best;
      fit.reports.push_back(describe(searches[i], stage, options, n_samples));
    }
    if (options.stop.stop_requested()) break;
  }
  const auto better = [](double a, double b) { return a < b || !std::isfinite(b); };
  for (std::size_t i = 0; i < fit.reports.size(); ++i) {
    name_undetermined(fit.reports[i], options.undetermined_error);
    if (better(fit.reports[i].cost, fit.reports[fit.best].cost)) fit.best = i;
  }
  for (const FitReport& report : fit.reports)
    fit.n_reached += report.rmse <= reached_factor * fit.reports[fit.best].rmse ? 1U : 0U;
  fit.parameters = std::move(sets);
  fit.n_sweeps = static_cast<std::size_t>(std::ceil(samples_swept / static_cast<double>(n)));
  return fit;
}

}  // namespace mgdd::identify
