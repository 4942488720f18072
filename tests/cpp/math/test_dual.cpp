// Dual numbers against derivatives known in closed form.
#include "mgdd/math/dual.hpp"

#include "support/test.hpp"

namespace mgdd {
namespace {

using D = Dual<2>;

void expect(const D& d, double value, double by_x, double by_y) {
  EXPECT_NEAR(d.value, value, 1e-14 * (1.0 + std::abs(value)));
  EXPECT_NEAR(d.grad[0], by_x, 1e-14 * (1.0 + std::abs(by_x)));
  EXPECT_NEAR(d.grad[1], by_y, 1e-14 * (1.0 + std::abs(by_y)));
}

TEST(CommonDual, ArithmeticHasItsDerivatives) {
  const double a = 1.7, b = -0.6;
  const D x = D::seeded(a, 0), y = D::seeded(b, 1);
  expect(x + y, a + b, 1, 1);
  expect(x - y, a - b, 1, -1);
  expect(x * y, a * b, b, a);
  expect(x / y, a / b, 1 / b, -a / (b * b));
  expect(-x, -a, -1, 0);
  expect(2.0 + x, 2 + a, 1, 0);
  expect(x + 2.0, 2 + a, 1, 0);
  expect(2.0 - x, 2 - a, -1, 0);
  expect(x - 2.0, a - 2, 1, 0);
  expect(2.0 * x, 2 * a, 2, 0);
  expect(x / 4.0, a / 4, 0.25, 0);
  expect(3.0 / x, 3 / a, -3 / (a * a), 0);
  D z = x;
  z *= z;  // aliasing
  expect(z, a * a, 2 * a, 0);
  z = x;
  const D& same = z;  // compilers warn of z /= z
  z /= same;
  expect(z, 1, 0, 0);
}

TEST(CommonDual, FunctionsHaveTheirDerivatives) {
  const double a = 1.7;
  const D x = D::seeded(a, 0), y = D::seeded(0.8, 1);
  expect(sqrt(x), std::sqrt(a), 0.5 / std::sqrt(a), 0);
  expect(exp(x), std::exp(a), std::exp(a), 0);
  expect(log(x), std::log(a), 1 / a, 0);
  expect(pow(x, 2.5), std::pow(a, 2.5), 2.5 * std::pow(a, 1.5), 0);
  expect(pow(x, y), std::pow(a, 0.8), 0.8 * std::pow(a, -0.2), std::pow(a, 0.8) * std::log(a));
  const D zero = D::seeded(0.0, 0);
  expect(pow(zero, D::seeded(1.5, 1)), 0, 0, 0);
  expect(pow(zero, 1.0), 0, 1, 0);
}

TEST(CommonDual, ComparesByValueAndIsEqualInAll) {
  const D x = D::seeded(1.0, 0), same_value(1.0);
  EXPECT_TRUE(x <= same_value && x >= same_value && !(x < same_value) && !(x > same_value));
  EXPECT_FALSE(x == same_value);
  EXPECT_EQ(value_of(x), 1.0);
  EXPECT_EQ(value_of(1.0), 1.0);
  static_assert(is_dual_v<D> && !is_dual_v<double>);
}

}  // namespace
}  // namespace mgdd
