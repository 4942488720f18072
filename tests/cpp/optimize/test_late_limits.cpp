// Limits that come late: paired with the input that caused them, kept by every seeker, with a margin for their scatter;
// limits that contradict each other, and what a seeker says of them.
#include <deque>

#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

/// A sensor behind a transport delay and a first-order lag, at rest at its first value.
class Sensor {
 public:
  explicit Sensor(ComponentLag lag) : lag_(lag) {}
  double read(double value) {
    past_.push_back(value);
    const double arriving = past_.front();
    if (static_cast<double>(past_.size()) > lag_.delay_cycles) past_.pop_front();
    const bool first = std::isnan(reading_);
    reading_ = first || lag_.lag_cycles == 0.0
                   ? arriving
                   : reading_ + (1.0 - std::exp(-1.0 / lag_.lag_cycles)) * (arriving - reading_);
    return reading_;
  }

 private:
  ComponentLag lag_;
  std::deque<double> past_;
  double reading_ = std::nan("");
};

TEST(CausingInputs, AreWhatTheReadingShows) {
  for (const ComponentLag lag :
       {ComponentLag{}, ComponentLag{7.0, 0.0}, ComponentLag{0.0, 3.0}, ComponentLag{4.0, 6.0}}) {
    CausingInputs causes({{ComponentLag{2.0, 0.0}}, {lag}}, 2);
    Sensor first(lag), second(lag);
    int known = 0;
    for (int k = 0; k < 200; ++k) {
      const Inputs applied = inputs({std::sin(0.3 * k) + 0.01 * k, std::cos(0.7 * k)});
      causes.record(applied);
      const Inputs reading = inputs({first.read(applied[0]), second.read(applied[1])});
      if (!causes.known(1)) continue;
      ++known;
      EXPECT_LT((causes.of(1, applied) - reading).norm(), 1e-9 + 0.2 * std::exp(-0.3 * known)) << k;
    }
    EXPECT_EQ(known, 200 - static_cast<int>(lag.delay_cycles + 2.0 * lag.lag_cycles));
  }
}

TEST(CausingInputs, ADelayBetweenTwoCyclesIsBetweenTheirInputs) {
  CausingInputs causes({{ComponentLag{2.25, 0.0}}}, 1);
  for (int k = 0; k < 20; ++k)
    causes.record(scalar_input(4.0 * k));
  EXPECT_DOUBLE_EQ(causes.of(0, scalar_input(76.0))[0], 4.0 * (19.0 - 2.25));
}

struct Outcome {
  double above = 0.0, mean = 0.0;  // share of cycles truly above, mean estimate, both from cycle 1000 on
  LimitState state = LimitState::free;
};

// J is best at +8; the limited quantity is 100 + 2 x, so that a limit of 104 stands at x = 2.
template <class S>
Outcome late_run(S& seeker, ComponentLag truth, double noise_sd, std::uint64_t seed, double missing = 0.0) {
  Outcome out;
  Sensor sensor(truth);
  const int cycles = 4000, from = 1000;
  for (int k = 0; k < cycles; ++k) {
    const auto index = static_cast<std::uint64_t>(k);
    const double x = seeker.ask()[0], value = 100.0 + 2.0 * x;
    const double j[] = {quadratic(x - 8.0) + noise_sd * random::normal(seed, 1, index)};
    const double limits[] = {sensor.read(value) + 4.0 * noise_sd * random::normal(seed, 2, index)};
    seeker.tell({j, limits, random::bernoulli(missing, seed, 3, index)});
    if (k < from) continue;
    out.above += (value > 104.0 + 1e-6 ? 1.0 : 0.0) / (cycles - from);
    out.mean += seeker.estimate()[0] / (cycles - from);
  }
  out.state = limit_state_of(seeker, 0);
  return out;
}

TEST(LateLimits, StayWithTheirInputsWhereReadingsAreMissing) {
  const ComponentLag late{10.0, 0.0};
  Limit limit{"p_max_bar", 104.0};
  limit.lag = late;
  auto all = every_seeker(space_at(scalar_input(-8.0), 20.0), 0.0, 2, {limit});
  for (auto& [name, any] : all) {
    if (name == "golden_section") continue;
    std::visit(
        [&](auto& seeker) {
          const Outcome one = late_run(seeker, late, 0.0, 5, 0.1);
          EXPECT_LE(one.above, 0.01) << name;
          EXPECT_GT(one.mean, 0.5) << name;
          if constexpr (requires { seeker.filter(); }) {
            EXPECT_NEAR(seeker.filter().model(0).predict(scalar_input(1.5)), 103.0, 1e-6) << name;
          }
        },
        any);
  }
}

TEST(LateLimits, AndOneBehindALagToo) {
  const ComponentLag late{10.0, 25.0};
  Limit limit{"nox", 104.0};
  limit.lag = late;
  limit.margin_sd = 2.0;
  for (const double noise : {0.0, 0.25}) {
    for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 20.0), noise, 1, {limit})) {
      const Outcome out = std::visit([&](auto& seeker) { return late_run(seeker, late, noise, 3); }, any);
      EXPECT_LE(out.above, name == "golden_section" ? 0.15 : 0.02) << name << ", noise " << noise;
      EXPECT_GT(out.mean, -1.5) << name << ", noise " << noise;
    }
  }
}

