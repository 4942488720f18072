#include "record_binding.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "mgdd/common/error.hpp"

namespace mgdd::bindings {
namespace {

bool is_unbounded(const Domain& domain) {
  return domain.lower <= -unbounded && domain.upper >= unbounded;
}

// mgdd.errors.ParameterError for a value that is not of the kind of its member.
[[noreturn]] void refuse_kind(const char* owner, const Member& member, const py::handle& value) {
  py::list signatures;
  signatures.append("(*, " + std::string(member.info.name) + ": " + member.kind + ") -> None");
  py::dict given;
  given[as_str(member.info.name)] = value;
  const py::object error =
      py::module_::import("mgdd._arguments").attr("refusal")(owner, signatures, py::tuple(), given);
  PyErr_SetObject(py::type::of(error).ptr(), error.ptr());
  throw py::error_already_set();
}

[[noreturn]] void unknown_field(const char* owner, const py::handle& key, const py::dict& known) {
  std::string hint =
      py::module_::import("mgdd.errors").attr("did_you_mean")(key, known.attr("keys")()).cast<std::string>();
  if (hint.empty()) hint = "one of " + std::string(py::str(py::str(", ").attr("join")(known.attr("keys")())));
  throw about(owner, ParameterError(std::string(owner) + " has no field '" + std::string(py::str(key)) + "': " + hint));
}

}  // namespace

bool Members::take(void* record, const py::args& places, const py::kwargs& keywords) const {
  if (places.size() > places_) return false;
  std::size_t taken = 0;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const Member& member = members_[i];
    py::handle value = PyDict_GetItemString(keywords.ptr(), std::string(member.info.name).c_str());
    if (i < places.size()) {
      if (value) return false;
      value = places[i].ptr();
    } else if (value) {
      ++taken;
    } else if (member.info.form == DefaultForm::required) {
      return false;
    } else if (member.per_input) {
      value = member.standard;
    }
    if (value && !member.put(record, value)) return false;
  }
  return taken == keywords.size();
}

void Members::change(void* record, const char* owner, const py::dict& changes) const {
  for (const auto& [key, value] : changes) {
    const auto name = py::cast<std::string>(key);
    const auto member =
        std::find_if(members_.begin(), members_.end(), [&](const Member& each) { return each.info.name == name; });
    if (member == members_.end()) unknown_field(owner, key, to_dict(record));
    if (!member->put(record, value)) refuse_kind(owner, *member, value);
  }
}

py::dict Members::to_dict(const void* record) const {
  py::dict out;
  for (const Member& member : members_)
    out[as_str(member.info.name)] = member.get(record);
  return out;
}

py::dict Members::described() const {
  py::dict out;
  for (const Member& member : members_) {
    py::dict one;
    one["unit"] = as_str(member.info.unit);
    if (!member.choices.is_none()) one["choices"] = member.choices;
    if (const Domain& domain = member.info.domain; member.number || !is_unbounded(domain)) {
      one["lower"] = domain.lower;
      one["lower_open"] = domain.lower_open;
      one["upper"] = domain.upper;
    }
    one["meaning"] = as_str(member.info.meaning);
    one["default"] = member.initial;
    out[as_str(member.info.name)] = one;
  }
  return out;
}

py::dict Members::places() const {
  py::dict out;
  for (const Member& member : members_)
    out[as_str(member.info.name)] = as_str(member.place);
  return out;
}

py::str Members::text(const char* name, const void* record) const {
  py::list parts;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const py::object now = members_[i].get(record);
    if (i < places_) {
      parts.append(py::repr(now));
    } else if (!now.equal(members_[i].initial)) {
      parts.append(py::str("{}={!r}").format(as_str(members_[i].info.name), now));
    }
  }
  return py::str("{}({})").format(name, py::str(", ").attr("join")(parts));
}

void Members::show(const py::object& cls) const {
  const auto text = [](const py::handle& value) { return std::string(py::str(value)); };
  std::string signature = "(self: " + text(cls.attr("__module__")) + "." + text(cls.attr("__qualname__"));
  std::string help;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const Member& member = members_[i];
    const std::string name(member.info.name);
    if (i == places_) signature += ", *";
    signature += ", " + name + ": " + member.kind;
    if (member.info.form != DefaultForm::required) signature += " = " + text(py::repr(member.standard));
    help += "\n" + name + " : " + std::string(member.info.meaning);
    if (member.number && member.info.unit != "-") help += " [" + std::string(member.info.unit) + "]";
  }
  signature += ") -> None";
  PyObject* function = cls.attr("__init__").ptr();
  if (PyInstanceMethod_Check(function)) function = PyInstanceMethod_GET_FUNCTION(function);
  auto* record = py::detail::function_record_ptr_from_PyObject(PyCFunction_GET_SELF(function));
  const auto replace = [](auto& place, const std::string& value) {  // pybind11 frees both so
    std::free(const_cast<char*>(place));                            // NOLINT(cppcoreguidelines-no-malloc)
    place = ::strdup(value.c_str());
  };
  replace(record->signature, signature);
  replace(reinterpret_cast<PyCFunctionObject*>(function)->m_ml->ml_doc, "__init__" + signature + "\n" + help + "\n");
}

double as_number(const py::handle& key, const py::handle& value) {
  if (py::isinstance<py::bool_>(value) || py::isinstance<py::str>(value)) {
    refuse(std::string(py::str(key)), value, "one number");
  }
  const py::object number = py::reinterpret_steal<py::object>(PyNumber_Float(value.ptr()));
  if (!number) {
    PyErr_Clear();
    refuse(std::string(py::str(key)), value, "one number");
  }
  return number.cast<double>();
}

}  // namespace mgdd::bindings
