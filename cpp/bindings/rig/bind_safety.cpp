// Binds rig/safety_*.hpp: the envelope as a record, the gate cycle by cycle.
#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "binding.hpp"
#include "mgdd/rig/safety_gate.hpp"
#include "record_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

template <class Enum>
py::tuple names_of(Names<Enum> names) {
  py::list out;
  for (const auto& [value, name] : names)
    out.append(as_str(name));
  return {out};
}

using Entry = std::tuple<std::int64_t, py::str, py::str, py::str, std::int64_t>;

std::vector<Entry> drained(SafetyGate& gate) {
  std::vector<Entry> out;
  while (const auto entry = gate.audit().pop()) {
    out.emplace_back(entry->cycle, as_str(name_of(entry->from)), as_str(name_of(entry->to)),
                     as_str(name_of(entry->reason)), entry->count);
  }
  return out;
}

std::int64_t counted(const char* name, std::int64_t number) {
  require_within(name, static_cast<double>(number), 0.0, 1e9);
  return number;
}

void observe(SafetyGate& gate, std::int64_t good_frames, std::int64_t bad_frames, std::optional<double> age_s,
             std::optional<std::array<double, 2>> sensor_v, std::optional<double> angle_deg, const std::string& bus,
             bool sent, std::int64_t missed_deadlines, const std::string& request) {
  gate.observe({.good_frames = counted("good_frames", good_frames),
                .bad_frames = counted("bad_frames", bad_frames),
                .age_s = age_s.value_or(unknown),
                .sensor_v = sensor_v.value_or(std::array{unknown, unknown}),
                .angle_deg = angle_deg.value_or(unknown),
                .bus = parse_name<BusState>("bus", bus),
                .sent = sent,
                .missed_deadlines = counted("missed_deadlines", missed_deadlines),
                .request = parse_name<SafetyRequest>("request", request)});
}

void bind_envelope(py::module_& m) {
  py::class_<SafetyEnvelope> cls(m, "SafetyEnvelope",
                                 R"(What a safety gate lets pass, and what must be true of the measurements meanwhile.

Keyword-only and immutable; the defaults are the shipped envelope ``etb``. ``SafetyEnvelope.fields()`` lists bounds, units
and defaults.

Parameters
----------
cycle_s : float
    Time between two cycles of the gate [s].
duty_limit, slew_per_s, ramp_s : float
    Largest duty [-], its largest change [1/s], and the time in which it grows in after the start [s].
invalid_duties : float
    Duties in a row that are not finite and lead to ``fault`` [cycles]; the last good one is held before.
rms_duty_limit, rms_duty_to_arm, heat_time_constant_s : float
    Largest RMS duty of the heat model [-], what it must cool to before the next start [-], and its time constant [s].
stall_duty, stall_move_deg, stall_s : float
    Duty that must move the plate [-], by how much [deg], and within which time [s].
largest_age_cycles, held_cycles : float
    Age beyond which a measurement is not used, and for how long the last duty bridges it [cycles].
bad_frames, good_frames : float
    Bad frames in a row that lead to ``limp``; good ones, with nothing wrong meanwhile, before arming and a reset [-].
missed_deadlines, unsent_cycles : float
    Deadlines missed in a row [-], and commands in a row that did not leave [cycles], that lead to ``limp``.
sensor_sum_v, sensor_sum_tolerance_v, sensor_low_v, sensor_high_v : float
    Sum of both sensors, by which it may be off, and the range of each [V].
sensor_slope_v_per_s : float
    Fastest change of a healthy sensor [V/s].
sensor_cycles : float
    Measurements in a row that fail a check of the sensors or of the travel and lead to ``fault`` [cycles].
closed_deg, open_deg, travel_margin_deg : float
    Travel, and by which an angle may leave it [deg].
bus_fault_from : {"warning", "passive", "off"}
    State of the CAN controller from which on it is ``limp``.

Raises
------
mgdd.errors.ParameterError
    A value outside its domain, naming field, value and bound.

See Also
--------
SafetyGate : what keeps it.

References
----------
Bosch Motorsport, manual of the MS 6 engine control (sum and range of the sensors).

Examples
--------
>>> from mgdd.rig import SafetyEnvelope
>>> SafetyEnvelope(duty_limit=0.5).slew_per_s
200.0
>>> SafetyEnvelope.from_toml(SafetyEnvelope(duty_limit=0.5).to_toml()) == SafetyEnvelope(duty_limit=0.5)
True
)");
  bind_record(cls, "SafetyEnvelope");
}

