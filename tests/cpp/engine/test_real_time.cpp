// What a control loop relies on: run and indicators neither throw nor allocate, in every variant.
#include <gtest/gtest.h>

#include "support/engine_case.hpp"
#include "support/no_alloc.hpp"

namespace mgdd::engine {
namespace {

using test_support::AllocationCounter;
using test_support::EngineCase;

using Model = CycleModel<double>;
using DualModel = CycleModel<Dual<4>>;
template <class M, class T>
constexpr bool cannot_throw = noexcept(std::declval<const M&>().run(std::declval<const Charge<T>&>(), T(0.0),
                                                                    std::declval<CycleWorkspace<T>&>())) &&
                              noexcept(std::declval<const M&>().indicators(std::declval<const Charge<T>&>(), T(0.0),
                                                                           std::declval<const CycleWorkspace<T>&>())) &&
                              noexcept(std::declval<M&>().set_cylinder(std::declval<const BasicCylinder<T>&>())) &&
                              noexcept(std::declval<const M&>().charge(std::declval<const BasicOperatingPoint<T>&>()));
static_assert(cannot_throw<Model, double>);
static_assert(cannot_throw<DualModel, Dual<4>>);
static_assert(noexcept(std::declval<const Burn<double>&>().fraction(0.0)));
static_assert(noexcept(std::declval<const Burn<double>&>().angle_of(0.5)));
static_assert(noexcept(std::declval<const Geometry<double>&>().volume_m3(0.0)));

template <class T>
std::size_t allocations(const EngineCase& c) {
  CycleModel<T> model(lift<T>(c.cylinder), crank_grid(c.cylinder), c.integrator);
  CycleWorkspace<T> work = model.make_workspace();
  const BasicOperatingPoint<T> point = lift<T>(c.point);
  BasicCylinder<T> other = model.cylinder();
  other.gas.gamma = other.gas.gamma + 0.01;
  other.geometry.bore_mm = other.geometry.bore_mm + 1.0;
  const AllocationCounter counter;
  for (int i = 0; i < 3; ++i) {
    model.set_cylinder(other);
    const Charge<T> charge = model.charge(point);
    model.run(charge, T(-6.0 + i), work);
    const Indicators<T> out = model.indicators(charge, T(-6.0 + i), work);
    static_cast<void>(out);
  }
  return counter.count();
}

TEST(EngineRealTime, NothingIsAllocatedInAnyVariant) {
  int variants = 0;
  for (const auto integrator :
       {Integrator::trapezoid, Integrator::split, Integrator::tan2018_lagged, Integrator::euler}) {
    for (const auto gamma : {GammaModel::constant, GammaModel::linear, GammaModel::polynomial}) {
      for (const auto wall : {WallHeatModel::woschni, WallHeatModel::hohenberg, WallHeatModel::eichelberg}) {
        for (const auto burn : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
          for (const double fuel : {0.0, 20.0}) {
            EngineCase c;
            c.integrator = integrator;
            c.cylinder.gas.gamma_model = gamma;
            c.cylinder.wall_heat.wall_heat_model = wall;
            c.cylinder.burn.burn_shape = burn;
            c.point.fuel_mg = fuel;
            EXPECT_EQ(allocations<double>(c), 0u) << name_of(integrator) << " " << name_of(burn);
            EXPECT_EQ(allocations<Dual<4>>(c), 0u) << name_of(integrator) << " " << name_of(burn);
            ++variants;
          }
        }
      }
    }
  }
  EXPECT_EQ(variants, 216);
}

}  // namespace
}  // namespace mgdd::engine
