#include "mgdd/rig/record_reader.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <system_error>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/record_writer.hpp"

namespace mgdd::rig {
namespace {

// A header with the longest JSON is a little longer than the longest record.
constexpr std::size_t longest_record = header_head + largest_body + 4, first_room = 1u << 12u,
                      room_size = 4 * longest_record;

[[noreturn]] void refuse_header(HeaderFault fault, const std::string& name) {
  const char* why = fault == HeaderFault::not_a_record ? "not a record of mgdd"
                    : fault == HeaderFault::other_version
                        ? "a record of another version: read it with a newer mgdd"
                        : "the header is damaged: mgdd.rig.repair_record keeps the rest";
  throw about("path", DataError(name + ": " + why));
}

}  // namespace

ByteSource file_source(const std::string& path) {
  const auto file = std::make_shared<std::ifstream>(path, std::ios::binary);
  std::error_code ignored;
  if (!*file || std::filesystem::is_directory(path, ignored)) {
    throw about("path", DataError(path + ": cannot be opened: name an existing record"));
  }
  return [file, path](std::span<std::uint8_t> room) {
    file->read(reinterpret_cast<char*>(room.data()), static_cast<std::streamsize>(room.size()));
    if (file->bad()) throw about("path", DataError(path + ": cannot be read: the disk reports an error"));
    return static_cast<std::size_t>(file->gcount());
  };
}

ByteSpan ByteWindow::view() {
  while (!ended_ && to_ - from_ < longest_record) {
    if (from_ > 0) std::memmove(room_.data(), room_.data() + from_, to_ - from_);
    to_ -= from_;
    from_ = 0;
    if (to_ == room_.size()) room_.resize(std::min(room_size, std::max(first_room, 2 * room_.size())));
    const std::size_t n = source_(std::span(room_).subspan(to_));
    to_ += n;
    ended_ = n == 0;
  }
  return ByteSpan(room_).subspan(from_, to_ - from_);
}

void ByteWindow::skip(std::size_t n) noexcept {
  from_ += n;
  position_ += n;
}

RecordReader::RecordReader(ByteSource source, const std::string& name) : window_(std::move(source)) {
  const HeaderFault fault = read_header(window_.view(), header_);
  if (fault != HeaderFault::none) refuse_header(fault, name);
  window_.skip(header_.size);
  position_ = header_.size;
}

std::optional<ByteSpan> RecordReader::next() {
  if (ended_) return std::nullopt;
  window_.skip(pending_);
  position_ += pending_;
  pending_ = 0;
  const FoundRecord found = first_record(window_.view());
  if (found.found == Found::record) {
    pending_ = found.size;
    return found.body;
  }
  ended_ = true;
  incomplete_ = found.found == Found::incomplete;
  for (std::size_t n = window_.view().size(); n > 0; n = window_.view().size()) {
    ignored_ += n;
    window_.skip(n);
  }
  return std::nullopt;
}

void TableIndex::define(const ColumnsBody& body, std::vector<RecordTable>& tables) {
  places_[{body.table, body.columns.size()}] = tables.size();
  tables.push_back({.name = std::string(body.name), .columns = {body.columns.begin(), body.columns.end()}});
}

std::size_t TableIndex::of(const SampleBody& body, std::vector<RecordTable>& tables) {
  const auto [place, added] = places_.try_emplace({body.table, body.size()}, tables.size());
  if (added) {
    RecordTable unnamed{.name = "table_" + std::to_string(body.table)};
    for (std::size_t i = 0; i < body.size(); ++i)
      unnamed.columns.push_back("value_" + std::to_string(i));
    tables.push_back(std::move(unnamed));
  }
  return place->second;
}

RecordColumns read_columns(RecordReader& reader) {
  RecordColumns out{.header = reader.header()};
  TableIndex index;
  while (const std::optional<ByteSpan> body = reader.next()) {
    ++out.records;
    switch (kind_of(*body)) {
      case BodyKind::frame:
        out.frames.push_back(frame_in(*body));
        break;
      case BodyKind::columns:
        index.define(columns_in(*body), out.tables);
        break;
      case BodyKind::sample: {
        const SampleBody sample = sample_in(*body);
        RecordTable& table = out.tables[index.of(sample, out.tables)];
        table.monotonic_ns.push_back(sample.monotonic_ns);
        for (std::size_t i = 0; i < sample.size(); ++i)
          table.values.push_back(sample[i]);
        break;
      }
      case BodyKind::event: {
        const EventBody event = event_in(*body);
        out.events.push_back({event.monotonic_ns, std::string(event.category), std::string(event.text)});
        break;
      }
      case BodyKind::damage:
        out.damaged_bytes += damage_in(*body).size();
        break;
      default:
        ++out.unknown;
    }
  }
  out.ignored_bytes = reader.ignored_bytes();
  return out;
}

RepairReport repair_record(ByteSource source, const std::string& name, const std::function<void(ByteSpan)>& emit) {
  ByteWindow window(std::move(source));
  FoundHeader header;
  RepairReport report;
  const HeaderFault fault = read_header(window.view(), header);
  if (fault == HeaderFault::other_version) refuse_header(fault, name);
  report.header_lost = fault != HeaderFault::none;
  if (report.header_lost) {
    emit(encoded({.json = R"({"repaired": "the header was damaged"})"}));
  } else {
    emit(window.view().first(header.size));
    window.skip(header.size);
  }
  std::vector<std::uint8_t> damage;
  const auto give_damage = [&] {
    if (!damage.empty()) emit(encoded_damage(damage));
    report.damaged_bytes += damage.size();
    damage.clear();
  };
  bool in_damage = false;
  for (ByteSpan view = window.view(); !view.empty(); view = window.view()) {
    // In a damaged place an unknown kind may be chance: its bytes are kept, as damage.
    const FoundRecord found = first_record(view, in_damage || (report.header_lost && report.records == 0));
    if (found.found == Found::record) {
      give_damage();
      in_damage = false;
      emit(view.first(found.size));
      window.skip(found.size);
      ++report.records;
      continue;
    }
    if (!in_damage) ++report.places;
    in_damage = true;
    damage.push_back(view[0]);
    window.skip(1);
    if (damage.size() == largest_body - body_head) give_damage();
  }
  if (report.header_lost && report.records == 0) refuse_header(HeaderFault::not_a_record, name);
  give_damage();
  return report;
}

RepairReport repair_record(const std::string& path, const std::string& target) {
  std::error_code error;
  const bool in_place = std::filesystem::equivalent(path, target, error) && !error;
  if (in_place) {
    const RepairReport dry = repair_record(file_source(path), path, [](ByteSpan) {});
    if (dry.damaged_bytes == 0 && !dry.header_lost) return dry;
  }
  const std::string beside = target + ".repairing";
  std::filesystem::remove(beside, error);
  RepairReport report;
  try {
    AppendFile file(beside);
    report = repair_record(file_source(path), path, [&file](ByteSpan piece) {
      if (!file.append(piece)) throw file.failure();
    });
    if (!file.sync() || !file.close()) throw file.failure();
    std::filesystem::rename(beside, target);
  } catch (const std::filesystem::filesystem_error& refused) {
    std::filesystem::remove(beside, error);
    throw about("path", RigError(target + ": cannot be replaced: " + refused.code().message()));
  } catch (...) {
    std::filesystem::remove(beside, error);
    throw;
  }
  return report;
}

}  // namespace mgdd::rig
