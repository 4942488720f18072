// Models that are Python objects, for algorithms of the core whose steps may not throw. The first exception of a call
// is kept, and every call after it gives NaN without asking; `raise_if_failed` hands it on once the step has returned.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "binding.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/throttle/models/pseudo_wiener_frame.hpp"

namespace mgdd::bindings {

/// The numbers of an object fill the front of its state.
inline constexpr std::size_t most_states = 32;
using RunTimeState = std::array<double, most_states>;

/// An object, the number of its states, and what went wrong in it.
class PythonCalls {
 public:
  PythonCalls(py::object object, Eigen::Index order, bool finite)
      : object_(std::move(object)), order_(order), finite_(finite) {}

  Eigen::Index order() const noexcept { return order_; }
  py::array_t<double> column(const RunTimeState& x) const { return py::array_t<double>(order_, x.data()); }

  template <class Work>
  void call(Work&& work) noexcept {
    if (failed_) return;
    try {
      work(object_);
    } catch (...) {
      failed_ = std::current_exception();
    }
  }
  bool failed() const noexcept { return static_cast<bool>(failed_); }
  void raise_if_failed() {
    if (failed_) std::rethrow_exception(std::exchange(failed_, nullptr));
  }

  /// Numbers of an answer; ShapeError for another count.
  void take(const py::object& given, const char* name, double* to, Eigen::Index n) const {
    const auto array = InputArray::ensure(given);
    if (!array) {
      PyErr_Clear();
      refuse(name, given, std::to_string(n) + " numbers");
    }
    if (array.size() != n) {
      throw about(name, ShapeError(std::string(name) + " gave " + std::to_string(array.size()) +
                                   " numbers: must give " + std::to_string(n)));
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      to[i] = array.data()[i];
      if (finite_ && !std::isfinite(to[i])) {
        throw about(name, DataError(std::string(name) + " gave " + text(to[i]) + " in place " + std::to_string(i) +
                                    ": must be finite"));
      }
    }
  }
  void forget(RunTimeState& x) const noexcept {
    if (failed_) x.fill(std::nan(""));
  }

  // What every model of Python has.
  void step(RunTimeState& x, double input) noexcept {
    call([&](py::object& o) { take(o.attr("step")(column(x), input), "step", x.data(), order_); });
    forget(x);
  }
  double output(const RunTimeState& x) noexcept {
    double y = std::nan("");
    call([&](py::object& o) { take(o.attr("output")(column(x)), "output", &y, 1); });
    return y;
  }

 private:
  py::object object_;
  Eigen::Index order_;
  bool finite_;
  std::exception_ptr failed_;
};

/// What Mgdd1 asks: `at_rest(angle_deg)`, `step(state, duty)`, `output(state)`, and `correct(state, angle_deg)` where
/// there is one. Every number must be finite.
class PythonGuide {
 public:
  using Scalar = double;
  using State = RunTimeState;
  using Input = double;
  static constexpr int n_observed = static_cast<int>(most_states);

  PythonGuide(const py::object& object, Eigen::Index order, double sample_s)
      : calls_(std::make_shared<PythonCalls>(object, order, true)),
        sample_s_(sample_s),
        corrects_(!py::getattr(object, "correct", py::none()).is_none()) {}

  State at_rest(double angle_deg) const noexcept {
    State x{};
    calls_->call([&](py::object& o) { calls_->take(o.attr("at_rest")(angle_deg), "at_rest", x.data(), order()); });
    calls_->forget(x);
    return x;
  }
  void step(State& x, double duty) const noexcept { calls_->step(x, duty); }
  double output(const State& x) const noexcept { return calls_->output(x); }
  double sample_s() const noexcept { return sample_s_; }
  Eigen::Index order() const noexcept { return calls_->order(); }
  void correct(State& x, double angle_deg, const throttle::ObserverGains&) const noexcept {
    if (!corrects_) return;
    calls_->call([&](py::object& o) {
      calls_->take(o.attr("correct")(calls_->column(x), angle_deg), "correct", x.data(), order());
    });
    calls_->forget(x);
  }
  void raise_if_failed() const { calls_->raise_if_failed(); }
  template <class S>
  static auto numbers(S& x) noexcept {
    std::array<decltype(x.data()), most_states> places{};
    for (std::size_t i = 0; i < most_states; ++i)
      places[i] = &x[i];
    return places;
  }

 private:
  std::shared_ptr<PythonCalls> calls_;
  double sample_s_;
  bool corrects_;
};

}  // namespace mgdd::bindings
