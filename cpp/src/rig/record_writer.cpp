#include "mgdd/rig/record_writer.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#ifdef _WIN32
#include <io.h>
#else
#include <unistd.h>
#endif

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include "mgdd/common/bounds.hpp"

namespace mgdd::rig {
namespace {

#ifdef _WIN32
int open_new(const char* path) noexcept {
  return ::_open(path, _O_WRONLY | _O_CREAT | _O_EXCL | _O_APPEND | _O_BINARY, _S_IREAD | _S_IWRITE);
}
long write_some(int file, const std::uint8_t* from, std::size_t n) noexcept {
  return ::_write(file, from, static_cast<unsigned>(n));
}
bool cut_to(int file, std::uint64_t size) noexcept {
  return ::_chsize_s(file, static_cast<long long>(size)) == 0;
}
bool to_disk(int file) noexcept {
  return ::_commit(file) == 0;
}
bool close_file(int file) noexcept {
  return ::_close(file) == 0;
}
#else
int open_new(const char* path) noexcept {
  return ::open(path, O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
}
ssize_t write_some(int file, const std::uint8_t* from, std::size_t n) noexcept {
  return ::write(file, from, n);
}
bool cut_to(int file, std::uint64_t size) noexcept {
  return ::ftruncate(file, static_cast<off_t>(size)) == 0;
}
bool to_disk(int file) noexcept {
#ifdef __APPLE__
  return ::fsync(file) == 0;
#else
  return ::fdatasync(file) == 0;
#endif
}
bool close_file(int file) noexcept {
  return ::close(file) == 0;
}
#endif

constexpr std::size_t longest_name = 0xFFFF;

std::string remedy_of(int error) {
  switch (error) {
    case EEXIST:
      return "a record is never overwritten: give another name";
    case ENOENT:
      return "make the folder first";
    case ENOSPC:
#ifdef EDQUOT
    case EDQUOT:
#endif
      return "free some space or record elsewhere; what was written stays readable";
    case EFBIG:
      return "the file reached the limit of its size; what was written stays readable";
    case EBADF:
      return "the record is closed";
    default:
      return "what was written stays readable";
  }
}

}  // namespace

AppendFile::AppendFile(std::string path) : path_(std::move(path)), file_(open_new(path_.c_str())) {
  if (file_ >= 0) return;
  errno_ = errno;
  throw failure();
}

AppendFile::AppendFile(AppendFile&& other) noexcept
    : path_(std::move(other.path_)),
      file_(std::exchange(other.file_, -1)),
      size_(other.size_),
      errno_(other.errno_),
      torn_(other.torn_) {}

AppendFile::~AppendFile() {
  close();
}

bool AppendFile::append(ByteSpan bytes) noexcept {
  if (file_ < 0 || torn_) {
    if (file_ < 0) errno_ = EBADF;
    return false;
  }
  std::size_t done = 0;
  while (done < bytes.size()) {
    const auto n = write_some(file_, bytes.data() + done, bytes.size() - done);
    if (n > 0) {
      done += static_cast<std::size_t>(n);
    } else if (n == 0 || errno != EINTR) {
      errno_ = n == 0 ? ENOSPC : errno;
      if (done > 0) torn_ = !cut_to(file_, size_);
      return false;
    }
  }
  size_ += bytes.size();
  return true;
}

bool AppendFile::sync() noexcept {
  if (file_ >= 0 && to_disk(file_)) return true;
  errno_ = file_ < 0 ? EBADF : errno;
  return false;
}

bool AppendFile::close() noexcept {
  if (file_ < 0) return true;
  const bool closed = close_file(std::exchange(file_, -1));
  if (!closed) errno_ = errno;
  return closed;
}

RigError AppendFile::failure() const {
  return about("path", RigError(path_ + ": " + std::generic_category().message(errno_) + ": " + remedy_of(errno_)));
}

RecordWriter::RecordWriter(const std::string& path, const RecordHeader& header) : file_(path) {
  const bool fits = header.json.size() <= largest_body;
  if (fits && file_.append(encoded(header))) return;
  RigError failure = file_.failure();
  file_.close();
  std::remove(path.c_str());
  if (!fits)
    throw ParameterError("json", header.json.size(), "must be at most " + std::to_string(largest_body), "bytes");
  throw RigError(std::move(failure));
}

std::uint16_t RecordWriter::add_table(std::string_view name, std::span<const std::string> columns,
                                      std::int64_t monotonic_ns) {
  require_within("columns", static_cast<double>(columns.size()), 1, 10000, "names");
  require_within("tables", static_cast<double>(tables_.size()), 0, 0xFFFF);
  for (const std::string_view each : columns) {
    require_within("bytes of a column name", static_cast<double>(each.size()), 1, longest_name);
    if (std::count(columns.begin(), columns.end(), each) > 1) {
      throw ParameterError("columns", each, "must stand once in the table");
    }
  }
  require_within("bytes of a table name", static_cast<double>(name.size()), 1, longest_name);
  const auto table = static_cast<std::uint16_t>(tables_.size());
  const std::vector<std::uint8_t> record = encoded_columns(table, monotonic_ns, name, columns);
  if (record.size() > record_head + largest_body) {
    throw ParameterError("columns", record.size(), "must have names of at most 1 MiB together", "bytes");
  }
  tables_.reserve(tables_.size() + 1);
  room_.resize(std::max(room_.size(), sample_record_size(columns.size())));
  if (!put(record)) throw failure();
  tables_.push_back(columns.size());
  return table;
}

bool RecordWriter::write(const Frame& frame) noexcept {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): encode fills
  std::array<std::uint8_t, largest_frame_record> record;
  return put(ByteSpan(record).first(encode(frame, record)));
}

bool RecordWriter::write_sample(std::uint16_t table, std::int64_t monotonic_ns,
                                std::span<const double> values) noexcept {
  misfit_ = table >= tables_.size() || values.size() != tables_[table];
  if (misfit_) {
    ++refused_;
    return false;
  }
  encode_sample(table, monotonic_ns, values, room_);
  return put(ByteSpan(room_).first(sample_record_size(values.size())));
}

bool RecordWriter::write_event(std::int64_t monotonic_ns, std::string_view category, std::string_view text) {
  require_within("bytes of category", static_cast<double>(category.size()), 1, longest_name);
  require_within("bytes of text", static_cast<double>(text.size()), 0,
                 static_cast<double>(largest_body - body_head - longest_name));
  return put(encoded_event(monotonic_ns, category, text));
}

RigError RecordWriter::failure() const {
  if (!misfit_) return file_.failure();
  return about("values", RigError(path() + ": a sample needs a number per column of a table that was added before"));
}

bool RecordWriter::put(ByteSpan record) noexcept {
  misfit_ = false;
  const bool done = file_.append(record);
  ++(done ? written_ : refused_);
  return done;
}

}  // namespace mgdd::rig
