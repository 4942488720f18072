// Binds rig/ring_transport.hpp and rig/socketcan_transport.hpp. A frame is a tuple (id, data, extended, error, fd,
// bit_rate_switch, remote, monotonic_ns, bus_ns).
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
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
#include "rig/payload.hpp"
#include "rig/rig_binding.hpp"
#include "rig/transport_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

constexpr std::int64_t between_looks_ns = 200'000, between_signals_ns = 50'000'000;

py::tuple as_tuple(const Frame& f) {
  return py::make_tuple(f.id, as_bytes(f.payload()), f.extended, f.error, f.fd, f.bit_rate_switch, f.remote,
                        f.monotonic_ns, f.bus_ns);
}

Frame frame_of(std::uint32_t id, const py::buffer& data, bool extended, bool error, bool fd, bool bit_rate_switch,
               bool remote, std::int64_t monotonic_ns, std::int64_t bus_ns) {
  const std::vector<std::uint8_t> bytes = to_payload(data);
  const std::uint32_t largest = extended || error ? 0x1FFF'FFFFu : 0x7FFu;
  if (id > largest) throw ParameterError("can_id", id, "must have 11 bits, or 29 if extended");
  if (bytes.size() > 8 && !fd) {
    throw about("data",
                ShapeError("data has " + std::to_string(bytes.size()) + " bytes: must be at most 8, or fd=True"));
  }
  Frame f{.id = id, .extended = extended, .error = error, .size = static_cast<std::uint8_t>(bytes.size())};
  std::ranges::copy(bytes, f.data.begin());
  f.fd = fd;
  f.bit_rate_switch = bit_rate_switch;
  f.remote = remote;
  f.monotonic_ns = monotonic_ns;
  f.bus_ns = bus_ns;
  return f;
}

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
  return as_tuple(frame);
}

template <class Cls>
void bind_frame_keywords(Cls& cls, const char* name, auto call, const char* doc) {
  cls.def(name, call, py::arg("can_id"), py::arg("data"), py::kw_only(), py::arg("extended") = false,
          py::arg("error") = false, py::arg("fd") = false, py::arg("bit_rate_switch") = false,
          py::arg("remote") = false, py::arg("monotonic_ns") = 0, py::arg("bus_ns") = 0, doc);
}

template <class T>
void bind_state(py::class_<T, std::shared_ptr<T>>& cls) {
  cls.def_property_readonly(
      "counts", [](const T& t) { return counts_of(t.counts(), t.monitor()); },
      "Frames by what became of them, and error frames by kind, as a new dict.");
  cls.def_property_readonly(
      "bus_state", [](const T& t) { return as_str(mgdd::name_of(bus_state_names(), t.bus_state())); },
      "``\"active\"``, ``\"warning\"``, ``\"passive\"`` or ``\"off\"``.");
  cls.def_property_readonly("in_use", [](T& t) { return t.claim().taken(); }, "Whether a loop takes its frames.");
}

void require_free(Claim& claim) {
  if (claim.taken()) throw RigError("the transport serves a loop: its frames are the loop's");
}

void bind_ring(py::module_& m) {
  using T = RingTransport;
  py::class_<T, std::shared_ptr<T>> cls(m, "RingTransport", "A bus behind two rings; behind mgdd.rig.RingTransport.");
  cls.def(py::init<std::size_t, std::size_t>(), py::kw_only(), py::arg("receive_capacity") = 1024,
          py::arg("send_capacity") = 16);
  bind_frame_keywords(
      cls, "feed",
      [](T& t, std::uint32_t id, const py::buffer& data, bool extended, bool error, bool fd, bool brs, bool remote,
         std::int64_t monotonic,
         std::int64_t bus) { return t.feed(frame_of(id, data, extended, error, fd, brs, remote, monotonic, bus)); },
      "Hand a frame from the bus to the loop; False, and counted as lost, where it finds no room.");
  cls.def(
      "take", [](T& t, double timeout_s) { return next_frame(timeout_s, [&t](Frame& f) { return t.take(f); }); },
      py::arg("timeout_s") = 0.0,
      "The next frame that the loop sends, waiting without the GIL; None where there is none.");
  cls.def("fail", &T::fail, "Say that the bus is gone, for good: the loop sees it as off.");
  cls.def_property_readonly("waiting_to_send", &T::waiting_to_send, "Frames that nobody has taken yet.");
  bind_state(cls);
}

using FilterArgument = std::tuple<std::uint32_t, std::uint32_t, bool>;

void bind_socketcan(py::module_& m) {
  using T = SocketCanTransport;
  py::class_<T, std::shared_ptr<T>> cls(m, "SocketCanTransport",
                                        "A CAN interface of Linux; behind mgdd.rig.SocketCanTransport.");
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
      py::arg("timeout_s") = 0.0, "The next frame from the bus, waiting without the GIL; None where there is none.");
  bind_frame_keywords(
      cls, "send",
      [](T& t, std::uint32_t id, const py::buffer& data, bool extended, bool error, bool fd, bool brs, bool remote,
         std::int64_t monotonic, std::int64_t bus) {
        require_free(t.claim());
        const Frame frame = frame_of(id, data, extended, error, fd, brs, remote, monotonic, bus);
        return as_str(mgdd::name_of(send_result_names(), without_gil([&] { return t.send(frame); })));
      },
      "Send a frame now: ``\"sent\"``, ``\"full\"`` or ``\"failed\"``.");
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
