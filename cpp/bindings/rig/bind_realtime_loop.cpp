// Binds rig/realtime_loop.hpp; behind mgdd.rig.realtime.RealtimeLoop.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "interruptible.hpp"
#include "loop/throttle_controller_binding.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/common/error.hpp"
#include "mgdd/rig/realtime_loop.hpp"
#include "rig/rig_binding.hpp"
#include "rig/transport_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

// Name, layout, number while driven, number with an open bridge, raw values that say that there is none.
using SignalArgument = std::tuple<std::string, SignalLayout, double, std::optional<double>, std::vector<std::uint64_t>>;
using MessageArgument = std::tuple<std::uint32_t, bool, int, std::optional<E2eSettings>, std::vector<SignalArgument>>;

template <class SignalOf>
MessageOf<SignalOf> message_of(const MessageArgument& given) {
  const auto& [id, extended, size, protection, signals] = given;
  MessageOf<SignalOf> message{.id = id, .extended = extended, .size = size, .protection = protection};
  for (const auto& [name, layout, fixed, at_rest, missing_raws] : signals) {
    if constexpr (std::is_same_v<SignalOf, CommandedSignal>) {
      message.signals.push_back({parse_name<Commanded>("signals", name), layout, fixed, at_rest});
    } else {
      message.signals.push_back({parse_name<Measured>("signals", name), layout, missing_raws});
    }
  }
  return message;
}

FrameCodec codec_of(const MessageArgument& command, const std::vector<MessageArgument>& received) {
  FrameCodecSettings s{.command = message_of<CommandedSignal>(command)};
  for (const MessageArgument& message : received)
    s.received.push_back(message_of<MeasuredSignal>(message));
  return FrameCodec(s);
}

py::dict to_dict(const LatencyHistogram& h) {
  const auto us = [](auto ns) { return static_cast<double>(ns) * 1e-3; };
  py::dict out;
  out["count"] = h.count();
  out["mean"] = us(h.mean_ns());
  out["p50"] = us(h.quantile_ns(0.5));
  out["p99"] = us(h.quantile_ns(0.99));
  out["p99_9"] = us(h.quantile_ns(0.999));
  out["max"] = us(h.max_ns());
  return out;
}

py::dict report(const RealtimeLoop& loop) {
  const TurnTiming& timing = loop.thread().timing();
  const ControlCycle& cycle = loop.cycle();
  py::dict out;
  out["running"] = loop.thread().running();
  out["cycles"] = timing.turns.get();
  out["missed"] = timing.missed.get();
  out["late"] = timing.late.get();
  out["longest_row"] = timing.longest_row.get();
  out["lateness_us"] = to_dict(timing.lateness);
  out["compute_us"] = to_dict(timing.compute);
  out["age_us"] = to_dict(cycle.age());
  out["send_us"] = to_dict(cycle.sending());
  py::dict frames;
  frames["good"] = cycle.counts().good_frames.get();
  frames["bad"] = cycle.counts().bad_frames.get();
  frames["foreign"] = cycle.counts().foreign_frames.get();
  frames["unencodable"] = cycle.counts().unencodable.get();
  out["frames"] = frames;
  out["fresh_cycles"] = cycle.counts().fresh.get();
  out["reference_timeouts"] = cycle.counts().reference_timeouts.get();
  out["dropped_samples"] = cycle.samples().dropped();
  out["dropped_events"] = cycle.events().dropped();
  out["bus"] = counts_of(cycle.transport_counts(), cycle.bus_monitor());
  const ScheduleGrant& grant = loop.thread().grant();
  py::dict schedule;
  schedule["realtime"] = grant.realtime;
  schedule["realtime_note"] = grant.realtime_note;
  schedule["memory_locked"] = grant.memory_locked;
  schedule["memory_note"] = grant.memory_note;
  out["schedule"] = schedule;
  return out;
}

template <class T, class Of>
py::array_t<T> column(const std::vector<LoopSample>& rows, Of of) {
  py::array_t<T> out(static_cast<py::ssize_t>(rows.size()));
  std::transform(rows.begin(), rows.end(), out.mutable_data(), of);
  return out;
}

