// Between the frames of a bus and the numbers of a throttle loop: which signal of which message is the measured angle,
// and how a drive becomes a command. Layouts as a DBC counts, protection as of rig/e2e.hpp. Angles in deg, V, A.
// `read` and `write` are noexcept and allocation-free; making a codec is offline code.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "mgdd/common/enum_names.hpp"
#include "mgdd/rig/e2e.hpp"
#include "mgdd/rig/frame.hpp"
#include "mgdd/rig/safety_gate.hpp"
#include "mgdd/rig/signal_codec.hpp"

namespace mgdd::rig {

/// A number that a loop reads from the bus; the first three it needs.
enum class Measured { angle_deg, first_v, second_v, supply_v, current_a, speed_deg_per_s, applied_duty };
inline constexpr std::size_t n_measured = names<Measured>().size(), n_needed = 3;

/// A number that a loop writes to the bus.
enum class Commanded {
  duty,
  enable,         ///< 1 while the actuator is driven, 0 with the bridge open
  reference_deg,  ///< that the loop follows
  fixed,          ///< one number while driven, one with an open bridge: a mode for example
};

struct MeasuredSignal {
  Measured what{};
  SignalLayout layout{};
  std::vector<std::uint64_t> missing_raws{};  ///< raw values of a missing number
};
struct CommandedSignal {
  Commanded what{};
  SignalLayout layout{};
  double fixed = 0.0;               ///< of the kind `fixed`
  std::optional<double> at_rest{};  ///< of the kind `fixed`, with an open bridge; none: the same
};

template <class SignalOf>
struct MessageOf {
  std::uint32_t id = 0;
  bool extended = false;
  int size = 8;  ///< bytes; more than 8: CAN FD
  std::optional<E2eSettings> protection{};
  std::vector<SignalOf> signals{};
};

struct FrameCodecSettings {
  MessageOf<CommandedSignal> command{};
  std::vector<MessageOf<MeasuredSignal>> received{};
};
/// ParameterError naming message and signal: bits that overlap or reach too far, also with counter and CRC; two
/// messages of one identifier; a number twice; no duty, angle or sensor; a protection of another size.
void validate(const FrameCodecSettings& settings);

/// The last good value of each number and when it came; NaN and 0: not yet.
struct Measurements {
  std::array<double, n_measured> value = [] {
    std::array<double, n_measured> none{};
    none.fill(std::numeric_limits<double>::quiet_NaN());
    return none;
  }();
  std::array<std::int64_t, n_measured> stamp_ns{};

  [[nodiscard]] double of(Measured what) const noexcept { return value[static_cast<std::size_t>(what)]; }
  /// Of the oldest number that a loop needs; none until all have come.
  [[nodiscard]] std::optional<std::int64_t> oldest_ns() const noexcept;
};

enum class FrameVerdict {
  foreign,  ///< no message of this codec
  waiting,  ///< its counter has not run in yet
  bad,      ///< wrong CRC, counter, length or number, or one that a loop needs is missing: not used
  good,
};

class FrameCodec {
 public:
  /// ParameterError for what `validate` refuses.
  explicit FrameCodec(const FrameCodecSettings& settings);

  /// Takes the numbers of a good frame.
  FrameVerdict read(const Frame& frame, Measurements& now) noexcept;
  /// Whether a frame of the message with the angle, in the last `read`.
  [[nodiscard]] bool brought_angle() const noexcept { return brought_angle_; }
  /// The next command frame; false, and nothing to send, where a number has no place in its signal.
  bool write(const Drive& drive, double reference_deg, Frame& frame) noexcept;

  [[nodiscard]] const FrameCodecSettings& settings() const noexcept { return settings_; }

 private:
  FrameCodecSettings settings_;
  std::vector<std::optional<E2eCheck>> checks_;  // of the received messages
  int counter_ = 0;
  bool brought_angle_ = false;
};

}  // namespace mgdd::rig
