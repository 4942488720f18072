#include "mgdd/optimize/seekers/process_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "mgdd/common/random.hpp"

namespace mgdd::optimize {
namespace {

// Priors of logarithms.
constexpr double noise_prior = -5.3, noise_prior_sd = 1.5;
constexpr double rest_prior = -4.5, rest_prior_sd = 1.5;
constexpr double length_prior = -0.7, length_prior_sd = 0.7;
constexpr double settled_sd = 0.4;  // of the bend, once the first readings have shown it
constexpr double bend_search_sd = 1.5;
constexpr double guided_bend_prior = -1.0, guided_bend_prior_sd = 0.7;  // of the bend over that of J as a whole
constexpr double factor_width = 0.5;                                    // of what the guide counts by: heavy tails
constexpr double useless_factor = -6.0;
constexpr int settling_readings = 30;
constexpr int evidence_readings = 60;
constexpr double crowd = 0.75;  // share of the readings, those nearest to the estimate, of which the oldest goes
constexpr double wander_place = 0.04, wander_level = 1.2;  // in a memory: slopes in bends, the level in noise
constexpr double wander_sd = 1.0;                          // of their logarithms
constexpr double jitter = 1e-10;
constexpr int first_trials = 60, more_trials = 20, late_trials = 3;
constexpr int first_readings = 15, more_readings = 40;
constexpr double coarse_step = 0.8, fine_step = 0.25;
constexpr double lowest_log = -12.0, highest_log = 3.0;

double squared_distance(const InputTable& points, Eigen::Index row, const Inputs& from) noexcept {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < from.size(); ++i) {
    const double off = points(row, i) - from[i];
    sum += off * off;
  }
  return sum;
}

double dot(const double* a, const double* b, Eigen::Index n) noexcept {
  return Eigen::Map<const Eigen::VectorXd>(a, n).dot(Eigen::Map<const Eigen::VectorXd>(b, n));
}

// The lower triangle of rows of a positive definite matrix becomes that of its Cholesky factor.
void cholesky(InputTable& m, Eigen::Index n) noexcept {
  for (Eigen::Index i = 0; i < n; ++i) {
    const double size = m(i, i);
    for (Eigen::Index j = 0; j < i; ++j)
      m(i, j) = (m(i, j) - dot(&m(i, 0), &m(j, 0), j)) / m(j, j);
    m(i, i) = std::sqrt(std::max(size - dot(&m(i, 0), &m(i, 0), i), jitter * size));
  }
}

void solve_lower(const InputTable& factor, Eigen::Index n, double* x) noexcept {
  for (Eigen::Index i = 0; i < n; ++i)
    x[i] = (x[i] - dot(&factor(i, 0), x, i)) / factor(i, i);
}

void solve_upper(const InputTable& factor, Eigen::Index n, double* x) noexcept {
  for (Eigen::Index i = n - 1; i >= 0; --i) {
    x[i] /= factor(i, i);
    for (Eigen::Index j = 0; j < i; ++j)
      x[j] -= factor(i, j) * x[i];
  }
}

double log_prior(double value, double middle, double sd) noexcept {
  const double off = (value - middle) / sd;
  return -0.5 * off * off;
}

}  // namespace

ProcessModel::ProcessModel(const Settings& settings)
    : settings_(settings),
      kernel_(settings.inputs, settings.bends_down, settings.guide),
      points_(InputTable::Zero(settings.kept, kernel_.width())),
      values_(Eigen::VectorXd::Zero(settings.kept)),
      ages_(values_),
      numbers_(Numbers::Zero(5 + settings.inputs + (kernel_.guided() ? 1 : 0))),
      columns_(InputTable::Zero(kernel_.width(), settings.kept)),
      quadratic_(settings.kept, settings.kept),
      guide_(quadratic_),
      matern_(quadratic_),
      table_lengths_(Inputs::Zero(settings.inputs)),
      factor_(settings.kept, settings.kept),
      small_(evidence_readings, evidence_readings),
      weights_(values_),
      small_rest_(Eigen::VectorXd::Zero(evidence_readings)),
      distance_(values_),
      mean_(Eigen::VectorXd::Zero(settings.most_points)),
      order_(static_cast<std::size_t>(settings.kept), 0),
      chosen_(evidence_readings, 0),
      kernels_(settings.most_points, settings.kept),
      asked_(InputTable::Zero(settings.most_points, kernel_.width())) {
  now_.inverse_length = Inputs::Ones(settings.inputs);
}

double ProcessModel::noise_sd() const noexcept {
  return settings_.noise_sd.value_or(std::exp(numbers_[0] + numbers_[1]));
}