py::dict samples(RealtimeLoop& loop) {
  std::vector<LoopSample> rows;
  LoopSample sample;
  for (std::size_t left = loop.cycle().samples().size(); left > 0 && loop.cycle().pop_sample(sample); --left)
    rows.push_back(sample);
  using S = LoopSample;
  const auto us = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-3; };
  py::dict out;
  out["cycle"] = column<std::int64_t>(rows, [](const S& s) { return s.cycle; });
  out["deadline_ns"] = column<std::int64_t>(rows, [](const S& s) { return s.deadline_ns; });
  out["lateness_us"] = column<double>(rows, [&](const S& s) { return us(s.lateness_ns); });
  out["compute_us"] = column<double>(rows, [&](const S& s) { return us(s.compute_ns); });
  out["age_us"] = column<double>(
      rows, [&](const S& s) { return s.age_ns < 0 ? std::numeric_limits<double>::quiet_NaN() : us(s.age_ns); });
  out["missed"] = column<std::int64_t>(rows, [](const S& s) { return s.missed; });
  out["reference_deg"] = column<double>(rows, [](const S& s) { return s.reference_deg; });
  for (const auto& [what, name] : names<Measured>()) {
    const auto at = static_cast<std::size_t>(what);
    out[as_str(name)] = column<double>(rows, [at](const S& s) { return s.measured[at]; });
  }
  out["asked_duty"] = column<double>(rows, [](const S& s) { return s.asked_duty; });
  out["duty"] = column<double>(rows, [](const S& s) { return s.drive.duty; });
  out["bridge_open"] = column<bool>(rows, [](const S& s) { return s.drive.bridge_open; });
  out["fresh"] = column<bool>(rows, [](const S& s) { return s.fresh; });
  out["good_frames"] = column<std::int64_t>(rows, [](const S& s) { return s.good_frames; });
  out["bad_frames"] = column<std::int64_t>(rows, [](const S& s) { return s.bad_frames; });
  out["bus_state"] = column<std::int8_t>(rows, [](const S& s) { return static_cast<std::int8_t>(s.bus); });
  out["request"] = column<std::int8_t>(rows, [](const S& s) { return static_cast<std::int8_t>(s.request); });
  out["state"] = column<std::int8_t>(rows, [](const S& s) { return static_cast<std::int8_t>(s.state); });
  out["cause"] = column<std::int8_t>(rows, [](const S& s) { return static_cast<std::int8_t>(s.cause); });
  out["send_result"] = column<std::int8_t>(rows, [](const S& s) { return static_cast<std::int8_t>(s.result); });
  return out;
}

py::list events(RealtimeLoop& loop) {
  py::list out;
  AuditEntry e;
  while (loop.cycle().pop_event(e)) {
    out.append(
        py::make_tuple(e.cycle, as_str(name_of(e.from)), as_str(name_of(e.to)), as_str(name_of(e.reason)), e.count));
  }
  return out;
}

template <class Enum>
py::tuple all_names(Names<Enum> names) {
  py::list out;
  for (const auto& [value, name] : names)
    out.append(as_str(name));
  return py::tuple(out);
}

bool wait(const RealtimeLoop& loop, std::optional<double> timeout_s) {
  if (timeout_s) require_within("timeout_s", *timeout_s, 0.0, 1e9, "s");
  const auto begin = std::chrono::steady_clock::now();
  const auto outcome = interruptible([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const double passed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      const double left_s = timeout_s ? *timeout_s - passed_s : 1.0;
      if (loop.wait(std::clamp(left_s, 0.0, 0.02))) return true;
      if (left_s <= 0.0) return false;
    }
    return false;
  });
  if (outcome.interrupted) raise_interrupted("interrupted: the loop goes on; stop() ends it", py::none());
  return *outcome.value;
}

}  // namespace

