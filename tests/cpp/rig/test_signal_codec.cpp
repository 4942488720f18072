#include "mgdd/rig/signal_codec.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "mgdd/common/error.hpp"

namespace mgdd::rig {
namespace {

using Payload = std::array<std::uint8_t, 8>;
constexpr auto big = ByteOrder::big_endian;
constexpr auto with_sign = RawType::signed_integer;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
static_assert(noexcept(pack({}, 0.0, OutOfRange::clamp, {})) && noexcept(unpack({}, {})));

Payload packed(const SignalLayout& layout, double value, PackStatus wanted = PackStatus::ok,
               OutOfRange beyond = OutOfRange::clamp) {
  Payload payload{};
  EXPECT_EQ(pack(layout, value, beyond, payload), wanted);
  return payload;
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

TEST(SignalCodec, BranchesOfAMultiplexerShareBits) {
  const Signal kp{.name = "Kp", .layout = {.start = 8, .length = 32}, .branches = {0, 3}};
  Signal ki{.name = "Ki", .layout = {.start = 8, .length = 32}, .branches = {1}};
  EXPECT_NO_THROW(validate(std::vector{kp, ki}, 8));
  ki.branches = {1, 3};
  EXPECT_THROW(validate(std::vector{kp, ki}, 8), ParameterError);
  ki.branches = {};
  EXPECT_THROW(validate(std::vector{kp, ki}, 8), ParameterError);
}

}  // namespace
}  // namespace mgdd::rig
