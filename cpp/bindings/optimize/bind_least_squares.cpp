// Binds include/mgdd/optimize: least squares for Python callables, its parameters, options and report.
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/math/autocorrelation.hpp"
#include "mgdd/optimize/least_squares/block_sandwich.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"
#include "mgdd/optimize/least_squares/multi_start.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using optimize::FitReport;
using optimize::LeastSquares;
using optimize::LeastSquaresOptions;
using optimize::Parameter;
using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct Evaluation {
  bool usable = false;
  InputArray residual;
  InputArray jacobian;
};

InputArray dense(const py::handle& object, const char* what, py::ssize_t dimensions) {
  const InputArray array(py::reinterpret_borrow<py::object>(object));
  if (array.ndim() != dimensions) {
    throw ShapeError(std::string("fun returned a ") + what + " with " + std::to_string(array.ndim()) +
                     " dimensions, expected " + std::to_string(dimensions));
  }
  return array;
}

// fun(x) -> (residual, jacobian), or None where the model cannot be evaluated. Python gets its own copy of x.
Evaluation call(const py::function& fun, const Eigen::VectorXd& x) {
  const py::object result = fun(Eigen::VectorXd(x));
  if (result.is_none()) {
    return {};
  }
  if (!py::isinstance<py::tuple>(result) || py::len(result) != 2) {
    throw ShapeError("fun must return (residual, jacobian) or None, returned " +
                     std::string(py::repr(py::type::of(result))));
  }
  const auto pair = py::reinterpret_borrow<py::tuple>(result);
  Evaluation evaluation{true, dense(pair[0], "residual", 1), dense(pair[1], "jacobian", 2)};
  if (evaluation.jacobian.shape(0) != evaluation.residual.shape(0) || evaluation.jacobian.shape(1) != x.size()) {
    throw ShapeError("fun returned a jacobian of " + std::to_string(evaluation.jacobian.shape(0)) + " x " +
                     std::to_string(evaluation.jacobian.shape(1)) + " for " +
                     std::to_string(evaluation.residual.shape(0)) + " residuals and " + std::to_string(x.size()) +
                     " parameters");
  }
  return evaluation;
}

FitReport least_squares(const py::function& fun, const Eigen::VectorXd& x0, std::vector<Parameter> parameters,
                        const LeastSquaresOptions& options, const std::vector<Eigen::Index>& records) {
  options.validate();
  optimize::validate(parameters);
  optimize::validate_start(parameters, x0);
  // The first evaluation tells how many residuals there are; the search then starts from it.
  Evaluation first = call(fun, x0);
  bool have_first = true;
  const auto n_residuals = first.usable ? first.residual.shape(0) : x0.size();
  const auto rows_said = std::accumulate(records.begin(), records.end(), Eigen::Index{0});
  if (!records.empty() && first.usable && rows_said != n_residuals) {
    throw about("records", ShapeError("records are " + std::to_string(rows_said) + " residuals: fun returns " +
                                      std::to_string(n_residuals)));
  }
  const auto model = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    const py::gil_scoped_acquire gil;
    const Evaluation evaluation = have_first ? std::move(first) : call(fun, x);
    have_first = false;
    if (!evaluation.usable) {
      return false;
    }
    residual = Eigen::Map<const Eigen::VectorXd>(evaluation.residual.data(), evaluation.residual.shape(0));
    if (jacobian != nullptr) {
      *jacobian = Eigen::Map<const RowMajorMatrix>(evaluation.jacobian.data(), evaluation.jacobian.shape(0),
                                                   evaluation.jacobian.shape(1));
    }
    return true;
  };
  LeastSquares search(std::move(parameters), n_residuals, options);
  FitReport report = without_gil([&] { return search.solve(model, x0); });
  if (!records.empty() && std::isfinite(report.cost)) {
    std::vector<optimize::ResidualRecord> rows;
    for (const Eigen::Index count : records)
      rows.push_back({rows.empty() ? 0 : rows.back().first + rows.back().rows, count});
    optimize::block_sandwich(report, search.jacobian(), rows);
  }
  return report;
}

py::dict history(const FitReport& report) {
  const auto n = static_cast<py::ssize_t>(report.history.size());
  py::array_t<double> cost(n);
  py::array_t<double> damping(n);
  py::array_t<double> step_norm(n);
  py::array_t<bool> accepted(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    const optimize::FitStep& step = report.history[static_cast<std::size_t>(i)];
    cost.mutable_at(i) = step.cost;
    damping.mutable_at(i) = step.damping;
    step_norm.mutable_at(i) = step.step_norm;
    accepted.mutable_at(i) = step.accepted;
  }
  py::dict result;
  result["cost"] = cost;
  result["damping"] = damping;
  result["step_norm"] = step_norm;
  result["accepted"] = accepted;
  return result;
}

