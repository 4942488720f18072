// A Gaussian process of one measured quantity over the inputs (Rasmussen and Williams 2006, ch. 2 and 5), for seekers,
// with the covariance of `ProcessKernel`. Level and slopes wander with time, so that old readings say less of them than
// of the bends. Bend, noise, size and lengths of the rest, and what the guide counts by, go to where the evidence of
// the readings, with priors, is largest, a few trials per reading. Inputs are counted in their ranges, 0 to 1. noexcept
// and allocation-free after construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/belief/process_kernel.hpp"

namespace mgdd::optimize {

class ProcessModel {
 public:
  struct Settings {
    Eigen::Index inputs = 1;
    Eigen::Index context = 0;              ///< of these, the first ones: what others set
    int kept = 100;                        ///< readings, 10 at least
    int most_points = 100;                 ///< that `predict` is asked for at once
    double memory = 143.0;                 ///< [readings] in which level and slopes wander by what counts
    double wander = 1.0, wander_sd = 1.0;  ///< over what is expected of J, and how surely: of its logarithm
    bool bends_down = true;                ///< whether a maximum is expected, as of J
    std::optional<double> noise_sd{};      ///< of a reading, > 0; none: learnt
    std::optional<double> bend{};          ///< that is expected, to a factor of e; none: any
    bool labels = false;                   ///< readings are below or above 0: of the rarer ones those far away are kept
    double missed = -1.0, missed_sd = 0.7;  ///< logarithm of the share of all bends that the guide is expected to miss
    double rest = -4.5;                     ///< logarithm of the size of the rest over the bend, expected
    double alike = -1.0;    ///< ranges of every input, within which young readings may be averaged; below 0: never
    bool repeated = false;  ///< whether odd readings are taken again: until then they count little
    std::uint64_t seed = 0;
    ProcessGuide guide{};
  };
  explicit ProcessModel(const Settings& settings);

  Eigen::Index inputs() const noexcept { return settings_.inputs; }
  int count() const noexcept { return static_cast<int>(count_); }
  double noise_sd() const noexcept;

  /// Takes a reading at `z`, or the mean of several; where all places are taken, the oldest of those near `about` makes
  /// room. The square of how far it lies from what was expected, in standard deviations; 1 where little is known.
  double record(const Inputs& z, double value, const Inputs& about, double readings = 1.0) noexcept;
  /// ParameterError for a restored state that no readings leave.
  void require_usable() const { require_in(closed(0.0, 1e300), "variance within visits", within_); }

  /// What readings that were averaged scattered by among themselves: no reading is surer than that.
  void scattered(double sd, double readings) noexcept;
  /// Looks for better numbers of the process and makes predictions possible; 2 readings at least, 1 with a guide.
  void fit(const Inputs& about) noexcept;

  /// Mean of the quantity at `points` rows of `at`; what is known of other rows stays until the next reading or fit.
  void predict_means(const InputTable& at, int points, int from = 0) noexcept;
  /// The same, and what `covariance` needs.
  void predict(const InputTable& at, int points, int from = 0) noexcept;
  double mean(int point) const noexcept { return mean_[point]; }
  /// Of the quantity, without the noise of a reading, at two of these points.
  double covariance(int i, int j) const noexcept;
  double sd(int point) const noexcept { return std::sqrt(std::max(covariance(point, point), 0.0)); }
  /// By what quantiles of readings that are few over this many exceed normal ones.
  double widening(Eigen::Index freedom) const noexcept {
    return 1.0 + few_readings / std::max(1.0, static_cast<double>(count_ - freedom));
  }
  /// The same of each of some of them with each of others, a row each.
  void covariances(std::span<const int> of, std::span<const int> with, InputTable& out) noexcept;

  /// What the bend, where readings leave it open, makes of the prediction at `z`: to be added to mean and variance.
  struct Correction {
    double mean = 0.0, variance = 0.0;
  };
  Correction over_bends(const Inputs& z) noexcept;

  /// Logarithm of the likelihood of `count` readings, 60 at most, at the inputs in the rows of `at`; without priors.
  double likelihood(const InputTable& at, const Eigen::VectorXd& values, const Eigen::VectorXd& ages,
                    int count) noexcept;
  /// Knows these readings, the oldest first, in place of its own; its numbers begin anew.
  void replace(const InputTable& at, const Eigen::VectorXd& values, const Eigen::VectorXd& ages, int count,
               const Inputs& about) noexcept;
  /// Least value among the kept readings, outliers left out; the largest where all are outliers.
  double lowest() const noexcept;
  double highest() const noexcept { return count_ > 0 ? values_.head(count_).maxCoeff() : 0.0; }
  /// Every kept reading as `told` by another measure; the numbers begin anew.
  template <class F>
  void retell(const F& told) noexcept {
    for (std::int64_t i = 0; i < count_; ++i)
      values_[i] = told(values_[i]);
    within_ = within_freedom_ = 0.0;
    begun_ = factored_ = false;
    settled_bend_.reset();
  }
  /// Every reading so far counts as if it were this much older.
  void age(double cycles) noexcept;
  void forget() noexcept;
  /// Whether the newest readings have left what all others said, as good as alike at different inputs.
  bool wakes_up() const noexcept;
  /// Variance by which its slopes wander per reading, and how much it bends, as of the last fit.
  double slope_wander() const noexcept { return now_.wander_slope; }
  double bend() const noexcept { return kernel_.whole_bend(now_); }
  /// Kept readings above `value`.
  std::int64_t count_above(double value) const noexcept { return (values_.head(count_).array() > value).count(); }
  void reseed(std::uint64_t seed) noexcept { settings_.seed = seed; }
  /// What the guide counts by, in its own unit; 0 without one.
  double guide_factor() const noexcept { return kernel_.guided() ? std::exp(numbers_[numbers_.size() - 1]) : 0.0; }
  /// Share of the bend that the guide holds: towards 0 where it says nothing; 1 without one.
  double guide_share() const noexcept {
    const double own = guide_factor() * kernel_.guide_bend();
    return begun_ && kernel_.guided() ? own / (own + std::exp(numbers_[0])) : 1.0;
  }
  /// Readings from which on predictions are possible.
  int fewest() const noexcept { return kernel_.guided() ? 1 : static_cast<int>(settings_.inputs) + 1; }

