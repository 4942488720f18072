// Binds rig/ring_transport.hpp and rig/socketcan_transport.hpp.
#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "binding.hpp"
#include "interruptible.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/monotonic_clock.hpp"
#include "mgdd/rig/ring_transport.hpp"
#include "mgdd/rig/socketcan_transport.hpp"
#include "rig/rig_binding.hpp"
#include "rig/transport_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

constexpr std::int64_t between_looks_ns = 200'000, between_signals_ns = 50'000'000;

// Looks again and again, without the GIL, until a frame is there or the time is over; None then.
template <class Look>
py::object next_frame(double timeout_s, Look look) {
  require_within("timeout_s", timeout_s, 0.0, 3600.0, "s");
  const std::int64_t until_ns = monotonic_ns() + static_cast<std::int64_t>(timeout_s * 1e9);
  Frame frame;
  while (!look(frame)) {
    const std::int64_t now_ns = monotonic_ns();
    if (now_ns >= until_ns) return py::none();
    bool found = false;
    {
      const py::gil_scoped_release release;
      const std::int64_t pause_ns = std::min(until_ns, now_ns + between_signals_ns);
      for (std::int64_t t = now_ns; t < pause_ns && !found; t = monotonic_ns()) {
        sleep_until_ns(std::min(t + between_looks_ns, pause_ns));
        found = look(frame);
      }
    }
    if (auto raised = raised_by_a_signal()) throw py::error_already_set(*raised);
    if (found) break;
  }
  return py::cast(frame);
}

template <class T>
void bind_state(py::class_<T, std::shared_ptr<T>>& cls) {
  cls.def_property_readonly(
      "counts", [](const T& t) { return counts_of(t.counts(), t.monitor()); },
      "Frames by what became of them, and error frames by kind, as a new dict.");
  cls.def_property_readonly(
      "bus_state", [](const T& t) { return as_str(name_of(t.bus_state())); },
      "``\"active\"``, ``\"warning\"``, ``\"passive\"`` or ``\"off\"``.");
  cls.def_property_readonly("in_use", [](T& t) { return t.claim().taken(); }, "Whether a loop takes its frames.");
}

void require_free(Claim& claim) {
  if (claim.taken()) throw RigError("the transport serves a loop: its frames are the loop's");
}

void bind_ring(py::module_& m) {
  using T = RingTransport;
  py::class_<T, std::shared_ptr<T>> cls(m, "RingTransport",
                                        R"(A bus behind two rings, fed and drained by a thread of Python.

A `RealtimeLoop` takes and gives frames without waiting for Python. `BusBridge` connects it with any interface of
python-can; a simulated plant may serve it as well.

Parameters
----------
receive_capacity : int
    Frames from the bus that may wait for the loop, a power of two; what does not fit is lost and counted.
send_capacity : int
    Frames towards the bus that may wait, a power of two. Short, so that no command leaves late: a command that finds no
    room is not sent, and the loop knows.

Raises
------
mgdd.errors.ParameterError
    A capacity that is not a power of two from 2 to 16777216.

See Also
--------
BusBridge : a python-can bus on the other side.
SocketCanTransport : a CAN interface of Linux, without Python in between.

Examples
--------
>>> from mgdd.rig.realtime import Frame, RingTransport
>>> bus = RingTransport()
>>> bus.feed(Frame(id=0x121, data=bytes(8)))
True
>>> bus.counts["lost"], bus.take() is None, bus.bus_state
(0, True, 'active')
)");
  cls.def(py::init<std::size_t, std::size_t>(), py::kw_only(), py::arg("receive_capacity") = 1024,
          py::arg("send_capacity") = 16);
  cls.def(
      "feed", [](T& t, const Frame& frame) { return t.feed(frame); }, py::arg("frame"),
      R"(Hand a frame from the bus to the loop.

Parameters
----------
frame : Frame
    Without a stamp ``monotonic_ns`` it gets that of now.

Returns
-------
bool
    False, and counted as lost, where it finds no room.
)");
  cls.def(
      "take", [](T& t, double timeout_s) { return next_frame(timeout_s, [&t](Frame& f) { return t.take(f); }); },
      py::arg("timeout_s") = 0.0, R"(Take the next frame that the loop sends; other threads run while it waits.

Parameters
----------
timeout_s : float
    How long to wait for one, 0 to 3600 [s].

Returns
-------
Frame or None
    None where none came.
)");
  cls.def("fail", &T::fail, "Say that the bus is gone, for good: the loop sees it as off and opens the bridge.");
  cls.def_property_readonly("waiting_to_send", &T::waiting_to_send, "Frames of the loop that nobody has taken yet.");
  cls.def_property_readonly("waiting_for_loop", &T::waiting_for_loop, "Frames that the loop has not taken yet.");
  bind_state(cls);
}