// By value: an array kept from one report must not change with anything that happens later.
template <class Member>
auto by_value(Member FitReport::* member) {
  return [member](const FitReport& report) -> Member { return report.*member; };
}

void bind_parameter(py::module_& m) {
  py::class_<Parameter> cls(m, "Parameter",
                            "One unknown of a fit: name, bounds, and whether it is searched as its log.");
  bind_record(cls, "Parameter", [](const Parameter&) {});
}

void bind_options(py::module_& m) {
  py::class_<LeastSquaresOptions> options(m, "LeastSquaresOptions",
                                          "When a least-squares search ends and what it reports.");
  bind_record(options, "LeastSquaresOptions", [](const LeastSquaresOptions& made) { made.validate(); });
}

void bind_report(py::module_& m) {
  m.def(
      "autocorrelation_time",
      [](const Eigen::VectorXd& residual) {
        return autocorrelation_time({residual.data(), static_cast<std::size_t>(residual.size())});
      },
      py::arg("residual"), "Integrated autocorrelation time of a residual about zero, in samples (Geyer 1992).");
  py::class_<FitReport>(m, "FitReport", "Result of a fit as the core gives it; `mgdd.optimize.FitReport` wraps it.")
      .def(py::init<>(), "A fit that has not been run.")
      .def_property_readonly("names", by_value(&FitReport::names), "Parameter names.")
      .def_property_readonly("values", by_value(&FitReport::values), "Estimates.")
      .def_property_readonly("stderr", by_value(&FitReport::standard_error), "Standard errors.")
      .def_property_readonly("lower", by_value(&FitReport::lower), "Lower bounds.")
      .def_property_readonly("upper", by_value(&FitReport::upper), "Upper bounds.")
      .def_property_readonly("bounds_active", by_value(&FitReport::bounds_active), "-1 lower, +1 upper, 0 free.")
      .def_property_readonly("covariance", by_value(&FitReport::covariance), "Covariance of the estimates.")
      .def_property_readonly("correlation", by_value(&FitReport::correlation), "Correlation of the estimates.")
      .def_property_readonly("unidentifiable", by_value(&FitReport::unidentifiable), "Names the data leave open.")
      .def_property_readonly("findings", by_value(&FitReport::findings), "Reasons behind `unidentifiable`.")
      .def_property_readonly("null_directions", by_value(&FitReport::null_directions),
                             "Columns: parameter changes that leave the residual as it is.")
      .def_property_readonly(
          "residual_blocks",
          [](const FitReport& r) {
            return std::isfinite(r.residual_blocks) ? std::optional(r.residual_blocks) : std::nullopt;
          },
          "Blocks that the standard errors count as independent; None where they count every residual.")
      .def_property_readonly("residual", by_value(&FitReport::residual), "Residual at the estimates.")
      .def_property_readonly("rmse", by_value(&FitReport::rmse), "Root mean square residual.")
      .def_property_readonly("cost", by_value(&FitReport::cost), "Half the sum of squares.")
      .def_property_readonly("nfev", by_value(&FitReport::nfev), "Residual evaluations.")
      .def_property_readonly("njev", by_value(&FitReport::njev), "Jacobian evaluations.")
      .def_property_readonly("iterations", by_value(&FitReport::iterations), "Trial steps.")
      .def_property_readonly("n_residuals", by_value(&FitReport::n_residuals), "Number of residuals.")
      .def_property_readonly("history", &history, "Arrays cost, damping, step_norm, accepted per trial step.")
      .def_property_readonly(
          "status", [](const FitReport& r) { return std::string(name_of(r.status)); }, "Why the search ended.")
      .def_property_readonly(
          "message", [](const FitReport& r) { return std::string(optimize::explain(r.status)); },
          "The status as a sentence.")
      .def_property_readonly("success", &FitReport::success, "Whether a tolerance was met.")
      .def("__repr__", [](const FitReport& r) { return "<FitReport " + r.brief() + ">"; });
}

}  // namespace

void bind_least_squares(py::module_& m) {
  bind_parameter(m);
  bind_options(m);
  bind_report(m);
  m.def(
      "least_squares", &least_squares, py::arg("fun"), py::arg("x0"), py::kw_only(), py::arg("parameters"),
      py::arg("options"), py::arg("records") = std::vector<Eigen::Index>{},
      "Minimise sum(residual^2) / 2 for `fun(x) -> (residual, jacobian)`; None refuses a point. With the rows of each "
      "record, errors count blocks of what is correlated in time.");
  m.def("latin_hypercube", &optimize::spread_starts, py::arg("parameters"), py::arg("n"), py::arg("seed"),
        py::call_guard<py::gil_scoped_release>(), "Points between the bounds, one per cell of every axis.");
}

}  // namespace mgdd::bindings