ProcessModel::Scales ProcessModel::scales_of(const Numbers& numbers) const noexcept {
  Scales out;
  out.bend = std::exp(numbers[0]);
  out.guide = kernel_.guided() ? std::exp(numbers[numbers.size() - 1]) : 0.0;
  const double noise = settings_.noise_sd.value_or(out.bend * std::exp(numbers[1])), rest = std::exp(numbers[2]);
  out.noise_variance = noise * noise;
  out.rest = rest * rest;
  const double place = std::exp(numbers[3 + settings_.inputs]), level = std::exp(numbers[4 + settings_.inputs]);
  const double wide = wander_place * place * kernel_.whole_bend(out);
  out.wander_slope = wide * wide / settings_.memory;
  out.wander_level = wander_level * wander_level * level * level * out.noise_variance / settings_.memory;
  out.inverse_length = (-numbers.segment(3, settings_.inputs)).array().exp().matrix();
  return out;
}

void ProcessModel::tabulate(std::int64_t reading) noexcept {
  columns_.col(reading) = points_.row(reading).transpose();
  for (std::int64_t other = 0; other < count_; ++other) {
    const std::int64_t i = std::max(reading, other), j = std::min(reading, other);
    const ProcessKernel::Fixed f = kernel_.fixed(&points_(i, 0), &points_(j, 0));
    quadratic_(i, j) = f.quadratic;
    guide_(i, j) = f.guide;
    matern_(i, j) = kernel_.matern(&points_(i, 0), &points_(j, 0), table_lengths_);
  }
}

void ProcessModel::tabulate_lengths() noexcept {
  for (std::int64_t i = 0; i < count_; ++i) {
    for (std::int64_t j = 0; j <= i; ++j)
      matern_(i, j) = kernel_.matern(&points_(i, 0), &points_(j, 0), table_lengths_);
  }
}

// Tables of all readings at the lengths in use.
void ProcessModel::know_tables() noexcept {
  const Inputs lengths = scales_of(numbers_).inverse_length;
  if (!tables_known_) {
    table_lengths_ = lengths;
    for (std::int64_t i = 0; i < count_; ++i)
      tabulate(i);
    tables_known_ = true;
  } else if (lengths != table_lengths_) {
    table_lengths_ = lengths;
    tabulate_lengths();
  }
}

// Of the readings nearest to `about` the oldest one.
int ProcessModel::crowded_reading(const Inputs& about) noexcept {
  for (std::int64_t i = 0; i < count_; ++i)
    distance_[i] = squared_distance(points_, i, about);
  const auto begin = order_.begin(), end = begin + count_;
  std::iota(begin, end, 0);
  const auto near = begin + static_cast<std::ptrdiff_t>(crowd * static_cast<double>(count_));
  std::nth_element(begin, near, end, [&](int a, int b) {
    return distance_[a] < distance_[b] || (distance_[a] == distance_[b] && a < b);
  });
  return *std::max_element(begin, near, [&](int a, int b) { return ages_[a] < ages_[b]; });
}

void ProcessModel::record(const Inputs& z, double value, const Inputs& about) noexcept {
  const int at = count_ < settings_.kept ? static_cast<int>(count_++) : crowded_reading(about);
  ages_.head(count_).array() += 1.0;
  kernel_.describe(z, &points_(at, 0));
  values_[at] = value;
  ages_[at] = 0.0;
  ++told_;
  if (tables_known_) tabulate(at);
  factored_ = false;
}

void ProcessModel::age(double cycles) noexcept {
  ages_.head(count_).array() += cycles;
  factored_ = false;
}

void ProcessModel::forget() noexcept {
  count_ = told_ = 0;
  begun_ = factored_ = tables_known_ = false;
  points_.setZero();
  values_.setZero();
  ages_.setZero();
  numbers_.setZero();
  settled_bend_.reset();
}

// The newest half of those that the evidence is taken of, and of the others those farthest away: these show the bend.
void ProcessModel::choose_readings(const Inputs& about) noexcept {
  const auto begin = order_.begin(), end = begin + count_;
  std::iota(begin, end, 0);
  const auto most = std::min<std::int64_t>(count_, evidence_readings);
  if (count_ > most) {
    std::sort(begin, end, [&](int a, int b) { return ages_[a] < ages_[b] || (ages_[a] == ages_[b] && a < b); });
    for (std::int64_t i = 0; i < count_; ++i)
      distance_[i] = squared_distance(points_, i, about);
    std::sort(begin + most / 2, end,
              [&](int a, int b) { return distance_[a] > distance_[b] || (distance_[a] == distance_[b] && a < b); });
  }
  std::copy(begin, begin + most, chosen_.begin());
}

