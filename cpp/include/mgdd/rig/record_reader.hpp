// Reads a record file as a stream, in the memory of a few MiB, up to its first damaged record; repairs one; and gives
// all of it as columns. Not real-time safe. A record that another process is still writing can be read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "mgdd/rig/frame.hpp"
#include "mgdd/rig/record_format.hpp"

namespace mgdd::rig {

/// Fills a part of the room it is given; 0 at the end.
using ByteSource = std::function<std::size_t(std::span<std::uint8_t>)>;

/// The bytes of a file; DataError where it cannot be opened or read.
ByteSource file_source(const std::string& path);

/// A window on a stream of bytes, always wide enough for the longest record.
class ByteWindow {
 public:
  explicit ByteWindow(ByteSource source) : source_(std::move(source)) {}

  /// What follows: at least a whole record of the largest size, or all that is left.
  ByteSpan view();
  void skip(std::size_t n) noexcept;
  [[nodiscard]] std::uint64_t position() const noexcept { return position_; }

 private:
  ByteSource source_;
  std::vector<std::uint8_t> room_;
  std::size_t from_ = 0, to_ = 0;
  std::uint64_t position_ = 0;
  bool ended_ = false;
};

class RecordReader {
 public:
  /// DataError: not a record, another version, or a damaged header, which `repair_record` mends.
  RecordReader(ByteSource source, const std::string& name);
  explicit RecordReader(const std::string& path) : RecordReader(file_source(path), path) {}

  [[nodiscard]] const RecordHeader& header() const noexcept { return header_.header; }

  /// The next body, until the next call; none at the end and from the first damaged record on.
  std::optional<ByteSpan> next();

  /// Bytes behind the last readable record, known when `next` gave none; 0 for a whole file.
  [[nodiscard]] std::uint64_t ignored_bytes() const noexcept { return ignored_; }
  /// Place in the file behind the record given last.
  [[nodiscard]] std::uint64_t position() const noexcept { return position_ + pending_; }
  /// Whether the ignored bytes may be the start of a record that is still being written.
  [[nodiscard]] bool incomplete() const noexcept { return incomplete_; }

 private:
  ByteWindow window_;
  FoundHeader header_;
  std::size_t pending_ = 0;  ///< bytes of the record given last
  std::uint64_t position_ = 0, ignored_ = 0;
  bool ended_ = false, incomplete_ = false;
};

/// Samples of one table.
struct RecordTable {
  std::string name;
  std::vector<std::string> columns{};
  std::vector<std::int64_t> monotonic_ns{};
  std::vector<double> values{};  ///< row by row
};

struct RecordEvent {
  std::int64_t monotonic_ns = 0;
  std::string category, text;
};

/// Everything in a record.
struct RecordColumns {
  RecordHeader header;
  std::vector<Frame> frames{};
  std::vector<RecordTable> tables{};  ///< in the order in which they were defined
  std::vector<RecordEvent> events{};
  std::uint64_t records = 0;
  std::uint64_t unknown = 0;        ///< records of a kind that this version does not know
  std::uint64_t damaged_bytes = 0;  ///< in places that a repair could not read
  std::uint64_t ignored_bytes = 0;  ///< behind the last readable record
};

/// Which table a sample belongs to. A sample whose names are lost gets a table `table_7` of `value_0` and so on.
class TableIndex {
 public:
  void define(const ColumnsBody& body, std::vector<RecordTable>& tables);
  std::size_t of(const SampleBody& body, std::vector<RecordTable>& tables);

 private:
  std::map<std::pair<std::uint16_t, std::size_t>, std::size_t> places_;
};

RecordColumns read_columns(RecordReader& reader);

struct RepairReport {
  std::uint64_t records = 0;        ///< kept
  std::uint64_t damaged_bytes = 0;  ///< kept as bytes
  std::uint64_t places = 0;         ///< damaged stretches
  bool header_lost = false;         ///< replaced by an empty one
};

/// Every readable record of a file and, in place of the others, their bytes as records of damage: nothing is lost, and
/// the result is readable to its end. `emit` gets the new file piece by piece. DataError where nothing is a record.
RepairReport repair_record(ByteSource source, const std::string& name, const std::function<void(ByteSpan)>& emit);

/// The same for files; `target` may be the file itself. Written beside the target and renamed when complete. A whole
/// file that is its own target is left alone. DataError or RigError, and then nothing has changed.
RepairReport repair_record(const std::string& path, const std::string& target);

}  // namespace mgdd::rig
