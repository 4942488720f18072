// Long work without the GIL that Ctrl-C can end, and what becomes of the part that was finished.
#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

#include "binding.hpp"
#include "mgdd/common/error.hpp"

namespace mgdd::bindings {

/// Lets the interpreter's signal handlers run; needs the GIL. Empty: nothing was raised.
std::optional<py::error_already_set> raised_by_a_signal();

/// Raises mgdd.errors.Interrupted.
[[noreturn]] void raise_interrupted(const std::string& kept, const py::object& partial);

/// What came of the work. After Ctrl-C `interrupted` is true and `value` holds what was finished, if anything.
template <class R>
struct Outcome {
  std::optional<R> value;
  bool interrupted = false;
};

/// Calls `work(stop)` on a thread of its own, without the GIL, while this one looks for signals every 50 ms. Ctrl-C
/// asks `work` to stop and waits for what it returns; any other exception of a handler is passed on after that.
template <class Work>
auto interruptible(Work work) -> Outcome<std::invoke_result_t<Work, std::stop_token>> {
  using R = std::invoke_result_t<Work, std::stop_token>;
  std::packaged_task<R(std::stop_token)> task(std::move(work));
  std::future<R> result = task.get_future();
  std::optional<py::error_already_set> raised;
  {
    const py::gil_scoped_release release;
    std::jthread worker(std::move(task));
    while (result.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      if (worker.get_stop_token().stop_requested()) continue;
      const py::gil_scoped_acquire gil;
      if ((raised = raised_by_a_signal())) worker.request_stop();
    }
  }
  if (!raised) raised = raised_by_a_signal();  // one that came with the end
  if (!raised) return {result.get(), false};
  if (!raised->matches(PyExc_KeyboardInterrupt)) throw py::error_already_set(*raised);
  try {
    return {result.get(), true};
  } catch (const Error&) {  // stopped so early that there is nothing to hand back
    return {std::nullopt, true};
  }
}

inline py::object as_object(py::object object) {
  return object;
}
template <class T>
  requires(!std::is_base_of_v<py::handle, T>)
py::object as_object(T value) {
  return py::cast(std::move(value));
}

/// Hands `shown(value)` to Python, as the result or as the part that an Interrupted carries.
template <class R, class Shown = std::identity>
auto hand_over(Outcome<R> outcome, Shown shown = {}) -> std::decay_t<std::invoke_result_t<Shown, R>> {
  if (!outcome.interrupted) return shown(std::move(*outcome.value));
  if (!outcome.value) raise_interrupted("interrupted: nothing was finished", py::none());
  raise_interrupted("interrupted: what was finished is in .partial", as_object(shown(std::move(*outcome.value))));
}

}  // namespace mgdd::bindings
