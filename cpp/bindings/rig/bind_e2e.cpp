// Binds rig/e2e.hpp: settings of the protection of a payload, sender and receiver.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/rig/e2e.hpp"
#include "record_binding.hpp"
#include "rig/payload.hpp"
#include "rig/rig_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

using CrcNumbers = std::tuple<int, int, int>;
using CrcArgument = std::variant<std::string, CrcNumbers>;

std::uint8_t as_byte(const std::string& name, int value) {
  require_within(name, value, 0, 255);
  return static_cast<std::uint8_t>(value);
}

Crc8 crc_from(const CrcArgument& given) {
  if (const auto* name = std::get_if<std::string>(&given)) return named_crc8(*name);
  const auto& [polynomial, start, final_xor] = std::get<CrcNumbers>(given);
  return {.polynomial = as_byte("polynomial of crc", polynomial),
          .start = as_byte("start of crc", start),
          .final_xor = as_byte("final xor of crc", final_xor)};
}

CrcArgument crc_argument(const Crc8& crc) {
  if (const auto name = crc_name(crc)) return std::string(*name);
  return CrcNumbers{crc.polynomial, crc.start, crc.final_xor};
}

}  // namespace

/// A CRC-8 by name, or as (polynomial, start, final xor).
template <>
struct Written<Crc8> {
  using Argument = CrcArgument;

  static Argument get(const Crc8& crc) { return crc_argument(crc); }
  static void put(Crc8& crc, const Argument& given, const FieldInfo&, std::size_t) { crc = crc_from(given); }
};

/// Sixteen bytes, or None.
template <>
struct Written<std::optional<std::array<std::uint8_t, 16>>> {
  using Argument = std::optional<std::vector<int>>;

  static py::object get(const std::optional<std::array<std::uint8_t, 16>>& bytes) {
    return bytes ? py::object(py::tuple(py::cast(*bytes))) : py::none();
  }
  static void put(std::optional<std::array<std::uint8_t, 16>>& bytes, const Argument& given, const FieldInfo& info,
                  std::size_t) {
    bytes.reset();
    if (!given) return;
    bytes.emplace();
    if (given->size() != bytes->size()) throw about(info.name, ParameterError("data_id_list: must be 16 bytes"));
    for (std::size_t i = 0; i < bytes->size(); ++i)
      (*bytes)[i] = as_byte(std::string(info.name), (*given)[i]);
  }
};

namespace {

py::bytes protected_payload(const E2eSettings& settings, int counter, const py::buffer& payload) {
  std::vector<std::uint8_t> bytes = to_payload(payload);
  if (!protect(settings, counter, bytes)) {
    if (bytes.size() != static_cast<std::size_t>(settings.size)) {
      throw about("payload", ShapeError("payload has " + std::to_string(bytes.size()) + " bytes: must be " +
                                        std::to_string(settings.size) + ", the size of the settings"));
    }
    throw ParameterError("counter", counter, "must be in [0, " + std::to_string(settings.counter_modulus - 1) + "]");
  }
  return as_bytes(bytes);
}

py::dict counts(const E2eCheck& check) {
  py::dict out;
  for (const auto& [status, name] : names<E2eStatus>())
    out[as_str(name)] = check.counts().of(status);
  out["missing"] = check.counts().missing;
  return out;
}

constexpr const char* settings_doc = R"(End-to-end protection of a CAN payload: an alive counter and a CRC-8.

Keyword-only and immutable. The defaults are those of a frame of 8 bytes with the CRC in its first byte and the counter
in the low half of the second. Much like AUTOSAR profiles 1 and 2; not a conformant implementation of either.

Parameters
----------
crc : str or tuple of int
    ``"sae_j1850"`` (polynomial 0x1D) or ``"h2f"`` (0x2F), both with start and final xor 0xFF; otherwise (polynomial,
    start, final xor).
data_id : int
    Identifier that both sides know, 0 to 65535: a frame of another message has a wrong CRC.
data_id_mode : {"both", "low", "alternating", "none", "list"}
    Bytes of it under the CRC: low then high, the low one, low where the counter is even and high where it is odd, none;
    all before the payload. ``"list"``: the byte of `data_id_list` that the counter chooses, after the payload.
data_id_list : sequence of int, optional
    Sixteen bytes, for the mode ``"list"``.
size : int
    Bytes of the payload, 2 to 64.
crc_byte, counter_byte : int
    Their places, from 0.
counter_place : {"low_nibble", "high_nibble", "byte"}
    Bits of the counter in its byte.
counter_modulus : int
    The counter runs from 0 to this minus 1.
max_step : int
    Largest step between two frames that counts as good: one less may be lost.
bad_until_invalid, good_until_valid : int
    Frames in a row until `E2eCheck.valid` changes.

Raises
------
mgdd.errors.ParameterError
    A field outside its domain, naming field, value and bound.

Examples
--------
>>> from mgdd._core.rig import E2eCheck, E2eSettings, protect
>>> settings = E2eSettings(data_id=0x120)
>>> check = E2eCheck(settings)
>>> [check.push(protect(settings, counter, bytes(8))) for counter in (4, 5, 6)], check.valid
(['initial', 'ok', 'ok'], True)
>>> check.push(protect(E2eSettings(data_id=0x121), 7, bytes(8)))
'wrong_crc'
)";

