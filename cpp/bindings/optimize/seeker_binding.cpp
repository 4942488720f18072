#include "optimize/seeker_binding.hpp"

#include <variant>

namespace mgdd::bindings {
namespace {

template <class S>
bool take(const py::handle& object, std::vector<optimize::Seeker>& into) {
  if (!py::isinstance<BoundSeeker<S>>(object)) return false;
  into.push_back(object.cast<const BoundSeeker<S>&>().use()->seeker());
  return true;
}

template <class... S>
bool take_any(const py::handle& object, std::vector<optimize::Seeker>& into, const std::variant<S...>*) {
  return (take<S>(object, into) || ...);
}

}  // namespace

optimize::Seeker seeker_of(const py::handle& object, const char* argument) {
  std::vector<optimize::Seeker> found;
  if (take_any(object, found, static_cast<const optimize::Seeker*>(nullptr))) return found.front();
  throw about(argument, ParameterError(std::string(argument) + ": " + std::string(py::repr(object)) +
                                       " is not a seeker of mgdd.optimize"));
}

}  // namespace mgdd::bindings
