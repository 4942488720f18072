#include "mgdd/rig/signal_codec.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include "mgdd/common/error.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::rig {
namespace {

using Payload = std::array<std::uint8_t, 8>;
constexpr auto big = ByteOrder::big_endian;
constexpr auto with_sign = RawType::signed_integer;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

Payload packed(const SignalLayout& layout, double value, PackStatus wanted = PackStatus::ok,
               OutOfRange beyond = OutOfRange::clamp) {
  Payload payload{};
  EXPECT_EQ(pack(layout, value, beyond, payload), wanted);
  return payload;
}

TEST(SignalCodec, EveryBitAtBothEndsComesBackAndNoOtherMoves) {
  for (const ByteOrder order : {ByteOrder::little_endian, big}) {
    for (const RawType type : {RawType::unsigned_integer, with_sign}) {
      for (int length = 1; length <= 64; ++length) {
        for (int start = 0; start < 64; ++start) {
          const SignalLayout layout{.start = start, .length = length, .byte_order = order, .type = type};
          Payload zeros{}, ones{};
          ones.fill(0xFF);
          const bool is_signed = type == with_sign;
          const int bits = is_signed ? length - 1 : length;
          const std::uint64_t most = bits == 0 ? 0 : ~std::uint64_t{0} >> (64 - bits), least = is_signed ? ~most : 0;
          for (const std::uint64_t raw : {most, least, std::uint64_t{0}}) {
            Payload on_zeros = zeros, on_ones = ones;
            const PackStatus status = pack_raw(layout, raw, OutOfRange::refuse, on_zeros);
            if (status == PackStatus::does_not_fit) {
              EXPECT_EQ(on_zeros, zeros);
              EXPECT_FALSE(unpack_raw(layout, zeros));
              continue;
            }
            ASSERT_EQ(status, PackStatus::ok) << length << " from " << start;
            ASSERT_EQ(pack_raw(layout, raw, OutOfRange::refuse, on_ones), PackStatus::ok);
            EXPECT_EQ(unpack_raw(layout, on_zeros), raw);
            EXPECT_EQ(unpack_raw(layout, on_ones), raw);
            int kept = 0;
            for (std::size_t i = 0; i < 8; ++i)
              kept += std::popcount(static_cast<unsigned>(on_zeros[i] ^ on_ones[i]));
            EXPECT_EQ(kept, 64 - length) << "bits beside the signal changed";
          }
        }
      }
    }
  }
}

TEST(SignalCodec, NothingWraps) {
  const SignalLayout duty{.start = 5, .length = 12, .type = with_sign, .scale = 0.0005};  // +-1.0235
  for (const double value : {1.1, 3.2, 1e9, 1e300, std::numeric_limits<double>::max()}) {
    for (const double sign : {1.0, -1.0}) {
      const double sent = unpack(duty, packed(duty, sign * value, PackStatus::clamped)).value_or(nan);
      EXPECT_EQ(sent, sign > 0.0 ? 2047 * 0.0005 : -2048 * 0.0005);
      EXPECT_EQ(packed(duty, sign * value, PackStatus::out_of_range, OutOfRange::refuse), Payload{});
    }
  }
  EXPECT_EQ(packed({.length = 8}, -1e-9), Payload{}) << "rounds to 0";
  EXPECT_EQ(packed({.length = 8}, -1.0, PackStatus::clamped), Payload{});
  EXPECT_EQ(packed({.length = 8}, 255.5, PackStatus::clamped), Payload{0xFF}) << "halves to even: 256";
  EXPECT_EQ(packed({.length = 8}, 254.5), Payload{0xFE});
  Payload all{};
  all.fill(0xFF);
  EXPECT_EQ(packed({.length = 64}, 0x1p64, PackStatus::clamped), all);
  EXPECT_EQ(packed({.length = 64, .type = with_sign}, 0x1p63, PackStatus::clamped)[7], 0x7F);
  EXPECT_EQ(packed({.length = 64, .type = with_sign}, -0x1p63)[7], 0x80);
}

TEST(SignalCodec, BoundsOfTheLayout) {
  const SignalLayout layout{.length = 16, .scale = 0.01, .minimum = 2.0, .maximum = 90.0};
  EXPECT_EQ(unpack(layout, packed(layout, 400.0, PackStatus::clamped)), 90.0);
  EXPECT_EQ(unpack(layout, packed(layout, -5.0, PackStatus::clamped)), 2.0);
  EXPECT_EQ(unpack(layout, packed(layout, 90.0, PackStatus::ok, OutOfRange::refuse)), 90.0);
  EXPECT_EQ(packed(layout, 90.1, PackStatus::out_of_range, OutOfRange::refuse), Payload{});
}

TEST(SignalCodec, WhatIsNotFiniteIsRefused) {
  for (const SignalLayout& layout :
       {SignalLayout{.length = 16}, SignalLayout{.length = 32, .type = RawType::float32},
        SignalLayout{.length = 64, .type = RawType::float64, .minimum = 0.0, .maximum = 1.0}}) {
    for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL})
      EXPECT_EQ(packed(layout, value, PackStatus::not_finite), Payload{});
  }
  EXPECT_EQ(packed({.length = 8, .scale = 0.0}, 0.0, PackStatus::not_finite), Payload{}) << "unchecked layout";
}

