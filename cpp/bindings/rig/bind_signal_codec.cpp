// Binds rig/signal_codec.hpp: one signal in a payload, a column of payloads, the check of a message.
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/rig/signal_codec.hpp"
#include "record_binding.hpp"
#include "rig/payload.hpp"
#include "rig/rig_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

[[noreturn]] void does_not_fit(const SignalLayout& layout, std::size_t bytes) {
  throw about("payload", ShapeError("payload has " + std::to_string(bytes) + " bytes: the signal of " +
                                    std::to_string(layout.length) + " bits from bit " + std::to_string(layout.start) +
                                    " reaches beyond"));
}

/// What can be sent, as words.
std::string range_of(const SignalLayout& layout) {
  std::string words = "must be finite";
  if (layout.minimum) words += " and >= " + text(*layout.minimum);
  if (layout.maximum) words += " and <= " + text(*layout.maximum);
  return words + " and fit the " + std::to_string(layout.length) + " bits of the signal";
}

void require_packed(PackStatus status, const SignalLayout& layout, double value, std::size_t bytes) {
  if (status == PackStatus::does_not_fit) does_not_fit(layout, bytes);
  if (status != PackStatus::ok && status != PackStatus::clamped) {
    throw ParameterError("value", value, range_of(layout));
  }
}

py::bytes pack_value(const SignalLayout& layout, const py::buffer& payload, double value, const std::string& beyond) {
  const OutOfRange rule = parse_name<OutOfRange>("out_of_range", beyond);
  std::vector<std::uint8_t> bytes = to_payload(payload);
  require_packed(pack(layout, value, rule, bytes), layout, value, bytes.size());
  return as_bytes(bytes);
}

/// A float without its scale.
SignalLayout unscaled(SignalLayout layout) {
  layout.scale = 1.0;
  layout.offset = 0.0;
  layout.minimum = layout.maximum = std::nullopt;
  return layout;
}

bool holds_float(const SignalLayout& layout) {
  return layout.type == RawType::float32 || layout.type == RawType::float64;
}

/// An integer of Python in 64 bits; none where it needs more.
std::optional<std::uint64_t> as_word(const py::int_& raw, bool with_sign) {
  int overflow = 0;
  const long long narrow = PyLong_AsLongLongAndOverflow(raw.ptr(), &overflow);
  if (overflow == 0) return with_sign || narrow >= 0 ? std::optional(static_cast<std::uint64_t>(narrow)) : std::nullopt;
  if (with_sign || overflow < 0) return std::nullopt;
  const unsigned long long wide = PyLong_AsUnsignedLongLong(raw.ptr());
  if (PyErr_Occurred() == nullptr) return wide;
  PyErr_Clear();
  return std::nullopt;
}

py::bytes pack_raw_value(const SignalLayout& layout, const py::buffer& payload, const py::object& raw) {
  if (holds_float(layout)) return pack_value(unscaled(layout), payload, raw.cast<double>(), "refuse");
  if (!py::isinstance<py::int_>(raw)) refuse("raw", raw, "a whole number");
  std::vector<std::uint8_t> bytes = to_payload(payload);
  const auto word = as_word(raw.cast<py::int_>(), layout.type == RawType::signed_integer);
  const PackStatus status = word ? pack_raw(layout, *word, OutOfRange::refuse, bytes) : PackStatus::out_of_range;
  if (status == PackStatus::does_not_fit) does_not_fit(layout, bytes.size());
  if (status == PackStatus::out_of_range) {
    refuse("raw", raw, "within the " + std::to_string(layout.length) + " bits of the signal");
  }
  return as_bytes(bytes);
}

double unpack_value(const SignalLayout& layout, const py::buffer& payload) {
  const std::vector<std::uint8_t> bytes = to_payload(payload);
  const std::optional<double> value = unpack(layout, bytes);
  if (!value) does_not_fit(layout, bytes.size());
  return *value;
}

