#include <gtest/gtest.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#ifndef _WIN32
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

#include "mgdd/common/error.hpp"
#include "mgdd/rig/record_reader.hpp"
#include "mgdd/rig/record_writer.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::rig {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

const RecordHeader header{
    .run_id = {9, 8, 7}, .wall_ns = 1'700'000'000'000'000'001, .monotonic_ns = -5, .json = R"({"rig": "°"})"};

Frame frame_of(int i) {
  Frame frame{.id = 0x100u + static_cast<std::uint32_t>(i), .extended = i % 3 == 0, .received = i % 2 == 0};
  frame.fd = i % 5 == 0;
  frame.bit_rate_switch = i % 10 == 0;
  frame.remote = i % 7 == 6;
  frame.error = i % 11 == 10;
  frame.channel = static_cast<std::uint8_t>(i % 4);
  frame.size = static_cast<std::uint8_t>(frame.fd ? 64 - i % 64 : i % 9);
  for (std::size_t k = 0; k < frame.size && !frame.remote; ++k)
    frame.data[k] = static_cast<std::uint8_t>(31 * i + static_cast<int>(k));
  frame.monotonic_ns = 1'000'000'007LL * i;
  frame.bus_ns = -3LL * i;
  return frame;
}

class RecordFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("mgdd_record_" + std::to_string(::getpid()) + "_" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directory(folder_);
    path_ = (folder_ / "run.rec").string();
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// 30 frames, 10 samples in one table and 5 in another, 2 events.
  void write_all() const {
    RecordWriter writer(path_, header);
    const std::vector<std::string> plate{"angle_deg", "duty"}, engine{"speed_rpm"};
    const std::uint16_t first = writer.add_table("controller", plate, 1),
                        second = writer.add_table("engine", engine, 2);
    for (int i = 0; i < 30; ++i) {
      ASSERT_TRUE(writer.write(frame_of(i)));
      ASSERT_TRUE(i % 3 != 0 || writer.write_sample(first, std::int64_t{10} * i, std::array{0.1 * i, -0.25}));
      ASSERT_TRUE(i % 6 != 0 || writer.write_sample(second, std::int64_t{10} * i + 1, std::array{1200.0 + i}));
    }
    ASSERT_TRUE(writer.write_event(77, "state", "ARMED → RUN"));
    ASSERT_TRUE(writer.write_event(78, "note", ""));
    ASSERT_TRUE(writer.sync());
    EXPECT_EQ(writer.written(), 49u);
    EXPECT_EQ(writer.size(), fs::file_size(path_));
  }

  static Bytes bytes_of(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void put(const std::string& path, const Bytes& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  static RecordColumns read(const std::string& path) {
    RecordReader reader(path);
    return read_columns(reader);
  }

  fs::path folder_;
  std::string path_;
};

TEST_F(RecordFile, AnyFlippedBitStopsTheReaderThereAndARepairLosesNothing) {
  write_all();
  const Bytes whole = bytes_of(path_);
  std::vector<std::size_t> starts;  // of the records
  RecordReader reader(path_);
  starts.push_back(reader.position());
  while (reader.next())
    starts.push_back(reader.position());
  for (std::size_t at = 0; at < whole.size(); at += 5) {
    Bytes bad = whole;
    bad[at] ^= static_cast<std::uint8_t>(1u << at % 8);
    put(path_, bad);
    const auto hit = static_cast<std::uint64_t>(std::upper_bound(starts.begin(), starts.end(), at) - starts.begin());
    if (hit == 0) {
      EXPECT_THROW(RecordReader{path_}, DataError);
    } else {
      EXPECT_EQ(read(path_).records, hit - 1) << at;
    }
    if (at >= 8 && at < 12) continue;  // another version: neither read nor repaired
    const RepairReport report = repair_record(path_, path_);
    EXPECT_EQ(report.records, hit == 0 ? 49u : 48u) << at;
    EXPECT_EQ(report.header_lost, hit == 0);
    const RecordColumns mended = read(path_);
    EXPECT_EQ(mended.ignored_bytes, 0u);
    EXPECT_EQ(mended.damaged_bytes, report.damaged_bytes);
    const std::size_t size = hit == 0 ? starts[0] : starts[hit] - starts[hit - 1];
    EXPECT_EQ(report.damaged_bytes, hit == starts.size() ? 0 : size) << at;
    EXPECT_EQ(report.places, 1u);
    const Bytes once = bytes_of(path_);
    repair_record(path_, path_);
    EXPECT_EQ(bytes_of(path_), once) << "a repaired record needs no repair";
  }
}

TEST_F(RecordFile, SamplesWhoseNamesAreLostAreKept) {
  write_all();
  Bytes bad = bytes_of(path_);
  bad[header_head + header.json.size() + 4 + record_head + 20] ^= 1u;  // names of the first table
  put(path_, bad);
  const std::string target = (folder_ / "mended.rec").string();
  repair_record(path_, target);
  EXPECT_EQ(bytes_of(path_), bad) << "the source is left alone";
  const RecordColumns all = read(target);
  ASSERT_EQ(all.tables.size(), 2u);
  EXPECT_EQ(all.tables[0].name, "engine");
  EXPECT_EQ(all.tables[1].name, "table_0");
  EXPECT_EQ(all.tables[1].columns, (std::vector<std::string>{"value_0", "value_1"}));
  EXPECT_EQ(all.tables[1].monotonic_ns.size(), 10u);
}

// With a checksum that fits: what a writer got wrong, or somebody made.
TEST_F(RecordFile, ANameLongerThanItsRecordIsDamage) {
  write_all();
  Bytes bad = bytes_of(path_);
  const std::size_t at = header_head + header.json.size() + 4;  // the names of the first table
  const std::size_t size = bad[at] + 256u * bad[at + 1];
  bad[at + record_head + body_head + 1] = 0xEA;  // their first length
  const std::uint32_t sum = crc32(std::span(bad).subspan(at + record_head, size));
  for (std::size_t i = 0; i < 4; ++i)
    bad[at + 4 + i] = static_cast<std::uint8_t>(sum >> 8 * i);
  put(path_, bad);
  const std::string target = (folder_ / "mended.rec").string();
  repair_record(path_, target);
  EXPECT_EQ(read(target).tables[1].name, "table_0");
}

TEST_F(RecordFile, ZerosBehindAPowerFailureAreNoRecords) {
  write_all();
  Bytes bytes = bytes_of(path_);
  bytes.resize(bytes.size() + 4096);
  put(path_, bytes);
  const RecordColumns all = read(path_);
  EXPECT_EQ(all.records, 49u);
  EXPECT_EQ(all.ignored_bytes, 4096u);
  EXPECT_EQ(repair_record(path_, path_).damaged_bytes, 4096u);
}

TEST_F(RecordFile, AKindOfALaterVersionIsSkipped) {
  write_all();
  Bytes later = encoded_event(5, "note", "text");
  later[record_head] = 200;
  const std::uint32_t sum = crc32(std::span(later).subspan(record_head));
  for (std::size_t i = 0; i < 4; ++i)
    later[4 + i] = static_cast<std::uint8_t>(sum >> 8 * i);
  Bytes bytes = bytes_of(path_);
  bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(header_head + header.json.size() + 4), later.begin(),
               later.end());
  put(path_, bytes);
  const RecordColumns all = read(path_);
  EXPECT_EQ(all.unknown, 1u);
  EXPECT_EQ(all.records, 50u);
  EXPECT_EQ(repair_record(path_, path_).records, 50u);
  EXPECT_EQ(bytes_of(path_), bytes);
}

TEST_F(RecordFile, WhatIsNoRecordIsRefusedAndUntouched) {
  const Bytes text{'n', 'o', ' ', 'r', 'e', 'c', 'o', 'r', 'd'};
  put(path_, text);
  EXPECT_THROW(RecordReader{path_}, DataError);
  EXPECT_THROW(repair_record(path_, path_), DataError);
  EXPECT_EQ(bytes_of(path_), text);
  EXPECT_THROW(repair_record((folder_ / "absent.rec").string(), path_), DataError);
  EXPECT_THROW(RecordReader{folder_.string()}, DataError);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1) << "no temporary file is left";
}

