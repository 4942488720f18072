// Binds rig/record_writer.hpp and rig/record_reader.hpp: writing without the GIL, a record as columns, repair.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "guarded.hpp"
#include "mgdd/common/bounds.hpp"
#include "mgdd/rig/record_reader.hpp"
#include "mgdd/rig/record_writer.hpp"
#include "rig/payload.hpp"
#include "rig/rig_binding.hpp"

namespace mgdd::bindings {
namespace {

using namespace rig;

using Writer = Guarded<RecordWriter>;

RecordHeader header_from(const py::bytes& run_id, std::int64_t wall_ns, std::int64_t monotonic_ns,
                         const std::string& json) {
  RecordHeader header{.wall_ns = wall_ns, .monotonic_ns = monotonic_ns, .json = json};
  const auto id = static_cast<std::string_view>(run_id);
  if (id.size() != header.run_id.size()) {
    throw ShapeError("run_id has " + std::to_string(id.size()) + " bytes: must be 16");
  }
  std::copy(id.begin(), id.end(), header.run_id.begin());
  return header;
}

py::dict to_dict(const RecordHeader& header) {
  py::dict out;
  out["run_id"] = as_bytes(header.run_id);
  out["wall_ns"] = header.wall_ns;
  out["monotonic_ns"] = header.monotonic_ns;
  out["json"] = py::bytes(header.json);
  return out;
}

/// Runs one write without the GIL; RigError where it fails.
template <class Write>
void write(Writer& writer, Write one) {
  const auto use = writer.use();
  if (!without_gil([&] { return one(*use); })) throw use->failure();
}

void write_sample(Writer& writer, std::uint16_t table, std::int64_t monotonic_ns, const InputArray& values) {
  const std::vector<double> row = to_column(values, "values");
  const auto use = writer.use();
  require_within("table", table, 0, static_cast<double>(use->tables().size()) - 1.0);
  if (row.size() != use->tables()[table]) {
    throw about("values", ShapeError("values has " + std::to_string(row.size()) + " numbers, the table " +
                                     std::to_string(use->tables()[table]) + " columns"));
  }
  if (!without_gil([&] { return use->write_sample(table, monotonic_ns, row); })) throw use->failure();
}

/// A column of one member of every frame.
template <class T, class Of>
py::array_t<T> frame_column(const std::vector<Frame>& frames, Of of) {
  py::array_t<T> out(static_cast<py::ssize_t>(frames.size()));
  T* to = out.mutable_data();
  for (const Frame& frame : frames)
    *to++ = static_cast<T>(of(frame));
  return out;
}

py::dict frame_columns(const std::vector<Frame>& frames) {
  std::size_t width = 8;
  for (const Frame& frame : frames)
    width = std::max(width, frame.payload().size());
  py::array_t<std::uint8_t> data({static_cast<py::ssize_t>(frames.size()), static_cast<py::ssize_t>(width)});
  std::uint8_t* to = data.mutable_data();
  for (const Frame& frame : frames) {
    std::memcpy(to, frame.data.data(), width);
    to += width;
  }
  py::dict out;
  out["monotonic_ns"] = frame_column<std::int64_t>(frames, [](const Frame& f) { return f.monotonic_ns; });
  out["bus_ns"] = frame_column<std::int64_t>(frames, [](const Frame& f) { return f.bus_ns; });
  out["id"] = frame_column<std::uint32_t>(frames, [](const Frame& f) { return f.id; });
  out["size"] = frame_column<std::uint8_t>(frames, [](const Frame& f) { return f.size; });
  out["channel"] = frame_column<std::uint8_t>(frames, [](const Frame& f) { return f.channel; });
  out["extended"] = frame_column<bool>(frames, [](const Frame& f) { return f.extended; });
  out["error"] = frame_column<bool>(frames, [](const Frame& f) { return f.error; });
  out["received"] = frame_column<bool>(frames, [](const Frame& f) { return f.received; });
  out["fd"] = frame_column<bool>(frames, [](const Frame& f) { return f.fd; });
  out["bit_rate_switch"] = frame_column<bool>(frames, [](const Frame& f) { return f.bit_rate_switch; });
  out["remote"] = frame_column<bool>(frames, [](const Frame& f) { return f.remote; });
  out["data"] = data;
  return out;
}

/// Text of another program may be no UTF-8: then its bytes show as escapes.
py::str readable(std::string_view text) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), "backslashreplace"));
}

py::dict to_dict(const RecordTable& table) {
  py::list names;
  for (const std::string& name : table.columns)
    names.append(readable(name));
  const auto rows = static_cast<py::ssize_t>(table.monotonic_ns.size()),
             columns = static_cast<py::ssize_t>(table.columns.size());
  py::array_t<double> values({rows, columns});
  std::copy(table.values.begin(), table.values.end(), values.mutable_data());
  py::dict out;
  out["name"] = readable(table.name);
  out["columns"] = py::tuple(names);
  out["monotonic_ns"] = py::array_t<std::int64_t>(rows, table.monotonic_ns.data());
  out["values"] = values;
  return out;
}

py::dict read(const std::string& path) {
  const RecordColumns all = without_gil([&] {
    RecordReader reader(path);
    return read_columns(reader);
  });
  py::list tables, events;
  for (const RecordTable& table : all.tables)
    tables.append(to_dict(table));
  for (const RecordEvent& event : all.events)
    events.append(py::make_tuple(event.monotonic_ns, readable(event.category), readable(event.text)));
  py::dict out;
  out["header"] = to_dict(all.header);
  out["frames"] = frame_columns(all.frames);
  out["tables"] = tables;
  out["events"] = events;
  out["records"] = all.records;
  out["unknown"] = all.unknown;
  out["damaged_bytes"] = all.damaged_bytes;
  out["ignored_bytes"] = all.ignored_bytes;
  return out;
}

