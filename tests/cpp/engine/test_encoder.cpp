// Angle of an encoder: wheels with and without a gap at a speed that swings within the turn, edges lost and too many,
// turns miscounted, wheels that are others than told.
#include "mgdd/engine/crank/encoder.hpp"

#include "support/test.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;

constexpr double rate_hz = 200e3, rpm = 1500.0;
// Angle of the first sample, so that no mark stands at the start.
constexpr double start_deg = 77.3;

// Angle over time of an engine that slows down before each of two compressions a turn, and gets 3 % faster in the end.
double turned(double t, double length_s) {
  const double omega = 6.0 * rpm, mean = omega * t * (1.0 + 0.015 * t / length_s);
  return start_deg + mean + 1.1 * std::sin(2.0 * std::numbers::pi / 180.0 * (mean - 20.0));
}

struct Case {
  Column time, angle, signal, index;
};

// `tooth` gives the signal by the part of a pitch from an edge on; teeth of the gap have none.
Case record(long teeth, long missing, double turns, const std::function<double(double)>& tooth) {
  const double length = turns * 60.0 / rpm;
  Case out;
  for (long k = 0; static_cast<double>(k) < length * rate_hz; ++k) {
    const double t = static_cast<double>(k) / rate_hz, angle = turned(t, length);
    const double place = std::fmod(angle, 360.0) * static_cast<double>(teeth) / 360.0;
    out.time.push_back(t), out.angle.push_back(angle);
    out.signal.push_back(place < static_cast<double>(teeth - missing) ? tooth(place - std::floor(place)) : 0.0);
    out.index.push_back(std::fmod(angle, 360.0) < 0.4 ? 4.0 : 0.3);
  }
  return out;
}

double hall(double part) {
  return part < 0.45 ? 5.0 : 0.0;
}

EncoderAngle angle_of(const Case& c, const EncoderOptions& o, bool with_index = false) {
  return encoder_angle(c.time, c.signal, with_index ? std::span<const double>(c.index) : std::span<const double>(), o);
}

// Largest error, and how many samples have an angle; the record's first mark is 0.
struct Miss {
  double largest = 0.0;
  std::size_t told = 0;
};
Miss error_of(const Case& c, const EncoderAngle& found, double mark_deg = 360.0) {
  Miss out;
  for (std::size_t k = 0; k < c.time.size(); ++k) {
    if (std::isnan(found.angle_deg[k])) continue;
    ++out.told;
    const bool slipped = std::ranges::any_of(found.slipped_deg, [&](const auto& s) {
      return found.angle_deg[k] > s.first && found.angle_deg[k] < s.second;
    });
    if (!slipped) out.largest = std::max(out.largest, std::abs(found.angle_deg[k] - (c.angle[k] - mark_deg)));
  }
  return out;
}

// Half a sample is 0.023 degrees.
constexpr double fine_deg = 0.04;

TEST(EngineEncoder, AngleOfAWheelWithAGap) {
  for (const auto& [teeth, missing] : {std::pair{60L, 2L}, std::pair{36L, 1L}, std::pair{120L, 3L}}) {
    const Case c = record(teeth, missing, 8.0, hall);
    const EncoderAngle found =
        angle_of(c, {.teeth = static_cast<std::size_t>(teeth), .missing_teeth = static_cast<std::size_t>(missing)});
    const auto [largest, told] = error_of(c, found);
    EXPECT_LT(largest, fine_deg) << teeth;
    EXPECT_GT(told, c.time.size() * 97 / 100);
    EXPECT_EQ(found.mark_s.size(), 8u);
    EXPECT_EQ(found.lost + found.extra + found.lost_marks + found.slipped_deg.size(), 0u) << teeth;
  }
}

TEST(EngineEncoder, IndexBetweenTwoEdgesIsAsGood) {
  Case c = record(90, 0, 8.0, hall);
  for (std::size_t k = 0; k < c.index.size(); ++k)
    c.index[k] = std::abs(std::fmod(c.angle[k], 360.0) - 2.15) < 0.3 ? 4.0 : 0.3;  // 1.85 behind an edge of 4 degrees
  EXPECT_LT(error_of(c, angle_of(c, {.teeth = 90}, true), 361.85).largest, fine_deg);
}