TEST(SignalCodec, FloatsNeverBecomeInfinite) {
  const SignalLayout layout{.length = 32, .type = RawType::float32};
  constexpr double most = std::numeric_limits<float>::max();
  EXPECT_EQ(unpack(layout, packed(layout, 1e39, PackStatus::clamped)), most);
  EXPECT_EQ(unpack(layout, packed(layout, -1e300, PackStatus::clamped)), -most);
  EXPECT_EQ(unpack(layout, packed(layout, most)), most);
}

TEST(SignalCodec, BeyondThePayload) {
  Payload payload{};
  const auto three = std::span(payload).first(3);
  EXPECT_EQ(pack({.start = 16, .length = 9}, 1.0, OutOfRange::clamp, three), PackStatus::does_not_fit);
  EXPECT_EQ(pack({.start = 16, .length = 8}, 1.0, OutOfRange::clamp, three), PackStatus::ok);
  EXPECT_EQ(pack({.start = 17, .length = 3, .byte_order = big}, 1.0, OutOfRange::clamp, three),
            PackStatus::does_not_fit);
  EXPECT_FALSE(unpack({.start = 24, .length = 1}, three));
  EXPECT_FALSE(unpack({.start = -8, .length = 4}, three)) << "unchecked layout";
  EXPECT_FALSE(unpack({.start = 0, .length = 0}, three)) << "unchecked layout";
  EXPECT_FALSE(unpack({.start = 0, .length = 16, .type = RawType::float32}, three)) << "unchecked layout";
}

TEST(SignalCodec, AMessageNamesWhatIsWrong) {
  const auto refused = [](const std::vector<Signal>& signals, int size, std::string_view text) {
    try {
      validate(signals, size);
    } catch (const ParameterError& error) {
      EXPECT_NE(std::string_view(error.what()).find(text), std::string_view::npos) << error.what();
      return;
    }
    ADD_FAILURE() << text;
  };
  const Signal angle{.name = "Theta", .layout = {.start = 0, .length = 16}};
  const Signal state{.name = "State", .layout = {.start = 23, .length = 4, .byte_order = big}};
  EXPECT_NO_THROW(validate(std::vector{angle, state}, 3));
  refused({angle, state}, 2, "signal State: its 4 bits from bit 23 reach beyond the 2 bytes");
  refused({angle, {.name = "Side", .layout = {.start = 15, .length = 1}}}, 8,
          "signal Side: shares bits with signal Theta");
  refused({angle, {.name = "Back", .layout = {.start = 15, .length = 9, .byte_order = big}}}, 8, "shares bits");
  refused({angle, angle}, 8, "twice");
  refused({{.name = "Wide", .layout = {.length = 65}}}, 16, "Wide.length = 65");
  refused({{.name = "Flat", .layout = {.scale = 0.0}}}, 8, "Flat.scale = 0");
  refused({{.name = "Half", .layout = {.length = 16, .type = RawType::float32}}}, 8, "must be 32 of a float32");
  refused({{.name = "Turned", .layout = {.minimum = 1.0, .maximum = -1.0}}}, 8, "Turned.maximum");
}

TEST(SignalCodec, BranchesOfAMultiplexerShareBits) {
  const Signal kp{.name = "Kp", .layout = {.start = 8, .length = 32}, .branches = {0, 3}};
  Signal ki{.name = "Ki", .layout = {.start = 8, .length = 32}, .branches = {1}};
  EXPECT_NO_THROW(validate(std::vector{kp, ki}, 8));
  ki.branches = {1, 3};
  EXPECT_THROW(validate(std::vector{kp, ki}, 8), ParameterError);
  ki.branches = {};
  EXPECT_THROW(validate(std::vector{kp, ki}, 8), ParameterError);
}

TEST(SignalCodec, NoAllocation) {
  const SignalLayout layout{
      .start = 3, .length = 33, .byte_order = big, .type = with_sign, .scale = 0.1, .minimum = -2.0};
  Payload payload{};
  const test_support::AllocationCounter counter;
  double sum = 0.0;
  for (int i = 0; i < 100; ++i) {
    static_cast<void>(pack(layout, 0.7 * i, OutOfRange::clamp, payload));
    sum += unpack(layout, payload).value_or(nan);
  }
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_GT(sum, 0.0);
  static_assert(noexcept(pack(layout, 1.0, OutOfRange::clamp, payload)) && noexcept(unpack(layout, payload)));
}

}  // namespace
}  // namespace mgdd::rig