void bind_drive(py::module_& m) {
  py::class_<Drive> cls(m, "Drive", R"(What may leave the machine in this cycle.

A gate gives it; ``duty, bridge_open, send`` unpacks it.

Examples
--------
>>> from mgdd.rig import SafetyGate
>>> gate = SafetyGate()
>>> gate.observe()
>>> gate.command(0.3)
Drive(duty=0.0, bridge_open=True, send=True)
)");
  cls.def_property_readonly("duty", [](const Drive& d) { return d.duty; }, "Duty of the bridge [-].");
  cls.def_property_readonly(
      "bridge_open", [](const Drive& d) { return d.bridge_open; },
      "Whether the bridge is open, so that the springs bring the plate to limp-home.");
  cls.def_property_readonly(
      "send", [](const Drive& d) { return d.send; }, "Whether to send anything; not while the bus is off.");
  cls.def("__eq__", [](const Drive& self, const py::object& other) {
    return py::isinstance<Drive>(other) && self == other.cast<const Drive&>();
  });
  cls.def("__hash__", [](const Drive& d) { return py::hash(py::make_tuple(d.duty, d.bridge_open, d.send)); });
  cls.def("__iter__", [](const Drive& d) { return py::iter(py::make_tuple(d.duty, d.bridge_open, d.send)); });
  cls.def("__repr__", [](const Drive& d) {
    py::dict shown;
    shown["duty"] = d.duty;
    shown["bridge_open"] = d.bridge_open;
    shown["send"] = d.send;
    return representation("Drive", shown);
  });
  cls.def(py::pickle([](const Drive& d) { return py::make_tuple(1, d.duty, d.bridge_open, d.send); },
                     [](const py::tuple& state) {
                       require_pickle_version(state);
                       return Drive{state[1].cast<double>(), state[2].cast<bool>(), state[3].cast<bool>()};
                     }));
}

}  // namespace

void bind_safety(py::module_& m) {
  m.attr("safety_states") = names_of(names<SafetyState>());
  m.attr("safety_reasons") = names_of(names<SafetyReason>());
  m.attr("safety_requests") = names_of(names<SafetyRequest>());
  m.attr("bus_states") = names_of(names<BusState>());
  bind_envelope(m);
  bind_drive(m);
  py::class_<SafetyGate> cls(m, "SafetyGate", "The gate of the core; behind mgdd.rig.SafetyGate.");
  cls.def(py::init<const SafetyEnvelope&>(), py::arg("envelope"));
  cls.def("observe", &observe, py::kw_only(), py::arg("good_frames") = 0, py::arg("bad_frames") = 0,
          py::arg("age_s") = py::none(), py::arg("sensor_v") = py::none(), py::arg("angle_deg") = py::none(),
          py::arg("bus") = "active", py::arg("sent") = true, py::arg("missed_deadlines") = 0,
          py::arg("request") = "none",
          R"(First half of a cycle, before the controller: what is known of it.

Parameters
----------
good_frames, bad_frames : int
    Frames that arrived since the last cycle and passed or failed their checks, >= 0.
age_s : float, optional
    Age of the last good one [s]; it grows by a cycle if left out.
sensor_v : pair of float, optional
    Both position sensors [V]; looked at where a good frame arrived.
angle_deg : float, optional
    Angle of the plate [deg]; the same.
bus : {"active", "warning", "passive", "off"}
    Error state of the CAN controller.
sent : bool
    Whether the last command left.
missed_deadlines : int
    Since the last cycle, >= 0.
request : {"none", "arm", "run", "stop", "disarm", "reset", "abort"}
    What the operator asks for, after all checks of the cycle.

Raises
------
mgdd.errors.ParameterError
    A negative count, an unknown name.)");
  cls.def(
      "command", &SafetyGate::command, py::arg("duty"),
      "Second half of a cycle: the drive that may leave, for the duty [-] that the controller asks for.\n\nNaN is a "
      "fault of the controller.");
  cls.def(
      "request",
      [](SafetyGate& gate, const std::string& name) {
        return as_str(name_of(gate.request(parse_name<SafetyRequest>("request", name))));
      },
      py::arg("request"),
      "Ask for another state between two cycles.\n\nReturns what stands against it, ``'none'`` where it was accepted.");
  cls.def("drain", &drained,
          "Take the waiting changes of state out of the audit list, oldest first: cycle, from, to, reason, count.");
  cls.def(
      "count",
      [](const SafetyGate& gate, const std::string& reason) {
        return gate.count(parse_name<SafetyReason>("reason", reason));
      },
      py::arg("reason"), "Changes of state for a reason so far.");
  cls.def_property_readonly("envelope", &SafetyGate::envelope, py::return_value_policy::copy, "The envelope.");
  cls.def_property_readonly(
      "mode", [](const SafetyGate& gate) { return as_str(name_of(gate.state())); },
      "``init``, ``armed``, ``run``, ``limp`` or ``fault``.");
  cls.def_property_readonly(
      "reason", [](const SafetyGate& gate) { return as_str(name_of(gate.reason())); }, "Why that state was entered.");
  cls.def_property_readonly(
      "cause", [](const SafetyGate& gate) { return as_str(name_of(gate.cause())); },
      "What is wrong now; arming, starting and a reset wait for its end.");
  cls.def_property_readonly("drive", &SafetyGate::drive, "The drive of the last cycle.");
  cls.def_property_readonly("rms_duty", &SafetyGate::rms_duty, "RMS duty of the heat model [-].");
  cls.def_property_readonly("cycle", &SafetyGate::cycle, "Cycles so far, missed ones included.");
  cls.def_property_readonly("clamped", &SafetyGate::clamped, "Duties so far that were beyond the limit.");
  cls.def_property_readonly("slewed", &SafetyGate::slewed, "Duties so far that changed too fast.");
  cls.def_property_readonly(
      "dropped", [](SafetyGate& gate) { return gate.audit().dropped(); },
      "Changes of state that found no room in the audit list.");
  cls.def_property(
      "state", [](const SafetyGate& gate) { return save_state(gate); },
      [](SafetyGate& gate, const StateColumns& columns) { restore_state(gate, columns); },
      "What a run needs to go on bit for bit; a state that the envelope does not allow is refused and changes "
      "nothing.");
}

}  // namespace mgdd::bindings