// Logarithm of the likelihood of the chosen readings times the priors; the lengths may be those of the tables.
double ProcessModel::evidence(const Numbers& numbers, bool same_lengths) noexcept {
  const Scales s = scales_of(numbers);
  const auto n = std::min<std::int64_t>(count_, evidence_readings);
  for (std::int64_t a = 0; a < n; ++a) {
    const int one = chosen_[static_cast<std::size_t>(a)];
    small_rest_[a] = values_[one] - level_ - kernel_.mean(&points_(one, 0), s);
    for (std::int64_t b = 0; b <= a; ++b) {
      const int other = chosen_[static_cast<std::size_t>(b)], i = std::max(one, other), j = std::min(one, other);
      const double matern =
          same_lengths ? matern_(i, j) : kernel_.matern(&points_(i, 0), &points_(j, 0), s.inverse_length);
      small_(a, b) = kernel_.join({quadratic_(i, j), guide_(i, j)}, matern, s) +
                     wandered(&points_(i, 0), &points_(j, 0), std::min(ages_[i], ages_[j]), s);
    }
    small_(a, a) += s.noise_variance + jitter * s.bend * s.bend;
  }
  cholesky(small_, n);
  solve_lower(small_, n, small_rest_.data());
  double out = -0.5 * dot(small_rest_.data(), small_rest_.data(), n);
  for (std::int64_t a = 0; a < n; ++a)
    out -= std::log(small_(a, a));
  out += log_priors(numbers, s);
  return std::isfinite(out) ? out : -std::numeric_limits<double>::infinity();
}

double ProcessModel::log_priors(const Numbers& numbers, const Scales& s) const noexcept {
  const double whole = std::log(kernel_.whole_bend(s));
  double out = log_prior(0.5 * std::log(s.noise_variance) - whole, noise_prior, noise_prior_sd) +
               log_prior(numbers[2], rest_prior, rest_prior_sd);
  for (Eigen::Index i = 0; i < settings_.inputs; ++i)
    out += log_prior(numbers[3 + i], length_prior, length_prior_sd);
  for (Eigen::Index i = 3 + settings_.inputs; i < 5 + settings_.inputs; ++i)
    out += log_prior(numbers[i], 0.0, wander_sd);
  if (kernel_.guided()) {
    const double factor = numbers[numbers.size() - 1] / factor_width;
    out += log_prior(numbers[0] - whole, guided_bend_prior, guided_bend_prior_sd) - std::log1p(factor * factor);
  }
  if (settings_.bend && !kernel_.guided()) out += log_prior(numbers[0], std::log(*settings_.bend), 1.0);
  if (settled_bend_) out += log_prior(numbers[0], *settled_bend_, settled_sd);
  return out;
}

// Under a wrong input the numbers have gone wrong too: those that the readings suggest by themselves are tried beside.
double ProcessModel::likelihood(const InputTable& at, const Eigen::VectorXd& values, const Eigen::VectorXd& ages,
                                int count) noexcept {
  const Inputs wide = at.topRows(count).colwise().maxCoeff() - at.topRows(count).colwise().minCoeff();
  const double rise = values.head(count).maxCoeff() - values.head(count).minCoeff();
  Numbers plain = numbers_;
  plain[0] = std::log(std::max(rise, 1e-300) / (0.3 * std::max(wide.norm(), 1e-6)));
  plain[1] = noise_prior;
  plain[2] = rest_prior;
  plain.segment(3, settings_.inputs).setConstant(length_prior);
  plain.segment(3 + settings_.inputs, 2).setZero();
  double most = likelihood_by(numbers_, at, values, ages, count);
  for (int more = 0; more < 2; ++more, plain[1] += noise_prior_sd)
    most = std::max(most, likelihood_by(plain, at, values, ages, count));
  return most;
}

double ProcessModel::likelihood_by(const Numbers& numbers, const InputTable& at, const Eigen::VectorXd& values,
                                   const Eigen::VectorXd& ages, int count) noexcept {
  const Scales s = scales_of(numbers);
  const double level = values.head(count).mean();
  for (int a = 0; a < count; ++a) {
    kernel_.describe(at.row(a).transpose(), &asked_(a, 0));
    small_rest_[a] = values[a] - level - kernel_.mean(&asked_(a, 0), s);
    for (int b = 0; b <= a; ++b)
      small_(a, b) = kernel_.covariance(&asked_(a, 0), &asked_(b, 0), s) +
                     wandered(&asked_(a, 0), &asked_(b, 0), std::min(ages[a], ages[b]), s);
    small_(a, a) += s.noise_variance + jitter * s.bend * s.bend;
  }
  cholesky(small_, count);
  solve_lower(small_, count, small_rest_.data());
  double out = -0.5 * dot(small_rest_.data(), small_rest_.data(), count);
  for (int a = 0; a < count; ++a)
    out -= std::log(small_(a, a));
  return out;
}

