// Output-error residual of a simulated model with exact forward sensitivities: free run over one or several records,
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
#include "mgdd/identify/step_model.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::identify {

/// One experiment at a constant sample time. `input` is row-major, n_inputs values per sample.
struct SimulationRecord {
  double dt_s = 1e-3;
  std::vector<double> input;
  std::vector<double> output;           ///< measured; one value per sample
  std::vector<double> start;            ///< state at the first sample; also the start of those that are free
  std::vector<std::size_t> free_start;  ///< states whose value at the first sample is estimated
  std::size_t skip = 0;                 ///< first samples without a residual (initialisation window)
  double sigma = 1.0;                   ///< noise level in the unit of the output: residuals become dimensionless
  std::vector<double> weight;           ///< per sample [-]; empty for 1
};

/// The unknowns, in this order: the free model parameters, then per record its free start states. All other parameters
/// keep the value of `base`.
template <StepModel Model>
class SimulationResidual {
 public:
  using Parameters = Values<double, Model::n_parameters>;
  using State = Values<double, Model::n_states>;
  using Input = Values<double, Model::n_inputs>;

  /// Checks everything (ParameterError, ShapeError) and takes the records.
  SimulationResidual(Model model, const Parameters& base, std::vector<std::size_t> free,
                     std::vector<SimulationRecord> records)
      : model_(std::move(model)), base_(base), free_(std::move(free)), records_(std::move(records)) {
    validate();
    n_unknowns_ = static_cast<Eigen::Index>(free_.size());
    for (const SimulationRecord& record : records_) {
      first_start_.push_back(n_unknowns_);
      n_unknowns_ += static_cast<Eigen::Index>(record.free_start.size());
      n_residuals_ += static_cast<Eigen::Index>(record.output.size() - record.skip);
    }
  }