TEST(EngineEncoder, WithoutAMarkTheFirstEdgeIsZero) {
  const Case c = record(180, 0, 3.0, hall);
  const EncoderAngle found = angle_of(c, {.teeth = 180});
  EXPECT_LT(error_of(c, found, 78.0).largest, fine_deg);
  const auto edge = std::ranges::find_if(c.angle, [](double a) { return a >= 78.0; }) - c.angle.begin();
  EXPECT_NEAR(found.mark_s.front(), c.time[static_cast<std::size_t>(edge)], 1.0 / rate_hz);
}

TEST(EngineEncoder, CoilSignalCrossesZeroAtTheEdge) {
  const Case c = record(60, 2, 6.0, [](double part) { return 3.0 * std::sin(2.0 * std::numbers::pi * part); });
  EXPECT_LT(error_of(c, angle_of(c, {.teeth = 60, .missing_teeth = 2, .level = 0.0})).largest, fine_deg);
}

TEST(EngineEncoder, LostAndExtraEdgesAreRepaired) {
  Case c = record(60, 2, 8.0, hall);
  const auto within = [&](double from, double to, double value) {
    for (std::size_t k = 0; k < c.time.size(); ++k)
      if (c.angle[k] > from && c.angle[k] < to) c.signal[k] = value;
  };
  within(719.0 - 24.0, 719.0 - 20.0, 0.0);      // a tooth of the first turn
  within(720.0 + 120.0, 720.0 + 126.0, 0.0);    // a tooth of the second
  within(1080.0 + 4.5, 1080.0 + 4.8, 5.0);      // a spike between two teeth
  within(1440.0 + 60.2, 1440.0 + 60.3, 0.0);    // a tooth twice
  within(1800.0 + 353.2, 1800.0 + 353.6, 5.0);  // a spike in the gap
  const EncoderAngle found = angle_of(c, {.teeth = 60, .missing_teeth = 2});
  EXPECT_EQ(found.lost, 2u);
  EXPECT_EQ(found.extra, 3u);
  EXPECT_TRUE(found.slipped_deg.empty());
  EXPECT_LT(error_of(c, found).largest, 2.0 * fine_deg);  // a pitch wider apart, the speed swings more
}

TEST(EngineEncoder, LostTeethAtTheGapCostNoTurn) {
  Case c = record(60, 2, 8.0, hall);
  for (std::size_t k = 0; k < c.time.size(); ++k) {
    if (c.angle[k] > 1079.0 && c.angle[k] < 1085.0) c.signal[k] = 0.0;  // the tooth that is the mark
  }
  const EncoderAngle found = angle_of(c, {.teeth = 60, .missing_teeth = 2});
  EXPECT_EQ(found.lost, 1u);
  EXPECT_EQ(found.lost_marks, 1u);
  EXPECT_TRUE(found.slipped_deg.empty());
  EXPECT_LT(error_of(c, found).largest, 2.0 * fine_deg);
}

TEST(EngineEncoder, FalseAndLostPulsesOfTheIndexCostNoTurn) {
  Case c = record(360, 0, 12.0, hall);
  for (std::size_t k = 0; k < c.time.size(); ++k) {
    if (c.angle[k] > 1070.0 && c.angle[k] < 1090.0) c.index[k] = 0.3;
    if (c.angle[k] > 2000.0 && c.angle[k] < 2000.6) c.index[k] = 4.0;
  }
  const EncoderAngle found = angle_of(c, {.teeth = 360}, true);
  EXPECT_EQ(found.lost_marks, 2u);
  EXPECT_LT(error_of(c, found).largest, fine_deg);
}

TEST(EngineEncoder, EvenAnglesKeepACubicAndARinging) {
  Column angle, cubic, ringing;
  for (int k = 0; k < 4000; ++k) {
    const double t = 1e-5 * k;
    angle.push_back(9000.0 * t);
    cubic.push_back(1.0 + t * (200.0 + t * (-5e4 + 3e6 * t)));
    ringing.push_back(std::sin(2.0 * std::numbers::pi * 6500.0 * t));
  }
  const Column p = at_even_angles(angle, cubic, 0.0, 0.05, 7199), r = at_even_angles(angle, ringing, 0.0, 0.05, 7199);
  for (std::size_t k = 0; k < p.size(); ++k) {
    const double t = 0.05 * static_cast<double>(k) / 9000.0;
    ASSERT_NEAR(p[k], 1.0 + t * (200.0 + t * (-5e4 + 3e6 * t)), 1e-9);
    const bool inside = k > 10 && k < 7180;
    ASSERT_NEAR(r[k], std::sin(2.0 * std::numbers::pi * 6500.0 * t), inside ? 2e-3 : 2e-2);
  }
}

}  // namespace
}  // namespace mgdd::engine
