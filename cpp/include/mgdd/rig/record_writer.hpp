// Writes a record file: one unbuffered write per record, so that a killed process loses at most the record it was
// writing; `sync` once a second limits what a power failure takes. One thread at a time. Frames and samples are written
// noexcept and without allocation, but the operating system may wait for the disk: not for the thread of a loop.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mgdd/common/error.hpp"
#include "mgdd/rig/frame.hpp"
#include "mgdd/rig/record_format.hpp"

namespace mgdd::rig {

/// A file to which whole pieces are appended: what cannot be written whole is taken back.
class AppendFile {
 public:
  /// RigError where the file exists already or cannot be made.
  explicit AppendFile(std::string path);
  AppendFile(AppendFile&& other) noexcept;
  AppendFile& operator=(AppendFile&&) = delete;
  AppendFile(const AppendFile&) = delete;
  AppendFile& operator=(const AppendFile&) = delete;
  ~AppendFile();

  /// False where it failed: the file then ends as before the call.
  [[nodiscard]] bool append(ByteSpan bytes) noexcept;
  /// Until the disk has it.
  [[nodiscard]] bool sync() noexcept;
  /// False where the system reports a late error of writing.
  bool close() noexcept;

  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  [[nodiscard]] bool is_open() const noexcept { return file_ >= 0; }
  /// What went wrong last, with a remedy.
  [[nodiscard]] RigError failure() const;

 private:
  std::string path_;
  int file_ = -1;
  std::uint64_t size_ = 0;
  int errno_ = 0;
  bool torn_ = false;  ///< a piece could not be taken back: nothing may follow it
};

class RecordWriter {
 public:
  /// RigError where the file exists already, cannot be made, or has no room for the header.
  RecordWriter(const std::string& path, const RecordHeader& header);

  /// Number of a new table of samples; ParameterError for bad names, RigError where the write fails.
  std::uint16_t add_table(std::string_view name, std::span<const std::string> columns, std::int64_t monotonic_ns);

  /// Each false where the write fails; `failure` says why. The file stays readable.
  [[nodiscard]] bool write(const Frame& frame) noexcept;
  /// `values` has a number per column of the table.
  [[nodiscard]] bool write_sample(std::uint16_t table, std::int64_t monotonic_ns,
                                  std::span<const double> values) noexcept;
  /// Of up to 65535 and about a million bytes of UTF-8; ParameterError beyond.
  [[nodiscard]] bool write_event(std::int64_t monotonic_ns, std::string_view category, std::string_view text);

  [[nodiscard]] bool sync() noexcept { return file_.sync(); }
  bool close() noexcept { return file_.close(); }
  [[nodiscard]] RigError failure() const;

  [[nodiscard]] bool is_open() const noexcept { return file_.is_open(); }
  [[nodiscard]] const std::string& path() const noexcept { return file_.path(); }
  [[nodiscard]] std::uint64_t size() const noexcept { return file_.size(); }  ///< bytes
  [[nodiscard]] std::uint64_t written() const noexcept { return written_; }   ///< records
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }   ///< records that could not be written
  [[nodiscard]] std::span<const std::size_t> tables() const noexcept { return tables_; }  ///< columns of each

 private:
  bool put(ByteSpan record) noexcept;

  AppendFile file_;
  std::vector<std::size_t> tables_;
  std::vector<std::uint8_t> room_;  ///< for the longest sample
  std::uint64_t written_ = 0, refused_ = 0;
  bool misfit_ = false;  ///< the last sample fitted no table
};

}  // namespace mgdd::rig
