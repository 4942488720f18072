// Binds rig/frame.hpp.
#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "binding.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/rig/bus_monitor.hpp"
#include "mgdd/rig/frame.hpp"
#include "rig/payload.hpp"
#include "rig/rig_binding.hpp"

namespace mgdd::bindings {
namespace {

using rig::Frame;

// The payload comes as any buffer: a message of python-can holds a bytearray.
Frame frame_of(std::uint32_t id, const py::buffer& data, bool extended, bool error, bool received, bool fd,
               bool bit_rate_switch, bool remote, int channel, std::int64_t monotonic_ns, std::int64_t bus_ns) {
  require_within("id", id, 0, extended || error ? 0x1FFFFFFF : 0x7FF);
  Frame frame{};
  const std::vector<std::uint8_t> bytes = to_payload(data);
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  frame.size = static_cast<std::uint8_t>(bytes.size());
  frame.id = id, frame.extended = extended, frame.error = error, frame.received = received, frame.fd = fd;
  frame.bit_rate_switch = bit_rate_switch, frame.remote = remote;
  frame.channel = static_cast<decltype(frame.channel)>(channel);
  frame.monotonic_ns = monotonic_ns, frame.bus_ns = bus_ns;
  return frame;
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
>>> from mgdd.rig.realtime import Frame
>>> Frame(id=0x121, data=bytes(3), received=True).data
b'\x00\x00\x00'
)");
  using py::arg;
  cls.def(py::init(&frame_of), py::kw_only(), arg("id"), arg("data") = py::bytes(), arg("extended") = false,
          arg("error") = false, arg("received") = false, arg("fd") = false, arg("bit_rate_switch") = false,
          arg("remote") = false, arg("channel") = 0, arg("monotonic_ns") = 0, arg("bus_ns") = 0)
      .def_readonly("id", &F::id, "Identifier.")
      .def_property_readonly(
          "data", [](const F& f) { return as_bytes(f.payload()); }, "Payload, up to 64 bytes.")
      .def_readonly("extended", &F::extended, "29-bit identifier.")
      .def_readonly("error", &F::error, "News of a bus error.")
      .def_readonly("received", &F::received, "From the bus rather than sent by us.")
      .def_readonly("fd", &F::fd, "CAN FD.")
      .def_readonly("bit_rate_switch", &F::bit_rate_switch, "Fast data.")
      .def_readonly("remote", &F::remote, "Request of a frame.")
      .def_readonly("channel", &F::channel, "Which bus.")
      .def_readonly("monotonic_ns", &F::monotonic_ns, "When received or handed to the bus [ns].")
      .def_readonly("bus_ns", &F::bus_ns, "Stamp of the driver [ns]; 0: none.");
  bind_value(cls, "Frame", [](const F& f) {
    py::dict out;
    for (const char* name : {"id", "data", "extended", "error", "received", "fd", "bit_rate_switch", "remote",
                             "channel", "monotonic_ns", "bus_ns"})
      out[name] = py::cast(f).attr(name);
    return out;
  });
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
