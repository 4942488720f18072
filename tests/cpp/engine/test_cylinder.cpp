// Parameter records on another scalar; tests/python/test_bad_input_engine.py has the bounds of every field.
#include "mgdd/engine/cylinder.hpp"

#include <gtest/gtest.h>

namespace mgdd::engine {
namespace {

TEST(EngineCylinder, LiftKeepsEveryFieldAndAddsNoDerivative) {
  Cylinder c;
  c.burn.burn_shape = BurnShape::double_wiebe;
  c.wall_heat.wall_heat_model = WallHeatModel::hohenberg;
  c.gas.gamma_model = GammaModel::polynomial;
  c.ignition.ignition_model = IgnitionModel::wolfer;
  double value = 1.25;
  for (const auto& field : cylinder_fields<double>()) {
    field.in(c) = value *= 1.01;
  }
  const auto lifted = lift<Dual<4>>(c);
  constexpr auto fields = cylinder_fields<double>();
  constexpr auto duals = cylinder_fields<Dual<4>>();
  for (std::size_t i = 0; i < fields.size(); ++i) {
    EXPECT_EQ(duals[i].in(lifted), Dual<4>(fields[i].in(c))) << fields[i].info.name;
  }
  EXPECT_EQ(lift<double>(c), c);
}

}  // namespace
}  // namespace mgdd::engine
