#include "mgdd/identify/throttle/first_principle_fit.hpp"

#include "mgdd/common/random.hpp"
#include "mgdd/identify/free_run_fit.hpp"
#include "support/test.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::identify {
namespace {

using throttle::FirstPrinciple;

// A passenger-car throttle: preload above friction, weak springs; the lower spring is another part.
constexpr FirstPrincipleGroups truth{0.0197, 83'597.0, 0.1292, 4.96e-4, 0.0927, 0.14, 8e-4, 8.0,
                                     0.0,    0.0,      10.0,   0.25,    0.0,    0.0,  0.5,  0.0};
constexpr FirstPrincipleGroups start{0.030, 5e4, 0.1,  1e-3, 0.05, 0.14, 8e-4, 8.0,
                                     0.0,   0.0, 10.0, 0.25, 0.0,  0.0,  0.5,  0.0};
const std::vector<std::size_t> upper_groups{0, 1, 2, 3, 4};

SimulationRecord chirp_record(std::size_t n, double noise_deg, std::uint64_t seed,
                              const FirstPrincipleGroups& p = truth, double offset = 0.15, double amplitude = 0.2) {
  SimulationRecord record;
  record.dt_s = 1e-3;
  record.start = {8.5, 0.0, 0.0};
  const double span_s = 1e-3 * static_cast<double>(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double t = 1e-3 * static_cast<double>(k);
    const double phase = 2.0 * std::numbers::pi * (0.2 * t + 0.5 * 5.8 / span_s * t * t);
    record.input.push_back(offset + amplitude * std::sin(phase));
  }
  record.output = free_run(FirstPrinciple{}, {p.begin(), p.end()}, record.start, record.input, record.dt_s);
  for (std::size_t k = 0; k < n; ++k)
    record.output[k] += noise_deg * random::normal(seed, 0, k);
  return record;
}

TEST(ThrottleGroups, SensitivityVanishesWhileThePlateSticks) {
  using D = Dual<FirstPrinciple::n_parameters>;
  FirstPrinciple::Groups<D> p;
  for (std::size_t i = 0; i < p.size(); ++i)
    p[i] = D::seeded(truth[i], static_cast<int>(i));
  const auto model = FirstPrinciple{}.prepare<D>(p, 1e-3);
  auto state = model.at_rest(D(40.0));
  model.step(state, D(0.15));
  EXPECT_EQ(model.output(state), D(40.0));
  EXPECT_EQ(state.speed_deg_per_s, D(0.0));
}

// The record comes from steps ten times as fine as those of the fit.
TEST(ThrottleGroups, TheLagIsMetWithinFivePercentAtFourStepsPerSample) {
  for (const double lag_s : {3e-4, 8e-4, 2e-3}) {
    auto plant = truth;
    plant[8] = lag_s;
    FirstPrinciple fine, coarse;
    fine.substeps = 40;
    coarse.substeps = 4;
    SimulationRecord record = chirp_record(6000, 0.0, 0, plant);
    record.output = free_run(fine, {plant.begin(), plant.end()}, record.start, record.input, record.dt_s);
    for (std::size_t k = 0; k < record.output.size(); ++k)
      record.output[k] += 0.03 * random::normal(3, 0, k);
    auto begin = truth;
    begin[8] = 1e-3;
    const auto fit = fit_first_principle(coarse, {record}, {{{0, 1, 2, 3, 4, 8}, {}, 1.0, {}}}, {begin}, 1);
    EXPECT_NEAR(fit.values[8], lag_s, 0.05 * lag_s);
    EXPECT_NEAR(fit.values[1] / truth[1], 1.0, 0.01);
  }
}

TEST(ThrottleGroups, StartAngleAndSpeedAreUnknownsByName) {
  SimulationRecord record = chirp_record(4000, 0.0, 0);
  record.start = {8.5, 40.0, 0.0};
  record.output = free_run(FirstPrinciple{}, {truth.begin(), truth.end()}, record.start, record.input, record.dt_s);
  record.start = {8.4, 0.0, 0.0};
  record.free_start = {0, 1};
  const auto fit = fit_first_principle({}, {record}, {{upper_groups, {}, 1.0, {}}}, {truth}, 1);
  const optimize::FitReport& report = fit.starts.reports[0];
  ASSERT_EQ(report.names.size(), 7U);
  EXPECT_EQ(report.names[5], "start_angle_deg");
  EXPECT_EQ(report.names[6], "start_speed_deg_per_s");
  EXPECT_NEAR(report.values[5], 8.5, 1e-4);
  EXPECT_NEAR(report.values[6], 40.0, 0.1);
}

TEST(ThrottleGroups, StagesAndThreadsReachTheSameBest) {
  const std::vector<SimulationRecord> records{chirp_record(4000, 0.03, 1), chirp_record(4000, 0.03, 2)};
  const std::vector<FitStage> stages{{{0, 1}, {0}, 0.5, {}}, {{2, 3, 4}, {0}, 1.0, {}}, {upper_groups, {}, 1.0, {}}};
  auto other = start;
  other[4] = 0.08;
  const auto one = fit_first_principle({}, records, stages, {start, other}, 1);
  const auto two = fit_first_principle({}, records, stages, {start, other}, 2);
  EXPECT_EQ(one.values, two.values);
  EXPECT_EQ(one.starts.n_reached, two.starts.n_reached);
  EXPECT_NEAR(one.starts.reports[one.starts.best].rmse, 0.03, 0.002);
}

}  // namespace
}  // namespace mgdd::identify
