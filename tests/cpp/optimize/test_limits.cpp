// Every seeker with measured limits: it stops at them, keeps its dither below them, and comes back when they move.
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

struct Outcome {
  double mean = 0.0;     // of the estimate over the last half
  double highest = 0.0;  // limited value over the last half
  double over = 0.0;     // share of cycles over the limit there
};

// J is best at +8; the limited quantity is 100 + 2 x, so that a limit of 104 stands at x = 2.
template <class S>
Outcome run(S& seeker, int cycles, double noise_sd, std::uint64_t seed, double shift = 0.0) {
  Outcome out;
  const int half = cycles / 2;
  for (int k = 0; k < cycles; ++k) {
    const auto index = static_cast<std::uint64_t>(k);
    const double x = seeker.ask()[0];
    const double j[] = {quadratic(x - 8.0) + noise_sd * random::normal(seed, 1, index)};
    const double truth = 100.0 + 2.0 * x + shift;
    const double limits[] = {truth + 4.0 * noise_sd * random::normal(seed, 2, index)};
    seeker.tell({j, limits, false});
    if (k < half) continue;
    out.mean += seeker.estimate()[0] / (cycles - half);
    out.highest = std::max(out.highest, truth);
    out.over += (truth > 104.0 ? 1.0 : 0.0) / (cycles - half);
  }
  return out;
}

TEST(Limits, EverySeekerStopsAtTheLimitAndKeepsItsDitherBelow) {
  for (const LimitMethod method : {LimitMethod::switching, LimitMethod::penalty, LimitMethod::barrier}) {
    const Limit limit{"p_max_bar", 104.0, 0.0, method, method == LimitMethod::barrier ? 0.02 : 1.0, 10.0};
    for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 30.0), 0.0, 1, {limit})) {
      const Outcome out = std::visit([&](auto& seeker) { return run(seeker, 4000, 0.0, 1); }, any);
      EXPECT_LT(out.mean, 2.02) << name << ", " << name_of(method);
      EXPECT_GT(out.mean, -2.0) << name << ", " << name_of(method);
      EXPECT_LE(out.highest, 104.8) << name << ", " << name_of(method);
    }
  }
}

TEST(Limits, MarginKeepsNoiseBelowTheLimit) {
  const Limit limit{"p_max_bar", 104.0, 1.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 30.0), 0.25, 1, {limit})) {
    const Outcome out = std::visit([&](auto& seeker) { return run(seeker, 4000, 0.25, 4); }, any);
    EXPECT_LT(out.mean, 2.0) << name;
    EXPECT_GT(out.mean, -4.0) << name;
    EXPECT_LT(out.over, 0.1) << name;
  }
}

TEST(Limits, ALimitThatIsNotReachedChangesNothing) {
  const Limit limit{"p_max_bar", 1000.0};
  const SearchSpace space = space_at(scalar_input(-8.0), 30.0);
  auto with = every_seeker(space, 0.25, 1, {limit}), without = every_seeker(space, 0.25, 1);
  for (std::size_t i = 0; i < with.size(); ++i) {
    if (with[i].first == "golden_section") continue;  // takes more samples where limits are measured
    const auto path = [&](auto& seeker) {
      std::vector<double> out;
      for (int k = 0; k < 300; ++k) {
        const double x = seeker.ask()[0];
        const double j[] = {quadratic(x - 8.0)}, value[] = {100.0 + 2.0 * x};
        seeker.tell({j, std::span<const double>(value).first(seeker.limit_count()), false});
        out.push_back(x);
      }
      return out;
    };
    EXPECT_EQ(std::visit(path, with[i].second), std::visit(path, without[i].second)) << with[i].first;
  }
}

// The limited quantity jumps up by 12: everything above x = -4 is forbidden now, without a word to the seeker.
TEST(Limits, EverySeekerButGoldenSectionComesBackWhenTheEngineDrifts) {
  const Limit limit{"p_max_bar", 104.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(-8.0), 30.0), 0.0, 1, {limit})) {
    if (name == "golden_section") continue;
    std::visit([](auto& seeker) { run(seeker, 3000, 0.0, 1); }, any);
    const Outcome out = std::visit([](auto& seeker) { return run(seeker, 3000, 0.0, 1, 12.0); }, any);
    EXPECT_LT(out.mean, -4.0) << name;
    EXPECT_GT(out.mean, -9.0) << name;
    EXPECT_LE(out.highest, 104.8) << name;
  }
}

TEST(Limits, ASeekerThatStartsOverALimitLeavesIt) {
  const Limit limit{"p_max_bar", 104.0};
  for (auto& [name, any] : every_seeker(space_at(scalar_input(12.0), 30.0), 0.0, 1, {limit})) {
    const Outcome out = std::visit([](auto& seeker) { return run(seeker, 1600, 0.0, 1); }, any);
    EXPECT_LT(out.mean, 2.02) << name;
    EXPECT_LE(out.highest, 104.8) << name;
  }
}

}  // namespace
}  // namespace mgdd::optimize
