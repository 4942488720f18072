// Output-error residual of a model family with exact forward sensitivities: free run over one or several records,
// ready for optimize::LeastSquares. r(k) = weight(k) (y_model(k) - y_measured(k)) / sigma. Units are the model's own;
// dt in s. The call is noexcept and allocates nothing. Sensitivities: Griewank and Walther 2008, chapter 3.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/dynamics/sensitivity.hpp"
#include "mgdd/optimize/least_squares/parameter.hpp"

namespace mgdd::identify {

using dynamics::Values;

/// One experiment at a constant sample time. `input` is row-major, a fixed number of values per sample.
struct SimulationRecord {
  double dt_s = 1e-3;
  std::vector<double> input;
  std::vector<double> output;           ///< measured; one value per sample
  std::vector<double> start;            ///< the family's start numbers; also where those that are free begin
  std::vector<std::size_t> free_start;  ///< start numbers that are estimated
  std::size_t skip = 0;                 ///< first samples without a residual (initialisation window)
  double sigma = 1.0;                   ///< noise level in the unit of the output: residuals become dimensionless
  std::vector<double> weight;           ///< per sample [-]; empty for 1
};

/// Values per sample that a model takes: one, or those of its array.
template <class M>
constexpr std::size_t input_size() noexcept {
  if constexpr (requires { std::tuple_size<typename M::Input>::value; }) {
    return std::tuple_size_v<typename M::Input>;
  } else {
    return 1;
  }
}

/// One unknown: the numbers of the model that take its value.
using SharedNumbers = std::vector<std::size_t>;

/// The unknowns, in this order: the free model parameters, then per record its free start numbers. All other parameters
/// keep the value of `base`. `Sweeps` says in which widths the derivatives are taken.
template <dynamics::ModelFamily Family, class Sweeps = dynamics::DefaultPasses>
class OutputError {
 public:
  using Parameters = Values<double, Family::n_parameters>;
  using Start = Values<double, Family::n_start>;
  using Model = dynamics::FamilyModel<Family, double>;

  /// Checks everything (ParameterError, ShapeError) and takes the records.
  OutputError(Family family, const Parameters& base, std::vector<SharedNumbers> free,
              std::vector<SimulationRecord> records)
      : family_(std::move(family)), base_(base), free_(std::move(free)), records_(std::move(records)) {
    validate();
    n_unknowns_ = static_cast<Eigen::Index>(free_.size());
    for (const SimulationRecord& record : records_) {
      first_start_.push_back(n_unknowns_);
      n_unknowns_ += static_cast<Eigen::Index>(record.free_start.size());
      n_residuals_ += static_cast<Eigen::Index>(record.output.size() - record.skip);
    }
  }
  /// One number per unknown.
  OutputError(Family family, const Parameters& base, const std::vector<std::size_t>& free,
              std::vector<SimulationRecord> records)
      : OutputError(std::move(family), base, one_by_one(free), std::move(records)) {}

  /// False when an output or a derivative leaves the finite numbers.
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) noexcept {
    Eigen::Index row = 0;
    for (std::size_t r = 0; r < records_.size(); ++r) {
      // Unknowns of other records do not act here, and a record without any has no column of its own to write.
      if (jacobian != nullptr) jacobian->middleRows(row, rows(r)).setZero();
      const bool finite = Sweeps::each(jacobian == nullptr ? 0 : own(r), [&]<class T>(std::size_t first) noexcept {
        return run<T>(r, x, row, residual, jacobian, first);
      });
      if (!finite) return false;
      row += rows(r);
    }
    return true;
  }

  Eigen::Index n_residuals() const noexcept { return n_residuals_; }
  Eigen::Index n_unknowns() const noexcept { return n_unknowns_; }
  const std::vector<SimulationRecord>& records() const noexcept { return records_; }
  const Family& family() const noexcept { return family_; }

  /// The unknowns at `base` and the stated starts.
  Eigen::VectorXd start() const {
    Eigen::VectorXd x(n_unknowns_);
    Eigen::Index i = 0;
    for (const SharedNumbers& numbers : free_)
      x[i++] = base_[numbers.front()];
    for (const SimulationRecord& record : records_) {
      for (const std::size_t s : record.free_start)
        x[i++] = record.start[s];
    }
    return x;
  }