std::variant<std::int64_t, std::uint64_t, double> unpack_raw_value(const SignalLayout& layout,
                                                                   const py::buffer& payload) {
  if (holds_float(layout)) return unpack_value(unscaled(layout), payload);
  const std::vector<std::uint8_t> bytes = to_payload(payload);
  const std::optional<std::uint64_t> raw = unpack_raw(layout, bytes);
  if (!raw) does_not_fit(layout, bytes.size());
  if (layout.type == RawType::signed_integer) return static_cast<std::int64_t>(*raw);
  return *raw;
}

using Payloads = py::array_t<std::uint8_t, py::array::c_style>;

py::array_t<double> unpack_column(const SignalLayout& layout, const Payloads& payloads) {
  if (payloads.ndim() != 2) {
    throw about("payloads", ShapeError("payloads has " + std::to_string(payloads.ndim()) +
                                       " dimensions: must be a table of uint8, a row per frame"));
  }
  const auto rows = static_cast<std::size_t>(payloads.shape(0)), width = static_cast<std::size_t>(payloads.shape(1));
  py::array_t<double> out(payloads.shape(0));
  const std::uint8_t* from = payloads.data();
  double* to = out.mutable_data();
  const bool inside = without_gil([&] {
    for (std::size_t i = 0; i < rows; ++i) {
      const std::optional<double> value = unpack(layout, {from + i * width, width});
      if (!value) return false;
      to[i] = *value;
    }
    return true;
  });
  if (!inside) does_not_fit(layout, width);
  return out;
}

void check_message(const std::map<std::string, SignalLayout>& signals, int size,
                   const std::optional<std::map<std::string, std::vector<int>>>& branches) {
  std::vector<Signal> all;
  for (const auto& [name, layout] : signals) {
    Signal signal{.name = name, .layout = layout};
    if (branches && branches->contains(name)) signal.branches = branches->at(name);
    all.push_back(std::move(signal));
  }
  validate(all, size);
}

}  // namespace

void bind_signal_codec(py::module_& m) {
  using S = SignalLayout;
  py::class_<S> cls(m, "SignalLayout",
                    R"(Where a number stands in the bits of a CAN payload, as a DBC says it.

Keyword-only and immutable. The physical value is ``raw * scale + offset``. A value never wraps, and NaN is never sent.

Parameters
----------
start, length : int
    First bit as a DBC counts (of a big-endian signal its most significant one), and 1 to 64 bits.
byte_order : {"little_endian", "big_endian"}
    Intel or Motorola.
raw_type : {"unsigned", "signed", "float32", "float64"}
    Meaning of the bits.
scale, offset : float
    Of the physical value.
minimum, maximum : float, optional
    Bounds of the physical value.

Examples
--------
>>> from mgdd._core.rig import SignalLayout
>>> duty = SignalLayout(start=16, length=12, raw_type="signed", scale=0.0005, minimum=-1.0, maximum=1.0)
>>> payload = duty.pack(bytes(8), -3.0)
>>> payload.hex(), duty.unpack(payload)
('0000300800000000', -1.0)
)");
  bind_record(cls, "SignalLayout");
  cls.def("pack", &pack_value, py::arg("payload"), py::arg("value"), py::arg("out_of_range") = "clamp",
          "The payload with this physical value; beyond its range it is clamped, or with 'refuse' a ParameterError.");
  cls.def("unpack", &unpack_value, py::arg("payload"), "The physical value.");
  cls.def("pack_raw", &pack_raw_value, py::arg("payload"), py::arg("raw"),
          "The payload with this raw number; ParameterError where it does not fit the bits.");
  cls.def("unpack_raw", &unpack_raw_value, py::arg("payload"), "The raw number.");
  cls.def("unpack_column", &unpack_column, py::arg("payloads").noconvert(),
          "The physical values of a table of payloads, uint8 with a row per frame, without the GIL.");
  m.def("check_message", &check_message, py::arg("signals"), py::arg("size"), py::arg("branches") = py::none(),
        "ParameterError naming signals that reach beyond a message of `size` bytes or share bits; `branches` gives the "
        "values of the multiplexer that select a signal.");
}

}  // namespace mgdd::bindings
