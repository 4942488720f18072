// What every class of the module does as an object of Python, in one place for all of them: it pickles and copies by
// every protocol, and one whose constructor has not run, or raised, is a TypeError wherever it is used.
#include <cstddef>
#include <string>

#include "binding.hpp"

namespace mgdd::bindings {
namespace {

// Protocols 0 and 1 would make an instance of the common base of all bound classes, which pybind11 answers by ending
// the process. __setstate__ takes what __getstate__ gave by every protocol.
py::tuple reduced(const py::object& self) {
  const py::object cls = py::type::of(self);
  if (!py::hasattr(cls, "__setstate__")) {
    throw py::type_error(cls.attr("__name__").cast<std::string>() +
                         " cannot be pickled or copied: pickle what it was made from, and make it again");
  }
  return py::make_tuple(py::module_::import("copyreg").attr("__newobj__"), py::make_tuple(cls),
                        self.attr("__getstate__")());
}

// pybind11 asks for memory here when a function is given an object that was never made; it would not fill it.
void* refuse_unmade(std::size_t) {
  throw py::type_error("this object was never made: its constructor has not run, or raised; make it anew");
}

// Python's own text of an object, for a class that has none: it does not look into the object.
py::str shown(const py::object& self) {
  auto* instance = reinterpret_cast<py::detail::instance*>(self.ptr());
  if (!instance->get_value_and_holder().holder_constructed()) refuse_unmade(0);
  return py::reinterpret_steal<py::str>(PyBaseObject_Type.tp_repr(self.ptr()));
}

}  // namespace

void complete_class(const py::handle& cls) {
  py::detail::type_info* info = py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(cls.ptr()));
  if (info == nullptr) return;
  info->operator_new = &refuse_unmade;
  const auto own = [cls](auto answer) {  // any object may be given where a class is asked for its method
    return [cls, answer](const py::object& self) {
      if (!py::isinstance(self, cls)) throw py::reference_cast_error();
      return answer(self);
    };
  };
  cls.attr("__reduce__") = py::cpp_function(own(&reduced), py::name("__reduce__"), py::is_method(cls),
                                            "What pickle and copy make it again from.");
  if (!cls.attr("__dict__").contains("__repr__"))
    cls.attr("__repr__") = py::cpp_function(own(&shown), py::name("__repr__"), py::is_method(cls));
}

}  // namespace mgdd::bindings