// Odd errors and even ones: a dither that flips every cycle takes a slope for its opposite at an odd one.
TEST(LateLimits, ADelayWrongByAsManyCyclesAsItIsUncertainIsFound) {
  for (const auto& [truth, stated] :
       {std::pair{10, 7}, {10, 8}, {10, 9}, {10, 11}, {10, 12}, {10, 13}, {1, 0}, {0, 3}}) {
    Limit limit{"p_max_bar", 104.0};
    limit.lag.delay_cycles = stated;
    std::vector<double> above(10, 0.0);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
      auto all = every_seeker(space_at(scalar_input(-8.0), 20.0), 0.25, seed, {limit});
      for (std::size_t i = 0; i < all.size(); ++i) {
        const ComponentLag lag{static_cast<double>(truth), 0.0};
        above[i] += std::visit([&](auto& s) { return late_run(s, lag, 0.25, seed); }, all[i].second).above / 3.0;
      }
    }
    const auto names = every_seeker(space_at(scalar_input(-8.0), 20.0), 0.25, 0, {limit});
    for (std::size_t i = 0; i < names.size(); ++i)
      EXPECT_LE(above[i], 0.03) << names[i].first << ", " << truth << " stated as " << stated;
  }
}

// Nothing is known of the limit yet: seekers that dither wait, before the first reading and after a restart.
TEST(LateLimits, TheEstimateWaitsForTheFirstReading) {
  Limit limit{"p", 104.0};
  limit.lag = {30.0, 0.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 20.0), 0.25, 1, {limit})) {
    if (name == "golden_section") continue;  // its search is its dither
    std::visit(
        [&, &who = name](auto& seeker) {
          for (int begin = 0; begin < 2; ++begin) {
            const double start = seeker.estimate()[0];
            for (int k = 0; k < 500; ++k) {
              const double x = seeker.ask()[0];
              const double j[] = {quadratic(x - 8.0)}, values[] = {90.0 + x};
              seeker.tell({j, values});
              if (k < 30) {
                EXPECT_EQ(seeker.estimate()[0], start) << who;
              }
            }
            if (begin == 0) {
              EXPECT_NE(seeker.estimate()[0], start) << who;
            }
            seeker.restart();
          }
        },
        any);
  }
}

// x <= -1 in scales of 1 and x >= 5 in scales of 3 cannot both be: the largest scaled excess is smallest at 0.5.
TEST(LateLimits, LimitsThatContradictEndInTheLeastExcessAndSayInfeasible) {
  for (const double delay : {0.0, 6.0}) {
    Limit low{"low", -1.0, 0.0, LimitMethod::switching, 1.0, 1.0},
        high{"high", -5.0, 0.0, LimitMethod::switching, 1.0, 3.0};
    low.lag = {delay, 0.0};
    for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 20.0), 0.0, 1, {low, high})) {
      SCOPED_TRACE(name + ", delay " + std::to_string(delay));
      std::visit(
          [&](auto& seeker) {
            Sensor sensor(low.lag);
            double mean = 0.0;
            for (int k = 0; k < 2500; ++k) {
              const double x = seeker.ask()[0];
              const double j[] = {quadratic(x - 8.0)}, values[] = {sensor.read(x), -x};
              seeker.tell({j, values});
              if (k >= 1500) mean += seeker.estimate()[0] / 1000.0;
            }
            EXPECT_NEAR(mean, 0.5, 0.5);
            EXPECT_EQ(limit_state_of(seeker, 0), LimitState::infeasible);
            EXPECT_EQ(limit_state_of(seeker, 1), LimitState::infeasible);
          },
          any);
    }
  }
}

TEST(LateLimits, ALimitOutOfReachIsFreeAndOneBeyondTheBoundsInfeasible) {
  for (auto& [name, any] :
       every_seeker(space_at(scalar_input(-8.0), 12.0), 0.0, 1, {{"far", 900.0}, {"none", -50.0}})) {
    if (name == "golden_section") continue;  // its bracket ends before it knows
    std::visit(
        [&, &who = name](auto& seeker) {
          for (int k = 0; k < 3000; ++k) {
            const double x = seeker.ask()[0];
            const double j[] = {quadratic(x - 8.0)}, values[] = {100.0 + x, -2.0 * x};  // -2 x <= -50: x >= 25
            seeker.tell({j, values});
          }
          EXPECT_EQ(limit_state_of(seeker, 0), LimitState::free) << who;
          EXPECT_EQ(limit_state_of(seeker, 1), LimitState::infeasible) << who;
          EXPECT_GT(seeker.estimate()[0], 7.0) << who;
        },
        any);
  }
}

}  // namespace
}  // namespace mgdd::optimize
