#include "mgdd/rig/frame_codec.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <span>
#include <string>

#include "mgdd/common/error.hpp"

namespace mgdd::rig {
namespace {

std::string name(const MeasuredSignal& signal, std::size_t) {
  return std::string(name_of(signal.what));
}
// A command may have several fixed numbers.
std::string name(const CommandedSignal& signal, std::size_t place) {
  const std::string shown(name_of(signal.what));
  return signal.what == Commanded::fixed ? shown + " " + std::to_string(place + 1) : shown;
}

std::string in_hex(std::uint32_t id) {
  std::array<char, 8> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), id, 16).ptr;
  return "0x" + std::string(digits.data(), end);
}

// Counter and CRC take bits like any signal.
void add_protection(const E2eSettings& protection, std::vector<Signal>& all) {
  const bool whole = protection.counter_place == CounterPlace::byte;
  const int from = protection.counter_place == CounterPlace::high_nibble ? 4 : 0;
  all.push_back({"crc", {.start = 8 * protection.crc_byte, .length = 8}});
  all.push_back({"counter", {.start = 8 * protection.counter_byte + from, .length = whole ? 8 : 4}});
}

template <class SignalOf>
void validate_message(const MessageOf<SignalOf>& message) {
  const std::uint32_t largest = message.extended ? 0x1FFF'FFFFu : 0x7FFu;
  if (message.id > largest) throw ParameterError("id", message.id, "must have 11 bits, or 29 if extended");
  if (message.size < 1 || message.size > static_cast<int>(max_payload)) {
    throw ParameterError("size", message.size, "must be in [1, 64]");
  }
  std::vector<Signal> all;
  for (const SignalOf& signal : message.signals)
    all.push_back({name(signal, all.size()), signal.layout});
  if (message.protection) {
    validate(*message.protection);
    if (message.protection->size != message.size) {
      throw ParameterError("size of the protection", message.protection->size,
                           "must be " + std::to_string(message.size) + ", that of the message");
    }
    add_protection(*message.protection, all);
  }
  validate(std::span<const Signal>(all), message.size);
}

template <class SignalOf>
void require_valid(const MessageOf<SignalOf>& message) {
  try {
    validate_message(message);
  } catch (const ParameterError& error) {
    throw within("message " + in_hex(message.id), error);
  }
}

[[noreturn]] void refuse(std::string_view field, const std::string& why) {
  throw about(field, ParameterError(std::string(field) + why));
}

}  // namespace

void validate(const FrameCodecSettings& s) {
  require_valid(s.command);
  std::array<int, n_measured> times{};
  for (std::size_t i = 0; i < s.received.size(); ++i) {
    const auto& message = s.received[i];
    require_valid(message);
    const auto same = [&](const auto& other) { return other.id == message.id && other.extended == message.extended; };
    if (same(s.command) || std::any_of(s.received.begin(), s.received.begin() + static_cast<std::ptrdiff_t>(i), same)) {
      throw ParameterError("id", message.id, "must belong to one message: two senders of one identifier collide");
    }
    for (const MeasuredSignal& signal : message.signals)
      ++times[static_cast<std::size_t>(signal.what)];
  }
  for (const auto& [what, text] : names<Measured>()) {
    const int n = times[static_cast<std::size_t>(what)];
    if (n > 1) refuse(text, " is read from " + std::to_string(n) + " signals: must be one");
    if (n == 0 && static_cast<std::size_t>(what) < n_needed) {
      refuse(text, " is read from no signal: a loop needs angle_deg, first_v and second_v");
    }
  }
  const auto n_duties = std::count_if(s.command.signals.begin(), s.command.signals.end(),
                                      [](const CommandedSignal& c) { return c.what == Commanded::duty; });
  if (n_duties != 1) refuse("duty", " is written to " + std::to_string(n_duties) + " signals: must be one");
}

std::optional<std::int64_t> Measurements::oldest_ns() const noexcept {
  const std::int64_t oldest = *std::min_element(stamp_ns.begin(), stamp_ns.begin() + n_needed);
  return oldest > 0 ? std::optional(oldest) : std::nullopt;
}

FrameCodec::FrameCodec(const FrameCodecSettings& settings) : settings_((validate(settings), settings)) {
  for (const auto& message : settings_.received)
    checks_.push_back(message.protection ? std::optional<E2eCheck>(*message.protection) : std::nullopt);
}

FrameVerdict FrameCodec::read(const Frame& frame, Measurements& now) noexcept {
  brought_angle_ = false;
  if (frame.error || frame.remote) return FrameVerdict::foreign;
  for (std::size_t i = 0; i < settings_.received.size(); ++i) {
    const auto& message = settings_.received[i];
    if (message.id != frame.id || message.extended != frame.extended) continue;
    if (frame.size != message.size) return FrameVerdict::bad;
    if (auto& check = checks_[i]) {
      const E2eStatus status = check->push(frame.payload());
      if (status != E2eStatus::ok && status != E2eStatus::initial) return FrameVerdict::bad;
      if (!check->valid()) return FrameVerdict::waiting;
    }
    Measurements next = now;
    bool angle = false;
    for (const MeasuredSignal& signal : message.signals) {
      const auto at = static_cast<std::size_t>(signal.what);
      const auto& raws = signal.missing_raws;
      const bool missing =
          std::find(raws.begin(), raws.end(), unpack_raw(signal.layout, frame.payload())) != raws.end();
      const std::optional<double> value = unpack(signal.layout, frame.payload());
      const double number = missing ? unknown : value.value_or(unknown);
      if (missing ? at < n_needed : !std::isfinite(number)) return FrameVerdict::bad;
      next.value[at] = number;
      next.stamp_ns[at] = frame.monotonic_ns;
      angle = angle || signal.what == Measured::angle_deg;
    }
    now = next;
    brought_angle_ = angle;
    return FrameVerdict::good;
  }
  return FrameVerdict::foreign;
}

bool FrameCodec::write(const Drive& drive, double reference_deg, Frame& frame) noexcept {
  const auto& message = settings_.command;
  frame = {};
  frame.id = message.id;
  frame.extended = message.extended;
  frame.size = static_cast<std::uint8_t>(message.size);
  frame.fd = message.size > 8;
  const std::span<std::uint8_t> payload(frame.data.data(), frame.size);
  for (const CommandedSignal& signal : message.signals) {
    double value = drive.bridge_open ? signal.at_rest.value_or(signal.fixed) : signal.fixed;
    if (signal.what == Commanded::duty) value = drive.duty;
    if (signal.what == Commanded::enable) value = drive.bridge_open ? 0.0 : 1.0;
    if (signal.what == Commanded::reference_deg) value = reference_deg;
    const PackStatus status = pack(signal.layout, value, OutOfRange::clamp, payload);
    if (status != PackStatus::ok && status != PackStatus::clamped) return false;
  }
  if (!message.protection) return true;
  if (!protect(*message.protection, counter_, payload)) return false;
  counter_ = next_counter(*message.protection, counter_);
  return true;
}

}  // namespace mgdd::rig