/// A reader with the names of the tables met so far.
struct Iteration {
  explicit Iteration(const std::string& path) : reader(path) {}

  py::object next() {
    while (const std::optional<ByteSpan> body = reader.next()) {
      switch (kind_of(*body)) {
        case BodyKind::frame:
          return py::cast(frame_in(*body));
        case BodyKind::columns:
          index.define(columns_in(*body), tables);
          break;
        case BodyKind::sample:
          return sample(sample_in(*body));
        case BodyKind::event: {
          const EventBody event = event_in(*body);
          return py::make_tuple("event", event.monotonic_ns, readable(event.category), readable(event.text));
        }
        case BodyKind::damage:
          return py::make_tuple("damage", as_bytes(damage_in(*body)));
        default:
          break;  // of a later version
      }
    }
    throw py::stop_iteration();
  }

  py::object sample(const SampleBody& row) {
    const RecordTable& table = tables[index.of(row, tables)];
    py::dict values;
    for (std::size_t i = 0; i < row.size(); ++i)
      values[readable(table.columns[i])] = row[i];
    return py::make_tuple("sample", row.monotonic_ns, readable(table.name), values);
  }

  RecordReader reader;
  std::vector<RecordTable> tables;
  TableIndex index;
};

py::dict repair(const std::string& path, const std::string& target) {
  const RepairReport report = without_gil([&] { return repair_record(path, target); });
  py::dict out;
  out["records"] = report.records;
  out["damaged_bytes"] = report.damaged_bytes;
  out["places"] = report.places;
  out["header_lost"] = report.header_lost;
  return out;
}

}  // namespace

void bind_record(py::module_& m) {
  py::class_<Writer>(m, "RecordWriter", "Appends to a record file; behind mgdd.rig.Recorder.")
      .def(py::init([](const std::string& path, const py::bytes& run_id, std::int64_t wall_ns,
                       std::int64_t monotonic_ns, const std::string& json) {
             return std::make_unique<Writer>("RecordWriter",
                                             RecordWriter(path, header_from(run_id, wall_ns, monotonic_ns, json)));
           }),
           py::arg("path"), py::kw_only(), py::arg("run_id"), py::arg("wall_ns"), py::arg("monotonic_ns"),
           py::arg("json"))
      .def(
          "add_table",
          [](Writer& self, const std::string& name, const std::vector<std::string>& columns,
             std::int64_t monotonic_ns) { return self.use()->add_table(name, columns, monotonic_ns); },
          py::arg("name"), py::arg("columns"), py::arg("monotonic_ns"), "Number of a new table of samples.")
      .def(
          "write", [](Writer& self, const Frame& frame) { write(self, [&](auto& w) { return w.write(frame); }); },
          py::arg("frame"), "Append a frame.")
      .def("write_sample", &write_sample, py::arg("table"), py::arg("monotonic_ns"), py::arg("values"),
           "Append a number per column of a table.")
      .def(
          "write_event",
          [](Writer& self, std::int64_t monotonic_ns, const std::string& category, const std::string& text) {
            write(self, [&](auto& w) { return w.write_event(monotonic_ns, category, text); });
          },
          py::arg("monotonic_ns"), py::arg("category"), py::arg("text"), "Append an event.")
      .def(
          "sync", [](Writer& self) { write(self, [](auto& w) { return w.sync(); }); },
          "Wait until the disk has everything.")
      .def(
          "close", [](Writer& self) { write(self, [](auto& w) { return w.close(); }); },
          "Close the file; what is written later is a RigError.")
      .def_property_readonly(
          "written", [](const Writer& self) { return self.use()->written(); }, "Records.")
      .def_property_readonly(
          "refused", [](const Writer& self) { return self.use()->refused(); }, "Records that could not be written.")
      .def_property_readonly(
          "size", [](const Writer& self) { return self.use()->size(); }, "Bytes.")
      .def_property_readonly("path", [](const Writer& self) { return self.use()->path(); }, "As given.");

  py::class_<Iteration>(m, "RecordReader",
                        "Iterates over a record: frames, and tuples ('sample', ns, table, values), ('event', ns, "
                        "category, text) and ('damage', bytes).")
      .def(py::init<const std::string&>(), py::arg("path"))
      .def(
          "__iter__", [](Iteration& self) -> Iteration& { return self; }, py::return_value_policy::reference_internal)
      .def("__next__", &Iteration::next)
      .def_property_readonly(
          "header", [](const Iteration& self) { return to_dict(self.reader.header()); }, "As written.")
      .def_property_readonly(
          "ignored_bytes", [](const Iteration& self) { return self.reader.ignored_bytes(); },
          "Bytes behind the last readable record; known at the end.")
      .def_property_readonly(
          "incomplete", [](const Iteration& self) { return self.reader.incomplete(); },
          "Whether they may be the start of a record that is still being written.");

  m.def("read_record", &read, py::arg("path"), "All of a record as columns; behind mgdd.rig.read_record.");
  m.def("repair_record", &repair, py::arg("path"), py::arg("target"), "Behind mgdd.rig.repair_record.");
}

}  // namespace mgdd::bindings