  template <class Self, class V>
  static void visit(Self& self, V& v, const std::string& name) {
    v(name + "_count", self.count_, self.settings_.kept + 1);
    v(name + "_told", self.told_, counts_end);
    v(name + "_begun", self.begun_);
    v(name + "_points", self.points_);
    v(name + "_values", self.values_);
    v(name + "_ages", self.ages_);
    v(name + "_scatter", self.scatter_);
    v(name + "_weighed", self.weighed_);
    v(name + "_averaged", self.averaged_);
    v(name + "_numbers", self.numbers_);
    v(name + "_within", self.within_);
    v(name + "_within_freedom", self.within_freedom_);
    v(name + "_settled_bend", self.settled_bend_);
    if constexpr (!std::is_const_v<Self>) self.tables_known_ = self.factored_ = false;
  }

 private:
  static constexpr int evidence_readings = 60, more_readings = 40;
  static constexpr int together = 8;            // points whose covariances are made at once
  static constexpr double most_trusted = 81.0;  // of what a variance is multiplied by: nine standard deviations
  static constexpr double few_readings = 2.0;   // over degrees of freedom
  // Logarithms: bend, noise over bend, size of the rest over bend, lengths; how fast slopes and level wander, over the
  // expected; what the guide counts by.
  using Numbers = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6 + max_inputs, 1>;
  using Scales = ProcessKernel::Scales;
  Scales scales_of(const Numbers& numbers) const noexcept;
  void choose_readings(const Inputs& about) noexcept;
  double squared_distance(Eigen::Index reading, const Inputs& from) const noexcept;
  double evidence(const Numbers& numbers, bool same_lengths) noexcept;
  double likelihood_by(const Numbers& numbers, const InputTable& at, const Eigen::VectorXd& values,
                       const Eigen::VectorXd& ages, int count) noexcept;
  double log_priors(const Numbers& numbers, const Scales& s) const noexcept;
  void begin_numbers(bool by_guide) noexcept;
  void suspect() noexcept;
  void weigh() noexcept;
  double oddness(const Inputs& z, double value, double readings) noexcept;
  bool trusted(std::int64_t reading) const noexcept;
  double middle() const noexcept;
  void try_numbers(int trials) noexcept;
  Numbers anew(std::uint64_t trial) const noexcept;
  double guide_in_readings() const noexcept;
  double bend_in_readings() const noexcept;
  void tabulate(std::int64_t reading) noexcept;
  void tabulate_lengths() noexcept;
  void know_tables() noexcept;
  double wandered(const double* a, const double* b, double age, const Scales& s) const noexcept;
  void factor() noexcept;
  void refresh() noexcept;
  int crowded_reading(const Inputs& about) noexcept;
  double between(const Inputs& z, std::int64_t reading) noexcept;
  int alike_reading(const Inputs& z, double readings) noexcept;
  double agreement(const Inputs& z, double value, double readings) noexcept;
  double noise_of(std::int64_t reading, const Scales& s) const noexcept {
    return s.noise_variance * scatter_[reading] / averaged_[reading];
  }
  bool noise_known() const noexcept { return settings_.noise_sd.has_value(); }

  Settings settings_;
  ProcessKernel kernel_;
  std::int64_t count_ = 0, told_ = 0;
  bool begun_ = false;                          // the numbers have been made of readings
  double within_ = 0.0, within_freedom_ = 0.0;  // variance of the readings of a visit, pooled
  InputTable points_;                           // as the kernel describes them
  Eigen::VectorXd values_, ages_;
  Eigen::VectorXd scatter_;   // that the variance of each is multiplied by
  Eigen::VectorXd weighed_;   // the same by what the last fit left of each, for the next one
  Eigen::VectorXd averaged_;  // how many readings each is the mean of
  Numbers numbers_;
  std::optional<double> settled_bend_{};  // logarithm, as the first readings gave it
  // Made anew of the above where readings or numbers have changed.
  bool factored_ = false, tables_known_ = false;
  double level_ = 0.0;
  InputTable columns_;                     // `points_`, a column per point
  InputTable quadratic_, guide_, matern_;  // lower triangles, of all readings
  Inputs table_lengths_;                   // inverse ones that the last table is of
  InputTable factor_, small_;              // lower triangles
  Eigen::VectorXd weights_, small_rest_, mean_of_, distance_, mean_;
  std::vector<int> order_, chosen_;
  InputTable kernels_;   // a row per point: of the readings, solved with the factor
  InputTable together_;  // the same of a few
  InputTable asked_, asked_columns_;
  Scales now_;
};

}  // namespace mgdd::optimize