  /// All model parameters at the unknowns `x`.
  Parameters parameters(const Eigen::VectorXd& x) const noexcept { return seeded<double>(x, 0); }

  /// Start numbers of a record at the unknowns `x`.
  Start start_numbers(std::size_t record, const Eigen::VectorXd& x) const noexcept {
    return seeded_start<double>(record, x, 0);
  }

  /// Free-run output on every sample of a record, skipped ones included. Allocates.
  std::vector<double> simulate(std::size_t record, const Eigen::VectorXd& x) const {
    const SimulationRecord& data = records_[record];
    const Model model = family_.template prepare<double>(parameters(x), data.dt_s);
    auto state = family_.template start<double>(model, start_numbers(record, x));
    std::vector<double> y(data.output.size());
    dynamics::run(
        model, state, y.size(), [&](std::size_t k) { return input<Model>(data, k); },
        [&](std::size_t k, double output) { return y[k] = output, true; });
    return y;
  }

 private:
  Eigen::Index rows(std::size_t record) const noexcept {
    return static_cast<Eigen::Index>(records_[record].output.size() - records_[record].skip);
  }
  /// Unknowns that act on a record.
  std::size_t own(std::size_t record) const noexcept { return free_.size() + records_[record].free_start.size(); }

  template <class M>
  static typename M::Input input(const SimulationRecord& record, std::size_t k) noexcept {
    if constexpr (requires { typename M::Input::value_type; }) {
      typename M::Input u{};
      for (std::size_t i = 0; i < u.size(); ++i)
        u[i] = typename M::Input::value_type(record.input[k * u.size() + i]);
      return u;
    } else {
      return typename M::Input(record.input[k]);
    }
  }

  template <class T>
  Values<T, Family::n_parameters> seeded(const Eigen::VectorXd& x, std::size_t first) const noexcept {
    Values<T, Family::n_parameters> p;
    for (std::size_t i = 0; i < p.size(); ++i)
      p[i] = T(base_[i]);
    for (std::size_t i = 0; i < free_.size(); ++i) {
      for (const std::size_t number : free_[i])
        p[number] = dynamics::seed<T>(x[static_cast<Eigen::Index>(i)], i, first);
    }
    return p;
  }

  template <class T>
  Values<T, Family::n_start> seeded_start(std::size_t r, const Eigen::VectorXd& x, std::size_t first) const noexcept {
    const SimulationRecord& record = records_[r];
    Values<T, Family::n_start> numbers;
    for (std::size_t i = 0; i < numbers.size(); ++i)
      numbers[i] = T(record.start[i]);
    for (std::size_t i = 0; i < record.free_start.size(); ++i) {
      const double value = x[first_start_[r] + static_cast<Eigen::Index>(i)];
      numbers[record.free_start[i]] = dynamics::seed<T>(value, free_.size() + i, first);
    }
    return numbers;
  }

  // Lane `lane` of this pass carries d/d unknown `first + lane` of the record's own unknowns.
  template <class T>
  bool run(std::size_t r, const Eigen::VectorXd& x, Eigen::Index row, Eigen::VectorXd& residual,
           Eigen::MatrixXd* jacobian, std::size_t first) const noexcept {
    const SimulationRecord& record = records_[r];
    const auto model = family_.template prepare<T>(seeded<T>(x, first), record.dt_s);
    auto state = family_.template start<T>(model, seeded_start<T>(r, x, first));
    const double over_sigma = 1.0 / record.sigma;
    const std::size_t lanes = own(r) - std::min(own(r), first);
    using M = std::remove_const_t<decltype(model)>;
    return dynamics::sweep(
        model, state, record.output.size(), record.skip, lanes, [&](std::size_t k) { return input<M>(record, k); },
        [&](std::size_t k, const T& y) {
          const double scale = record.weight.empty() ? over_sigma : over_sigma * record.weight[k];
          residual[row] = scale * (value_of(y) - record.output[k]);
          if constexpr (is_dual_v<T>) {
            for (std::size_t lane = 0; lane < std::min(lanes, y.grad.size()); ++lane)
              (*jacobian)(row, column(r, first + lane)) = scale * y.grad[lane];
          }
          ++row;
          return std::isfinite(residual[row - 1]);
        });
  }