void ProcessModel::replace(const InputTable& at, const Eigen::VectorXd& values, const Eigen::VectorXd& ages, int count,
                           const Inputs& about) noexcept {
  count_ = told_ = 0;
  begun_ = false;
  settled_bend_.reset();
  for (int a = std::max(0, count - settings_.kept); a < count; ++a)
    record(at.row(a).transpose(), values[a], about);
  ages_.head(count_) = ages.segment(count - count_, count_);
}

// Logarithm of the factor by which the guide fits the readings best, 0 where they do not say.
double ProcessModel::guide_in_readings() const noexcept {
  double middle = 0.0, both = 0.0, squares = 0.0;
  for (std::int64_t i = 0; i < count_; ++i)
    middle += kernel_.guide_at(&points_(i, 0)) / static_cast<double>(count_);
  for (std::int64_t i = 0; i < count_; ++i) {
    const double off = kernel_.guide_at(&points_(i, 0)) - middle;
    both += off * values_[i];
    squares += off * off;
  }
  return both > 0.0 && squares > 0.0 ? std::log(both / squares) : 0.0;
}

// The bend that the spread of the readings suggests.
void ProcessModel::begin_numbers() noexcept {
  const double spread = values_.head(count_).maxCoeff() - values_.head(count_).minCoeff();
  const double highest = values_.head(count_).cwiseAbs().maxCoeff();
  double farthest = 1e-6;
  for (std::int64_t i = 0; i < count_; ++i)
    for (std::int64_t j = 0; j < i; ++j)
      farthest = std::max(farthest, (points_.row(i) - points_.row(j)).head(settings_.inputs).norm());
  const double rise = std::max({spread, 1e-9 * highest, settings_.noise_sd.value_or(0.0), 1e-300});
  numbers_[0] = std::log(rise / (0.3 * farthest));
  numbers_[1] = noise_prior;
  numbers_[2] = rest_prior;
  numbers_.segment(3, settings_.inputs).setConstant(length_prior);
  numbers_.segment(3 + settings_.inputs, 2).setZero();
  if (kernel_.guided()) {
    numbers_[numbers_.size() - 1] = 0.0;
    numbers_[0] = std::log(kernel_.guide_bend()) + guided_bend_prior;
    numbers_[1] = noise_prior - guided_bend_prior;
  }
  begun_ = true;
}

// Numbers drawn from the priors: the evidence has more than one top.
ProcessModel::Numbers ProcessModel::anew(std::uint64_t trial) const noexcept {
  const auto normal = [&](std::uint64_t stream) { return random::normal(settings_.seed, stream, trial); };
  Numbers out = numbers_;
  out[0] += bend_search_sd * normal(101);
  out[1] = noise_prior + noise_prior_sd * normal(102);
  out[2] = rest_prior + rest_prior_sd * normal(103);
  out.segment(3, settings_.inputs).setConstant(length_prior);
  if (kernel_.guided()) {
    const double fitted[] = {guide_in_readings(), 0.0, useless_factor};
    out[out.size() - 1] = fitted[trial / 4 % 3] + factor_width * normal(104);
  }
  return out;
}

void ProcessModel::try_numbers(int trials) noexcept {
  const Eigen::Index sizes = numbers_.size();
  double best = evidence(numbers_, true);
  for (std::int64_t t = told_ * trials; t < (told_ + 1) * trials; ++t) {
    const Eigen::Index which = t % sizes;
    const std::int64_t round = t / sizes;
    if (which == 1 && noise_known()) continue;
    const double width = round % 2 == 0 ? coarse_step : fine_step;
    const double step = width * random::normal(settings_.seed, 100, static_cast<std::uint64_t>(t));
    Numbers trial = numbers_;
    const bool jumps = told_ < more_readings && t % 4 == 3;
    if (jumps) {
      trial = anew(static_cast<std::uint64_t>(t));
    } else {
      trial[which] += step;
      if (which == 0 && round % 3 == 0) trial[1] -= step;  // the noise stays
    }
    const auto bounded = trial.segment(1, 2 + settings_.inputs);
    if (bounded.minCoeff() < lowest_log || bounded.maxCoeff() > highest_log) continue;
    const double found = evidence(trial, !jumps && (which < 3 || which >= 3 + settings_.inputs));
    if (found <= best) continue;
    best = found;
    numbers_ = trial;
    know_tables();
  }
}

