// Binds rig/frame.hpp.
#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "binding.hpp"
#include "keywords.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/rig/bus_monitor.hpp"
#include "mgdd/rig/frame.hpp"
#include "rig/payload.hpp"
#include "rig/rig_binding.hpp"

namespace mgdd::bindings {
namespace {

using rig::Frame;

/// Payload and size in one, as bytes.
struct Data {
  const char* name = "data";
  const char* doc = "Payload, up to 64 bytes.";
  using Argument = py::buffer;  // a message of python-can holds a bytearray

  void put(Frame& frame, const py::buffer& given) const {
    const std::vector<std::uint8_t> bytes = to_payload(given);
    std::copy(bytes.begin(), bytes.end(), frame.data.begin());
    frame.size = static_cast<std::uint8_t>(bytes.size());
  }
  py::bytes get(const Frame& frame) const { return as_bytes(frame.payload()); }
};
py::arg_v keyword(const Data& row, const Frame&) {
  return py::arg_v(row.name, py::bytes());
}

void check(const Frame& frame) {
  require_within("id", frame.id, 0, frame.extended || frame.error ? 0x1FFFFFFF : 0x7FF);
}

}  // namespace

void bind_frame(py::module_& m) {
  using F = Frame;
  py::class_<F> cls(m, "Frame", R"(One CAN or CAN FD frame. Keyword-only and immutable.

Parameters
----------
id : int
    Identifier: 11 bits, 29 of an extended frame; of an error frame its class bits.
data : bytes
    Payload, up to 64 bytes.
extended, error, received, fd, bit_rate_switch, remote : bool
    29-bit identifier; news of a bus error; from the bus rather than sent by us; CAN FD; its data at the higher rate;
    request of a frame.
channel : int
    Which bus, where one record holds several.
monotonic_ns, bus_ns : int
    When it was received or handed to the bus, and the driver's own stamp [ns].

Examples
--------
>>> from mgdd.rig import Frame
>>> Frame(id=0x121, data=bytes(3), received=True).data
b'\x00\x00\x00'
)");
  bind_rows(
      cls, "Frame",
      std::tuple{needed("id", &F::id, "Identifier."), Data{}, plain("extended", &F::extended, "29-bit identifier."),
                 plain("error", &F::error, "News of a bus error."),
                 plain("received", &F::received, "From the bus rather than sent by us."),
                 plain("fd", &F::fd, "CAN FD."), plain("bit_rate_switch", &F::bit_rate_switch, "Fast data."),
                 plain("remote", &F::remote, "Request of a frame."), plain("channel", &F::channel, "Which bus."),
                 plain("monotonic_ns", &F::monotonic_ns, "When received or handed to the bus [ns]."),
                 plain("bus_ns", &F::bus_ns, "Stamp of the driver [ns]; 0: none.")},
      &check);
  m.def(
      "error_classes",
      [](const Frame& frame) {
        const std::vector<std::string_view> names = error_classes(frame);
        return std::vector<std::string>(names.begin(), names.end());
      },
      py::arg("frame"), R"(Name what an error frame reports, as Linux defines its bits.

Parameters
----------
frame : Frame
    An error frame.

Returns
-------
list of str
    ``"transmit_timeout"``, ``"lost_arbitration"``, ``"controller"``, ``"protocol"``, ``"transceiver"``,
    ``"no_acknowledgement"``, ``"bus_off"``, ``"bus_error"``, ``"restarted"``; ``"error_passive"`` last where the data of a
    controller error say so; ``"unknown"`` where no bit is known.
)");
}

}  // namespace mgdd::bindings
