// Single samples from plain numbers: the runs of the same models, and what is refused.
#include "mgdd/throttle/stepper.hpp"

#include <span>

#include "mgdd/common/error.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/pseudo_wiener_numbers.hpp"
#include "mgdd/throttle/simulation.hpp"
#include "support/asymmetric_pseudo_wiener.hpp"
#include "support/asymmetric_throttle.hpp"
#include "support/test.hpp"

namespace mgdd::throttle {
namespace {

std::vector<double> steps_of_duty() {
  std::vector<double> duty;
  for (int k = 0; k < 80; ++k)
    duty.push_back(k < 30 ? 0.5 : k < 55 ? -0.35 : 0.1);
  return duty;
}

TEST(ThrottleStepper, WalksAlongTheRun) {
  const Throttle t = test::asymmetric_throttle();
  const auto duty = steps_of_duty();
  std::vector<double> angle(duty.size()), speed(duty.size()), current(duty.size());
  ThrottleState run = at_rest(17.0);
  simulate(ThrottlePlant(t, 1e-4), {.duty = duty}, 20, run, {angle, speed, current});
  const ThrottleStepper stepper(t, 2e-3, 1e-4);
  auto state = ThrottleStepper::at_rest(17.0);
  for (std::size_t k = 0; k < duty.size(); ++k) {
    ASSERT_NEAR(state[0], angle[k], 1e-9) << k;
    ASSERT_NEAR(state[1], speed[k], 1e-6) << k;
    ASSERT_NEAR(state[2], current[k], 1e-9) << k;
    state = stepper.advance(state, duty[k]);
  }
  EXPECT_GT(angle[29] - angle[0], 10.0) << "it moved";
}

TEST(ThrottleStepper, RefusesWhatIsNotFinite) {
  const ThrottleStepper stepper(test::asymmetric_throttle(), 2e-3, 1e-4);
  const auto rest = ThrottleStepper::at_rest(17.0);
  for (std::size_t i = 0; i < rest.size(); ++i) {
    auto bad = rest;
    bad[i] = std::numeric_limits<double>::infinity();
    EXPECT_THROW(stepper.advance(bad, 0.1), DataError) << i;
  }
  EXPECT_THROW(stepper.advance(rest, std::nan("")), DataError);
  EXPECT_THROW(ThrottleStepper(test::asymmetric_throttle(), 2e-3, 3e-4), ParameterError);
}

template <class P>
void expect_walk(const P& p) {
  const auto model = model_of(p);
  const auto duty = steps_of_duty();
  std::vector<double> angle(duty.size());
  auto run = model.at_rest(17.0, 0.0);
  dynamics::simulate(model, run, std::span<const double>(duty), std::span<double>(angle));
  const PseudoWienerStepper stepper(p);
  auto state = stepper.at_rest(17.0);
  for (std::size_t k = 0; k < duty.size(); ++k) {
    ASSERT_EQ(stepper.output(state), angle[k]) << k;
    state = stepper.advance(state, duty[k]);
  }
  auto longer = state;
  longer.push_back(0.0);
  EXPECT_THROW(stepper.advance(longer, 0.0), ShapeError);
  EXPECT_THROW(static_cast<void>(stepper.output(longer)), ShapeError);
  state.front() = std::nan("");
  EXPECT_THROW(stepper.advance(state, 0.0), DataError);
}

TEST(PseudoWienerStepper, WalksAlongTheRunOfEveryKind) {
  expect_walk(test::asymmetric_pw_r());
  expect_walk(test::asymmetric_pw_w());
  expect_walk(test::asymmetric_pw_p());
}

// --- plain numbers by name ------------------------------------------------------------------------------------

template <class P>
void expect_round_trip(const P& p, std::string_view kind, std::size_t expected) {
  std::map<std::string, double> given;
  for (const NamedNumber& number : named_numbers(p))
    given.emplace(number.name, number.value);
  EXPECT_EQ(given.size(), expected) << kind;
  EXPECT_EQ(pseudo_wiener_from(kind, given), PseudoWiener(p)) << kind;
  EXPECT_NE(pseudo_wiener_from(kind, {}), PseudoWiener(p)) << kind;
}

TEST(PseudoWienerNumbers, SayEverythingOfAModel) {
  expect_round_trip(test::asymmetric_pw_r(), "pw_r", 15 + 8);
  PwW w = test::asymmetric_pw_w();
  w.frame.substeps = PwW{}.frame.substeps;  // PW-W and PW-P are exact for a held duty: they have no substeps
  w.lag_start = LagStart::inverse_map;
  expect_round_trip(w, "pw_w", 10 + 7);
  PwP play = test::asymmetric_pw_p();
  play.frame.substeps = PwP{}.frame.substeps;
  expect_round_trip(play, "pw_p", 3 + 2 * 3 + 1 + 6);
  EXPECT_EQ(named_numbers(PseudoWienerKind::pw_p).size(), 20U + 6U);
  PwR tanh = test::asymmetric_pw_r();
  tanh.friction = Friction::tanh;
  tanh.switching = Switching::measured;
  std::map<std::string, double> given;
  for (const NamedNumber& number : named_numbers(tanh))
    given.emplace(number.name, number.value);
  EXPECT_EQ(pseudo_wiener_from("pw_r", given, "measured", "tanh"), PseudoWiener(tanh));
}

TEST(PseudoWienerNumbers, RefuseWhatAKindDoesNotHave) {
  const auto refused = [](std::string_view kind, const char* name, double value) {
    try {
      pseudo_wiener_from(kind, {{name, value}});
    } catch (const ParameterError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refused("pw_r", "plays", 2.0), "parameters: 'plays' is not a parameter of pw_r");
  EXPECT_EQ(refused("pw_w", "substeps", 2.0), "parameters: 'substeps' is not a parameter of pw_w");
  EXPECT_EQ(refused("pw_p", "plays", 2.5), "plays = 2.5: must be a whole number");
  EXPECT_EQ(refused("pw_r", "substeps", -1.0), "substeps = -1: must be a whole number");
  EXPECT_EQ(refused("pw_w", "map_start", 2.0), "map_start = 2: must be 0 or 1");
  EXPECT_EQ(refused("pw_q", "plays", 2.0), "kind = 'pw_q': must be one of pw_r, pw_w, pw_p");
  EXPECT_EQ(refused("pw_r", "sample_s", 1.0).rfind("sample_s = 1 s: must be ", 0), 0U);
}

}  // namespace
}  // namespace mgdd::throttle