// Random walks of level and slopes, from a reading of that age until now; of two readings the younger one counts.
double ProcessModel::wandered(const double* a, const double* b, double age, const Scales& s) const noexcept {
  double slopes = 0.0;
  for (Eigen::Index k = 0; k < settings_.inputs; ++k)
    slopes += (a[k] - 0.5) * (b[k] - 0.5);
  return (s.wander_level + s.wander_slope * slopes) * age;
}

void ProcessModel::factor() noexcept {
  for (std::int64_t i = 0; i < count_; ++i) {
    weights_[i] = values_[i] - level_ - kernel_.mean(&points_(i, 0), now_);
    for (std::int64_t j = 0; j <= i; ++j)
      factor_(i, j) = kernel_.join({quadratic_(i, j), guide_(i, j)}, matern_(i, j), now_) +
                      wandered(&points_(i, 0), &points_(j, 0), std::min(ages_[i], ages_[j]), now_);
    factor_(i, i) += now_.noise_variance + jitter * now_.bend * now_.bend;
  }
  cholesky(factor_, count_);
  solve_lower(factor_, count_, weights_.data());
  solve_upper(factor_, count_, weights_.data());
  factored_ = true;
}

// After a restart in another process, or readings since the last fit.
void ProcessModel::refresh() noexcept {
  if (factored_) return;
  level_ = values_.head(count_).mean();
  now_ = scales_of(numbers_);
  know_tables();
  factor();
}

void ProcessModel::fit(const Inputs& about) noexcept {
  level_ = values_.head(count_).mean();
  const auto enough = kernel_.guided() ? 2 : settings_.inputs + 1;
  if (!begun_ || told_ <= enough) begin_numbers();
  know_tables();
  choose_readings(about);
  if (told_ >= enough) {
    try_numbers(told_ < first_readings ? first_trials : told_ < more_readings ? more_trials : late_trials);
    if (told_ == enough + settling_readings) settled_bend_ = numbers_[0];
  }
  factored_ = false;
  refresh();
}

void ProcessModel::predict(const InputTable& at, int points) noexcept {
  predict_means(at, points);
  factor_.topLeftCorner(count_, count_)
      .triangularView<Eigen::Lower>()
      .solveInPlace(kernels_.topLeftCorner(points, count_).transpose());
}

void ProcessModel::predict_means(const InputTable& at, int points) noexcept {
  refresh();
  for (int p = 0; p < points; ++p) {
    kernel_.describe(at.row(p).head(settings_.inputs).transpose(), &asked_(p, 0));
    double* const own = &kernels_(p, 0);
    kernel_.covariances(&asked_(p, 0), columns_, count_, now_, own);
    mean_[p] = level_ + kernel_.mean(&asked_(p, 0), now_) + dot(own, weights_.data(), count_);
  }
}

double ProcessModel::covariance(int i, int j) const noexcept {
  return kernel_.covariance(&asked_(i, 0), &asked_(j, 0), now_) - dot(&kernels_(i, 0), &kernels_(j, 0), count_);
}

double knowledge_gradient(std::span<const double> mean, std::span<const double> effect, std::span<int> order,
                          std::span<double> breaks) noexcept {
  std::iota(order.begin(), order.end(), 0);
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return effect[at(a)] < effect[at(b)] || (effect[at(a)] == effect[at(b)] && mean[at(a)] < mean[at(b)]);
  });
  // The upper envelope of the lines mean + effect Z; breaks[k] is where line k + 1 of it takes over.
  std::size_t lines = 0;
  for (const int next : order) {
    while (lines > 0) {
      const int last = order[lines - 1];
      const double steeper = effect[at(next)] - effect[at(last)];
      if (steeper > 0.0) {
        const double crossing = (mean[at(last)] - mean[at(next)]) / steeper;
        if (lines == 1 || crossing > breaks[lines - 2]) {
          breaks[lines - 1] = crossing;
          break;
        }
      }
      --lines;
    }
    order[lines++] = next;
  }
  double out = 0.0;
  for (std::size_t k = 0; k + 1 < lines; ++k) {
    const double off = -std::abs(breaks[k]);
    const double density = std::exp(-0.5 * off * off) / std::sqrt(2.0 * std::numbers::pi);
    const double below = 0.5 * std::erfc(-off / std::numbers::sqrt2);
    out += (effect[at(order[k + 1])] - effect[at(order[k])]) * (density + off * below);
  }
  return out;
}

}  // namespace mgdd::optimize