TEST_F(RecordFile, FramesAndSamplesWithoutAllocation) {
  RecordWriter writer(path_, header);
  const std::vector<std::string> columns{"a", "b"};
  const std::uint16_t table = writer.add_table("t", columns, 0);
  const Frame frame = frame_of(5);
  const test_support::AllocationCounter counter;
  bool done = true;
  for (int i = 0; i < 100; ++i)
    done = writer.write(frame) && writer.write_sample(table, i, std::array{1.0, 2.0}) && done;
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(done);
  static_assert(noexcept(writer.write(frame)));
}

#ifndef _WIN32
/// Runs `work` in a process of its own and gives its wait status.
template <class Work>
int in_child(Work work) {
  const pid_t child = ::fork();
  if (child == 0) {
    work();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

TEST_F(RecordFile, AHeaderThatDoesNotFitLeavesNoFile) {
  const int status = in_child([this] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit narrow{.rlim_cur = 20, .rlim_max = 20};
    if (::setrlimit(RLIMIT_FSIZE, &narrow) != 0) ::_exit(2);
    try {
      const RecordWriter writer(path_, header);
    } catch (const RigError&) {
      ::_exit(fs::exists(path_) ? 4 : 0);
    }
    ::_exit(3);
  });
  EXPECT_EQ(status, 0) << "exit code " << WEXITSTATUS(status);
}
#endif

}  // namespace
}  // namespace mgdd::rig