using FilterArgument = std::tuple<std::uint32_t, std::uint32_t, bool>;

void bind_socketcan(py::module_& m) {
  using T = SocketCanTransport;
  py::class_<T, std::shared_ptr<T>> cls(
      m, "SocketCanTransport",
      R"(A CAN interface of Linux as a raw socket that never blocks, for a `RealtimeLoop`.

Several sockets on one interface see each other's frames: a logger of python-can beside it records all, our own commands
too. Set the queue of the interface short (``ip link set can0 txqueuelen 10``), or old commands leave late.

Parameters
----------
interface : str
    Its name, for example ``"can0"``.
fd : bool
    CAN FD frames too.
filters : sequence of tuple
    ``(id, mask, extended)``: a frame passes whose identifier agrees with one of them in the bits of its mask; all frames
    if empty. They hold before the first frame can arrive.
receive_buffer_bytes : int
    Asked of the kernel; `receive_buffer_bytes` says what it granted.
send_patience_s : float
    How long to try again where the queue of the interface is full, 0 to 0.1 [s].

Raises
------
mgdd.errors.ParameterError
    A setting outside its domain.
mgdd.errors.RigError
    The kernel is built without CAN; or the interface does not exist, is down, is of another type or cannot do CAN FD.

See Also
--------
RingTransport : any other adapter, through python-can.

Examples
--------
>>> from mgdd.errors import RigError
>>> from mgdd.rig.realtime import SocketCanTransport
>>> try:
...     bus = SocketCanTransport("no_such_can")
... except RigError:
...     print("no bus")
no bus
)");
  const SocketCanSettings standard;
  cls.def(py::init([](const std::string& interface, bool fd, const std::vector<FilterArgument>& filters,
                      int receive_buffer_bytes, double send_patience_s) {
            SocketCanSettings s;
            s.interface = interface;
            s.fd = fd;
            for (const auto& [id, mask, extended] : filters)
              s.filters.push_back({id, mask, extended});
            s.receive_buffer_bytes = receive_buffer_bytes;
            s.send_patience_s = send_patience_s;
            return std::make_shared<T>(s);
          }),
          py::arg("interface"), py::kw_only(), py::arg("fd") = standard.fd,
          py::arg("filters") = std::vector<FilterArgument>{},
          py::arg("receive_buffer_bytes") = standard.receive_buffer_bytes,
          py::arg("send_patience_s") = standard.send_patience_s);
  cls.def(
      "receive",
      [](T& t, double timeout_s) {
        require_free(t.claim());
        return next_frame(timeout_s, [&t](Frame& f) { return t.receive(f); });
      },
      py::arg("timeout_s") = 0.0, R"(Take the next frame from the bus; other threads run while it waits.

Parameters
----------
timeout_s : float
    How long to wait for one, 0 to 3600 [s].

Returns
-------
Frame or None
    None where none came.

Raises
------
mgdd.errors.RigError
    A loop takes the frames.
)");
  cls.def(
      "send",
      [](T& t, const Frame& frame) {
        require_free(t.claim());
        return as_str(name_of(without_gil([&] { return t.send(frame); })));
      },
      py::arg("frame"), R"(Send a frame now.

Parameters
----------
frame : Frame
    Its stamps are not used.

Returns
-------
str
    ``"sent"``, ``"full"`` where the queue had no room in time, ``"failed"`` where the frame or the interface is unfit.

Raises
------
mgdd.errors.RigError
    A loop sends here.
)");
  cls.def_property_readonly("receive_buffer_bytes", &T::receive_buffer_bytes, "Bytes that the kernel granted.");
  bind_state(cls);
}

}  // namespace

py::dict counts_of(const TransportCounts& c, const BusMonitor& monitor) {
  py::dict out;
  out["received"] = c.received.get();
  out["sent"] = c.sent.get();
  out["lost"] = c.lost.get();
  out["retries"] = c.retries.get();
  out["full"] = c.full.get();
  out["failed"] = c.failed.get();
  const BusMonitor::Counts& e = monitor.counts();
  out["error_frames"] = e.error_frames.get();
  out["bus_off"] = e.bus_off.get();
  out["restarted"] = e.restarted.get();
  out["controller_errors"] = e.controller.get();
  out["controller_overflows"] = e.overflow.get();
  out["other_errors"] = e.other.get();
  return out;
}

void bind_transports(py::module_& m) {
  bind_ring(m);
  bind_socketcan(m);
}

}  // namespace mgdd::bindings