  /// False when an output or a derivative leaves the finite numbers.
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) noexcept {
    Eigen::Index row = 0;
    for (std::size_t r = 0; r < records_.size(); ++r) {
      const std::size_t lanes = free_.size() + records_[r].free_start.size();
      bool finite = true;
      // Unknowns of other records do not act here, and a record without any has no column of its own to write.
      if (jacobian != nullptr) jacobian->middleRows(row, rows(r)).setZero();
      if (jacobian == nullptr || lanes == 0) {
        finite = run<double>(r, x, row, residual, nullptr, 0);
      } else {
        for (std::size_t first = 0; first < lanes && finite;) {
          const std::size_t left = lanes - first;
          if (left <= 4) {
            finite = run<Dual<4>>(r, x, row, residual, jacobian, first);
            first += 4;
          } else if (left <= 8) {
            finite = run<Dual<8>>(r, x, row, residual, jacobian, first);
            first += 8;
          } else {
            finite = run<Dual<12>>(r, x, row, residual, jacobian, first);
            first += 12;
          }
        }
      }
      if (!finite) return false;
      row += rows(r);
    }
    return true;
  }

  Eigen::Index n_residuals() const noexcept { return n_residuals_; }
  Eigen::Index n_unknowns() const noexcept { return n_unknowns_; }
  const std::vector<SimulationRecord>& records() const noexcept { return records_; }
  const Model& model() const noexcept { return model_; }

  /// The unknowns at `base` and the stated starts.
  Eigen::VectorXd start() const {
    Eigen::VectorXd x(n_unknowns_);
    Eigen::Index i = 0;
    for (const std::size_t p : free_)
      x[i++] = base_[p];
    for (const SimulationRecord& record : records_) {
      for (const std::size_t s : record.free_start)
        x[i++] = record.start[s];
    }
    return x;
  }

  /// All model parameters at the unknowns `x`.
  Parameters parameters(const Eigen::VectorXd& x) const noexcept { return seeded<double>(x, 0); }

  /// State at the first sample of a record at the unknowns `x`.
  State start_state(std::size_t record, const Eigen::VectorXd& x) const noexcept {
    return seeded_start<double>(record, parameters(x), x, 0);
  }

  /// Free-run output on every sample of a record, skipped ones included. Desk-time.
  std::vector<double> simulate(std::size_t record, const Eigen::VectorXd& x) const {
    const SimulationRecord& data = records_[record];
    const Parameters p = parameters(x);
    State state = start_state(record, x);
    std::vector<double> y(data.output.size());
    for (std::size_t k = 0; k < y.size(); ++k) {
      const Input u = input(data, k);
      y[k] = model_.template output<double>(p, state, u);
      if (k + 1 < y.size()) state = model_.template step<double>(p, state, u, data.dt_s);
    }
    return y;
  }

 private:
  Eigen::Index rows(std::size_t record) const noexcept {
    return static_cast<Eigen::Index>(records_[record].output.size() - records_[record].skip);
  }

  static Input input(const SimulationRecord& record, std::size_t k) noexcept {
    Input u;
    for (std::size_t i = 0; i < u.size(); ++i)
      u[i] = record.input[k * u.size() + i];
    return u;
  }

  // Lane `lane` of this pass carries d/d unknown `first + lane` of the record's own unknowns.
  template <class T>
  static T seed(double value, std::size_t own, std::size_t first) noexcept {
    T t(value);
    if constexpr (is_dual_v<T>) {
      if (own >= first && own - first < t.grad.size()) t.grad[own - first] = 1.0;
    }
    return t;
  }

  template <class T>
  Values<T, Model::n_parameters> seeded(const Eigen::VectorXd& x, std::size_t first) const noexcept {
    Values<T, Model::n_parameters> p;
    for (std::size_t i = 0; i < p.size(); ++i)
      p[i] = T(base_[i]);
    for (std::size_t i = 0; i < free_.size(); ++i)
      p[free_[i]] = seed<T>(x[static_cast<Eigen::Index>(i)], i, first);
    return p;
  }

  template <class T>
  Values<T, Model::n_states> seeded_start(std::size_t r, const Values<T, Model::n_parameters>& p,
                                          const Eigen::VectorXd& x, std::size_t first) const noexcept {
    const SimulationRecord& record = records_[r];
    Values<T, Model::n_states> state;
    for (std::size_t i = 0; i < state.size(); ++i)
      state[i] = T(record.start[i]);
    if constexpr (HasStart<Model>) state = model_.template start<T>(p, state);
    for (std::size_t i = 0; i < record.free_start.size(); ++i) {
      const double value = x[first_start_[r] + static_cast<Eigen::Index>(i)];
      state[record.free_start[i]] = seed<T>(value, free_.size() + i, first);
    }
    return state;
  }

  template <class T>
  bool run(std::size_t r, const Eigen::VectorXd& x, Eigen::Index row, Eigen::VectorXd& residual,
           Eigen::MatrixXd* jacobian, std::size_t first) const noexcept {
    const SimulationRecord& record = records_[r];
    const auto p = seeded<T>(x, first);
    auto state = seeded_start<T>(r, p, x, first);
    const std::size_t n = record.output.size();
    const double over_sigma = 1.0 / record.sigma;
    [[maybe_unused]] const std::size_t own = free_.size() + record.free_start.size();
    for (std::size_t k = 0; k < n; ++k) {
      const Input u = input(record, k);
      if (k >= record.skip) {
        const T y = model_.template output<T>(p, state, u);
        const double scale = record.weight.empty() ? over_sigma : over_sigma * record.weight[k];
        residual[row] = scale * (value_of(y) - record.output[k]);
        bool finite = std::isfinite(residual[row]);
        if constexpr (is_dual_v<T>) {
          for (std::size_t lane = 0; lane < y.grad.size() && first + lane < own; ++lane) {
            (*jacobian)(row, column(r, first + lane)) = scale * y.grad[lane];
            finite = finite && std::isfinite(y.grad[lane]);
          }
        }
        if (!finite) return false;
        ++row;
      }
      if (k + 1 < n) state = model_.template step<T>(p, state, u, record.dt_s);
    }
    return true;
  }

  Eigen::Index column(std::size_t r, std::size_t own) const noexcept {
    return own < free_.size() ? static_cast<Eigen::Index>(own)
                              : first_start_[r] + static_cast<Eigen::Index>(own - free_.size());
  }

  void validate() const {
    check_indices("free", free_, static_cast<std::size_t>(Model::n_parameters));
    if (records_.empty()) throw ShapeError("records: must be at least one");
    for (std::size_t r = 0; r < records_.size(); ++r) {
      const SimulationRecord& record = records_[r];
      const std::string name = "records[" + std::to_string(r) + "].";
      const std::size_t n = record.output.size();
      check_size(name + "input", record.input.size(), n * static_cast<std::size_t>(Model::n_inputs));
      check_size(name + "start", record.start.size(), static_cast<std::size_t>(Model::n_states));
      if (!record.weight.empty()) check_size(name + "weight", record.weight.size(), n);
      if (record.skip >= n) {
        throw ShapeError(name + "skip = " + std::to_string(record.skip) + ": must be below the " + std::to_string(n) +
                         " samples");
      }
      check_indices(name + "free_start", record.free_start, static_cast<std::size_t>(Model::n_states));
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

  Model model_;
  Parameters base_;
  std::vector<std::size_t> free_;
  std::vector<SimulationRecord> records_;
  std::vector<Eigen::Index> first_start_;  // column of the first free start state of each record
  Eigen::Index n_unknowns_ = 0;
  Eigen::Index n_residuals_ = 0;
};

}  // namespace mgdd::identify