void bind_realtime_loop(py::module_& m) {
  m.attr("measured_names") = all_names(names<Measured>());
  m.attr("commanded_names") = all_names(names<Commanded>());
  m.attr("send_results") = all_names(names<SendResult>());
  const ScheduleSettings schedule;
  const CycleSettings settings;
  py::class_<RealtimeLoop>(m, "RealtimeLoop",
                           "A controller in a thread of its own; behind mgdd.rig.realtime.RealtimeLoop.")
      .def(py::init([](const py::object& controller, const AnyTransport& transport, const SafetyEnvelope& envelope,
                       const MessageArgument& command, const std::vector<MessageArgument>& received, double period_s,
                       double initial_reference_deg, std::optional<double> reference_timeout_s, bool transmit,
                       int stop_frames, bool realtime, int priority, bool lock_memory, std::size_t sample_capacity,
                       std::size_t queue_capacity) {
             return std::make_unique<RealtimeLoop>(
                 ScheduleSettings{
                     .period_s = period_s, .realtime = realtime, .priority = priority, .lock_memory = lock_memory},
                 CycleSettings{.initial_reference_deg = initial_reference_deg,
                               .transmit = transmit,
                               .stop_frames = stop_frames,
                               .reference_timeout_s = reference_timeout_s,
                               .sample_capacity = sample_capacity,
                               .queue_capacity = queue_capacity},
                 transport, controller_of(controller), codec_of(command, received), SafetyGate(envelope));
           }),
           py::kw_only(), py::arg("controller"), py::arg("transport"), py::arg("envelope"), py::arg("command"),
           py::arg("received"), py::arg("period_s") = schedule.period_s,
           py::arg("initial_reference_deg") = settings.initial_reference_deg,
           py::arg("reference_timeout_s") = settings.reference_timeout_s, py::arg("transmit") = settings.transmit,
           py::arg("stop_frames") = settings.stop_frames, py::arg("realtime") = schedule.realtime,
           py::arg("priority") = schedule.priority, py::arg("lock_memory") = schedule.lock_memory,
           py::arg("sample_capacity") = settings.sample_capacity, py::arg("queue_capacity") = settings.queue_capacity)
      .def(
          "start", [](RealtimeLoop& l) { without_gil([&] { return l.start(), 0; }); }, "Start; returns at once.")
      .def(
          "stop",
          [](RealtimeLoop& l, double timeout_s) {
            require_within("timeout_s", timeout_s, 0.0, 3600.0, "s");
            return without_gil([&] { return l.stop(timeout_s); });
          },
          py::arg("timeout_s"), "Ask for the end; whether it came in time.")
      .def("wait", &wait, py::arg("timeout_s"), "Wait for the end without the GIL; whether it came.")
      .def(
          "set_reference", [](RealtimeLoop& l, double deg) { l.cycle().set_reference(deg); }, py::arg("reference_deg"))
      .def(
          "queue_references",
          [](RealtimeLoop& l, const InputArray& deg) { l.cycle().queue_references(to_column(deg, "reference_deg")); },
          py::arg("reference_deg"))
      .def(
          "request",
          [](RealtimeLoop& l, const std::string& request) {
            return l.cycle().request(parse_name<SafetyRequest>("request", request));
          },
          py::arg("request"))
      .def("samples", &samples, "Samples since the last call, as a dict of columns.")
      .def("events", &events, "Changes of state since the last call: cycle, from, to, reason, count.")
      .def("report", &report, "Account of the loop so far.")
      .def(
          "give_back",
          [](const RealtimeLoop& l, const py::object& controller) {
            if (l.thread().running()) throw RigError("the loop runs: stop it first");
            give_back(controller, l.cycle().controller());
          },
          py::arg("controller"))
      .def_property_readonly("patience_s", &RealtimeLoop::patience_s)
      .def_property_readonly("running", [](const RealtimeLoop& l) { return l.thread().running(); })
      .def_property_readonly("queued_references", [](const RealtimeLoop& l) { return l.cycle().queued_references(); })
      .def_property_readonly("state", [](const RealtimeLoop& l) { return as_str(name_of(l.cycle().state())); })
      .def_property_readonly("reason", [](const RealtimeLoop& l) { return as_str(name_of(l.cycle().reason())); })
      .def_property_readonly("cause", [](const RealtimeLoop& l) { return as_str(name_of(l.cycle().cause())); })
      .def_property_readonly("bus_state", [](const RealtimeLoop& l) { return as_str(name_of(l.cycle().bus_state())); });
}

}  // namespace mgdd::bindings