  Eigen::Index column(std::size_t r, std::size_t own) const noexcept {
    return own < free_.size() ? static_cast<Eigen::Index>(own)
                              : first_start_[r] + static_cast<Eigen::Index>(own - free_.size());
  }

  static std::vector<SharedNumbers> one_by_one(const std::vector<std::size_t>& free) {
    std::vector<SharedNumbers> out;
    for (const std::size_t i : free)
      out.push_back({i});
    return out;
  }

  void validate() const {
    std::vector<std::size_t> all;
    for (const SharedNumbers& numbers : free_) {
      if (numbers.empty()) throw ShapeError("free holds an unknown without a number of the model");
      all.insert(all.end(), numbers.begin(), numbers.end());
    }
    check_indices("free", all, static_cast<std::size_t>(Family::n_parameters));
    if (records_.empty()) throw ShapeError("records: must be at least one");
    for (std::size_t r = 0; r < records_.size(); ++r) {
      const SimulationRecord& record = records_[r];
      const std::string name = "records[" + std::to_string(r) + "].";
      const std::size_t n = record.output.size();
      check_size(name + "input", record.input.size(), n * input_size<Model>());
      check_size(name + "start", record.start.size(), static_cast<std::size_t>(Family::n_start));
      if (!record.weight.empty()) check_size(name + "weight", record.weight.size(), n);
      if (record.skip >= n) {
        throw in_context(name, ShapeError("skip", record.skip, "must be below the " + std::to_string(n) + " samples"));
      }
      check_indices(name + "free_start", record.free_start, static_cast<std::size_t>(Family::n_start));
      require_positive(name + "dt_s", record.dt_s);
      require_positive(name + "sigma", record.sigma);
      for (const auto* values : {&record.input, &record.output, &record.start, &record.weight}) {
        if (!std::ranges::all_of(*values, [](double v) { return std::isfinite(v); })) {
          throw ParameterError(name + "input, output, start, weight: must be finite numbers");
        }
      }
    }
  }

  static void check_size(const std::string& name, std::size_t size, std::size_t expected) {
    if (size != expected) {
      throw ShapeError(name + " has " + std::to_string(size) + " values: must have " + std::to_string(expected));
    }
  }
  static void check_indices(const std::string& name, const std::vector<std::size_t>& indices, std::size_t below) {
    for (std::size_t i = 0; i < indices.size(); ++i) {
      const bool repeated = std::find(indices.begin(), indices.begin() + static_cast<std::ptrdiff_t>(i), indices[i]) !=
                            indices.begin() + static_cast<std::ptrdiff_t>(i);
      if (indices[i] >= below || repeated) {
        throw ParameterError(name + " holds " + std::to_string(indices[i]) + ": must be below " +
                             std::to_string(below) + ", each once");
      }
    }
  }

  Family family_;
  Parameters base_;
  std::vector<SharedNumbers> free_;
  std::vector<SimulationRecord> records_;
  std::vector<Eigen::Index> first_start_;  // column of the first free start state of each record
  Eigen::Index n_unknowns_ = 0;
  Eigen::Index n_residuals_ = 0;
};

/// The free start numbers of the records as unknowns of a search, after the parameters: `start_angle_deg`, with the
/// number of the record where there are several. ShapeError for a number that the family does not have.
template <dynamics::DescribedFamily Family>
void append_start_numbers(std::vector<optimize::Parameter>& unknowns, const std::vector<SimulationRecord>& records) {
  for (std::size_t r = 0; r < records.size(); ++r) {
    const std::string suffix = records.size() > 1 ? "_" + std::to_string(r) : "";
    for (const std::size_t s : records[r].free_start) {
      if (s >= Family::start_numbers.size()) throw about("free_start", ShapeError("free_start: no such state"));
      const FieldInfo& state = Family::start_numbers[s];
      unknowns.push_back(optimize::parameter_of(state, "start_" + std::string(state.name) + suffix));
    }
  }
}

}  // namespace mgdd::identify
