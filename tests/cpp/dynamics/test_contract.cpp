// Every model of the library on every scalar of the contract: the same run on double, float, duals and lanes, whole and
// fractional delays, saved and restored states.
#include <bit>
#include <span>
#include <type_traits>

#include "mgdd/common/state.hpp"
#include "mgdd/dynamics/observer.hpp"
#include "mgdd/dynamics/simulate.hpp"
#include "mgdd/throttle/models/first_principle.hpp"
#include "mgdd/throttle/models/pseudo_wiener.hpp"
#include "mgdd/throttle/plant.hpp"
#include "support/no_alloc.hpp"
#include "support/test.hpp"
#include "support/throttle_records.hpp"

namespace mgdd::dynamics {
namespace {

constexpr std::size_t samples = 300;

std::vector<double> inputs(double offset, double amplitude) {
  std::vector<double> u(samples);
  for (std::size_t k = 0; k < samples; ++k)
    u[k] = offset + amplitude * std::sin(0.05 * static_cast<double>(k) + 1e-4 * static_cast<double>(k * k));
  return u;
}

template <class M>
std::vector<typename M::Scalar> outputs(const M& model, typename M::State state, const std::vector<double>& u) {
  std::vector<typename M::Scalar> y(u.size(), typename M::Scalar(0.0));
  const test_support::AllocationCounter counter;
  simulate(model, state, std::span<const double>(u), std::span<typename M::Scalar>(y));
  EXPECT_EQ(counter.count(), 0U);
  return y;
}

/// `make(T)` gives a model and a state on that scalar.
template <class Make>
void expect_one_law(Make make, const std::vector<double>& u, double float_tolerance) {
  const auto run = [&]<class T>(T) {
    const auto [model, state] = make(T(0.0));
    static_assert(DiscreteModel<std::remove_cvref_t<decltype(model)>>);
    return outputs(model, state, u);
  };
  const std::vector<double> plain = run(double{});
  const auto narrow = run(float{});
  const auto dual = run(Dual<3>{});
  const auto wide = run(Lanes<8>(0.0));
  double spread = 0.0;
  for (std::size_t k = 0; k < u.size(); ++k) {
    spread = std::max(spread, std::abs(plain[k] - plain[0]));
    ASSERT_NEAR(static_cast<double>(narrow[k]), plain[k], float_tolerance) << k;
    ASSERT_NEAR(dual[k].value, plain[k], 1e-10 * (1.0 + std::abs(plain[k]))) << k;
    for (int lane = 0; lane < 8; ++lane)
      ASSERT_EQ(wide[k][lane], plain[k]) << k;
  }
  EXPECT_GT(spread, 0.0);
}

template <class F, std::size_t n, std::size_t n_start>
auto from_family(const F& family, const std::array<double, n>& numbers, const std::array<double, n_start>& stated,
                 double sample_s) {
  return [=]<class T>(T) {
    std::array<T, n> p{};
    std::array<T, n_start> s{};
    for (std::size_t i = 0; i < n; ++i)
      p[i] = T(numbers[i]);
    for (std::size_t i = 0; i < n_start; ++i)
      s[i] = T(stated[i]);
    const auto model = family.template prepare<T>(p, sample_s);
    return std::pair(model, family.template start<T>(model, s));
  };
}

template <class P>
std::array<double, static_cast<std::size_t>(throttle::PseudoWienerFamily<P>::n_parameters)> values_of(const P& p) {
  std::array<double, static_cast<std::size_t>(throttle::PseudoWienerFamily<P>::n_parameters)> out{};
  const auto places = throttle::numbers(p);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = *places[i];
  return out;
}

TEST(ModelContract, ThrottleModelsOnEveryScalar) {
  using namespace throttle;
  const auto u = inputs(0.15, 0.3);
  for (const double delay : {0.0, 2.0, 1.75}) {
    for (const auto friction : {Friction::coulomb, Friction::tanh}) {
      FirstPrinciple groups;
      groups.friction = friction;
      Throttle t;
      t.preload_below_nm = 0.5;
      auto numbers = first_principle_of(t);
      numbers[12] = delay;
      for (const bool bends : {false, true}) {
        numbers[9] = bends ? 0.3 : 0.0;  // drop, presliding and gap
        numbers[13] = bends ? 0.15 : 0.0;
        numbers[15] = bends ? 0.25 : 0.0;
        expect_one_law(from_family(groups, numbers, std::array{20.0, 0.0, 0.0}, 1e-3), u, 2e-2);
      }
      PwR r = pw_r_of(t);
      r.frame.delay_samples = delay;
      r.friction = friction;
      expect_one_law(from_family(PseudoWienerFamily<PwR>{r}, values_of(r), std::array{20.0}, 1e-3), u, 2e-2);
    }
    PwW w;
    w.rise_deg.fill(12.0);
    w.frame.delay_samples = delay;
    expect_one_law(from_family(PseudoWienerFamily<PwW>{w}, values_of(w), std::array{20.0}, 1e-3), u, 1e-3);
    PwP p;
    p.radius_duty[0] = 0.05;
    p.gain_deg_per_duty[0] = 150.0;
    p.frame.delay_samples = delay;
    expect_one_law(from_family(PseudoWienerFamily<PwP>{p}, values_of(p), std::array{20.0}, 1e-3), u, 1e-3);
  }
}

template <class T>
throttle::PlantCoefficients<T> coefficients_over(const throttle::PlantCoefficients<double>& coefficients) {
  constexpr std::size_t n = throttle::n_plant_coefficients;
  std::array<T, n> columns{};
  std::ranges::transform(std::bit_cast<std::array<double, n>>(coefficients), columns.begin(),
                         [](double x) { return T(x); });
  return std::bit_cast<throttle::PlantCoefficients<T>>(columns);
}

TEST(ModelContract, ThePlantOnEveryScalarWithEveryOption) {
  using namespace throttle;
  const auto u = inputs(0.15, 0.4);
  for (const auto friction : {Friction::coulomb, Friction::stiction, Friction::stribeck, Friction::karnopp,
                              Friction::tanh, Friction::lugre}) {
    for (const auto backlash : {Backlash::none, Backlash::compliance, Backlash::hysteresis}) {
      Throttle t;
      t.friction = friction;
      t.backlash = backlash;
      t.stiction_nm = 0.31;
      t.pressure_drop_kpa = 3.0;
      const auto make = [&]<class T>(T) {
        const BasicThrottlePlant<T> plant(coefficients_over<T>(plant_coefficients(t, 1e-4)), t, 1e-4);
        return std::pair(Repeated<BasicThrottlePlant<T>>{plant, 10}, plant.at_rest(T(20.0)));
      };
      expect_one_law([&]<class T>(T zero) { return make(zero); }, u, 0.3);
    }
  }
}

TEST(ModelContract, NumbersCarryTheWholeState) {
  using namespace throttle;
  PwR p;
  p.frame.delay_samples = 2.5;
  const PwRModel model(p);
  auto state = model.at_rest(30.0, 0.2);
  for (int k = 0; k < 20; ++k)
    model.step(state, 0.3);
  auto copy = lifted<PwRModel>(state);
  auto narrow = lifted<BasicPwRModel<float>>(state);
  for (int k = 0; k < 20; ++k) {
    model.step(state, 0.1);
    model.step(copy, 0.1);
    BasicPwRModel<float>(lift<float>(p)).step(narrow, 0.1F);
  }
  EXPECT_EQ(model.output(copy), model.output(state));
  EXPECT_NEAR(static_cast<double>(BasicPwRModel<float>(lift<float>(p)).output(narrow)), model.output(state), 1e-3);
}

/// PW-R, but on one scalar it gives no model.
template <class Missing>
struct LacksOne {
  using Whole = throttle::PseudoWienerFamily<throttle::PwR>;
  static constexpr int n_parameters = Whole::n_parameters;

  template <class T>
  auto prepare(const Values<T, n_parameters>& values, double sample_s) const noexcept {
    if constexpr (std::is_same_v<T, Missing>) {
      return 0;
    } else {
      return Whole{}.prepare(values, sample_s);
    }
  }
};

TEST(Contract, AScalarThatIsLeftOutIsSeen) {
  EXPECT_TRUE((on_every_scalar<LacksOne<void>>));
  EXPECT_FALSE((on_every_scalar<LacksOne<double>>));
  EXPECT_FALSE((on_every_scalar<LacksOne<float>>));
  EXPECT_FALSE((on_every_scalar<LacksOne<Dual<3>>>));
  EXPECT_FALSE((on_every_scalar<LacksOne<Dual<3, float>>>));
  EXPECT_FALSE((on_every_scalar<LacksOne<Lanes<8>>>));
}

TEST(Contract, ARequirementThatIsNotMetIsSeen) {
  EXPECT_TRUE(StartsAtRest<throttle::PwRModel>);
  EXPECT_FALSE(DiscreteModel<double>);
}

}  // namespace
}  // namespace mgdd::dynamics
