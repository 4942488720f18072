// Numbers of the engine: what a user gets who says nothing, and gamma in every model that uses it.
#include <gtest/gtest.h>

#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/ignition.hpp"

namespace mgdd::engine {
namespace {

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// --- what is allowed ------------------------------------------------------------------------------------------

TEST(EngineNumbers, GammaStaysAboveOneInEveryModelThatUsesIt) {
  Cylinder c;
  c.gas.gamma_model = GammaModel::polynomial;
  EXPECT_EQ(refusal([&] { validate(c); }), "");
  c.gas.gamma_polynomial_c1_per_k = -2e-4;
  EXPECT_NE(refusal([&] { validate(c); }).find("gamma_polynomial_c1_per_k = -0.0002"), std::string::npos);
  c.gas.gamma_model = GammaModel::linear;
  EXPECT_EQ(refusal([&] { validate(c); }), "") << "the polynomial is not in use";
  c.gas.gamma_linear_slope_per_k = 1e-4;
  EXPECT_EQ(refusal([&] { validate(c); }), "") << "it may rise";
  c.gas.gamma_linear_300k = 1.004;
  EXPECT_NE(refusal([&] { validate(c); }).find("is 0.999 at 250 K"), std::string::npos) << "the cold end counts";
}

}  // namespace
}  // namespace mgdd::engine