constexpr const char* check_doc = R"(The receiver's check of protected payloads.

Valid after ``good_until_valid`` good frames in a row, no longer after ``bad_until_invalid`` bad ones in a row. It sees
frames and not time: a frame that never comes needs a time limit beside it.

Parameters
----------
settings : E2eSettings
    As the sender has them.

Examples
--------
>>> from mgdd._core.rig import E2eCheck, E2eSettings, protect
>>> settings = E2eSettings(max_step=2)
>>> check = E2eCheck(settings)
>>> [check.push(protect(settings, counter, bytes(8))) for counter in (14, 0, 0, 5)]
['initial', 'ok', 'repeated', 'lost']
>>> check.counts["missing"]
5
)";

}  // namespace

void bind_e2e(py::module_& m) {
  using S = E2eSettings;
  py::class_<S> settings(m, "E2eSettings", settings_doc);
  bind_record(settings, "E2eSettings");
  settings.def("next_counter", &next_counter, py::arg("counter"), "The counter that follows.");

  py::class_<E2eCheck>(m, "E2eCheck", check_doc)
      .def(py::init<const S&>(), py::arg("settings"))
      .def(
          "push",
          [](E2eCheck& self, const py::buffer& payload) { return as_str(name_of(self.push(to_payload(payload)))); },
          py::arg("payload"),
          "Judge the next payload: 'ok', 'initial', 'repeated', 'lost', 'wrong_crc', 'wrong_length' or "
          "'wrong_counter'.")
      .def_property_readonly("valid", &E2eCheck::valid, "Whether enough good frames came, and not too many bad ones.")
      .def_property_readonly("counts", &counts, "Frames by status, and 'missing': frames that the counter skipped.")
      .def_property_readonly("settings", &E2eCheck::settings, "As given.")
      .def("reset", &E2eCheck::reset, "Forget the last frame and the validity; the counts stay.");

  m.def("protect", &protected_payload, py::arg("settings"), py::arg("counter"), py::arg("payload"),
        "Puts counter and checksum into a payload.");
  m.def(
      "crc8",
      [](const py::bytes& data, const CrcArgument& crc) {
        const auto text = static_cast<std::string_view>(data);
        return crc_from(crc).of(std::vector<std::uint8_t>(text.begin(), text.end()));
      },
      py::arg("data"), py::arg("crc") = "sae_j1850", "CRC-8 by name, or of (polynomial, start, final xor).");
}

}  // namespace mgdd::bindings
