// One closed engine cycle, IVC to EVO: the discrete event model of Tan 2018, chapter 2, on any crank grid.
// `CycleModel` is constant after construction (tables of one cylinder on one grid); `run` and `indicators` are noexcept
// and allocation-free on a workspace sized once, so that they may stand in a control loop.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "mgdd/common/units.hpp"
#include "mgdd/engine/burn.hpp"
#include "mgdd/engine/charge.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/engine/geometry.hpp"
#include "mgdd/engine/indicators.hpp"
#include "mgdd/math/dual.hpp"

namespace mgdd::engine {

inline constexpr double default_step_cad = 1.0;
inline constexpr double step_lower_cad = 0.001;
inline constexpr double step_upper_cad = 5.0;

/// Crank angles from IVC to EVO in equal steps; the last one is shortened. ParameterError for a step outside
/// [0.001, 5] CAD.
std::vector<double> crank_grid(const Cylinder& cylinder, double step_cad = default_step_cad);

/// All checks before a cycle: both records, the timing, p(IVC) > 0, a burn that starts after IVC. ParameterError.
void validate_cycle(const Cylinder& cylinder, const OperatingPoint& point, double soc_cad);

/// Traces of one cycle, one entry per grid angle. Entry k of the per-step columns belongs to the step k -> k + 1.
template <class T>
struct CycleWorkspace {
  std::vector<T> pressure_pa;
  std::vector<T> heat_release_j;
  std::vector<T> heat_loss_j;
  std::vector<T> gamma;  ///< of the step; filled only where gamma depends on temperature

  explicit CycleWorkspace(std::size_t n) : pressure_pa(n), heat_release_j(n), heat_loss_j(n), gamma(n) {}
};

/// What the operating point fixes for a whole cycle, in SI.
template <class T>
struct Charge {
  T pressure_pa{};  ///< at IVC
  T intake_pa{};
  T gas_j_per_k{};  ///< amount times R: p V = gas_j_per_k T
  T fuel_heat_j{};
  T burn_duration_cad{};
  T speed_rpm{};
};

/// Trapped amount by `simulated_gas_j_per_k`; p(IVC) = p_in + rise.
template <class T>
Charge<T> charge_of(const BasicCylinder<T>& cylinder, const Geometry<T>& geometry,
                    const BasicOperatingPoint<T>& point) noexcept {
  Charge<T> c;
  c.intake_pa = point.intake_pressure_kpa * units::pa_per_kpa;
  c.pressure_pa = c.intake_pa + cylinder.gas.ivc_pressure_rise_kpa * units::pa_per_kpa;
  c.gas_j_per_k = simulated_gas_j_per_k(cylinder, geometry, point, c.intake_pa, c.pressure_pa);
  c.fuel_heat_j = fuel_heat_j(cylinder.gas, point);
  c.burn_duration_cad = burn_duration_cad(cylinder.burn, point);
  c.speed_rpm = point.speed_rpm;
  return c;
}

template <class T>
class CycleModel {
 public:
  /// `angles_cad` must be strictly increasing (checked: ShapeError, DataError) with at least three entries.
  CycleModel(const BasicCylinder<T>& cylinder, std::vector<double> angles_cad,
             Integrator integrator = Integrator::trapezoid);

  /// Other parameters on the same grid, without allocating; the tables are rebuilt only where geometry, gamma or the
  /// wall-heat law changed. IVC and EVO do not move the grid.
  void set_cylinder(const BasicCylinder<T>& cylinder) noexcept;

  Charge<T> charge(const BasicOperatingPoint<T>& point) const noexcept {
    return charge_of(cylinder_, geometry_, point);
  }

  /// Integrates one cycle into the workspace.
  void run(const Charge<T>& charge, const T& soc_cad, CycleWorkspace<T>& work) const noexcept;

  /// Index of the first pressure that is not finite and positive; the number of angles if there is none.
  std::size_t first_unphysical(const CycleWorkspace<T>& work) const noexcept;

  /// For offline callers: ConvergenceError naming the angle where the pressure leaves the physical range.
  void require_physical(const CycleWorkspace<T>& work) const;

  /// Scalars of the cycle that stands in the workspace.
  Indicators<T> indicators(const Charge<T>& charge, const T& soc_cad, const CycleWorkspace<T>& work) const noexcept;

  /// Wall heat per step of a given pressure trace on this grid [J], by the same law; Woschni's combustion term acts
  /// from `burning_from_cad` on. Sizes: one pressure and one loss per angle.
  void wall_heat(const Charge<T>& charge, std::span<const T> pressure_pa, double burning_from_cad,
                 std::span<T> loss_j) const noexcept;

  /// Work that the integrator books in step k -> k + 1 [J]; equals the trapezoid of p dV only where that is the scheme.
  T booked_work_j(std::size_t k, const CycleWorkspace<T>& work) const noexcept;

  /// Change of internal energy in step k -> k + 1 [J], at the gamma of the step.
  T energy_change_j(std::size_t k, const CycleWorkspace<T>& work) const noexcept;

  CycleWorkspace<T> make_workspace() const { return CycleWorkspace<T>(angles_.size()); }
  std::span<const double> angles_cad() const noexcept { return angles_; }
  std::span<const T> volume_m3() const noexcept { return volume_; }
  std::span<const T> motored_ratio() const noexcept { return motored_ratio_; }
  std::span<const T> wall_term() const noexcept { return wall_term_; }  ///< see `WallHeat::volume_term`
  /// p1 = keep p0 + gain dQ in each step; for constant gamma only.
  std::span<const T> keep() const noexcept { return keep_; }
  std::span<const T> gain() const noexcept { return gain_; }
  const BasicCylinder<T>& cylinder() const noexcept { return cylinder_; }
  const Geometry<T>& geometry() const noexcept { return geometry_; }

 private:
  struct StepCoefficients {
    T keep, gain;  // p1 = keep p0 + gain dQ: every scheme is linear in p0 and dQ once gamma is fixed
  };
  void tabulate() noexcept;
  StepCoefficients coefficients(const T& gamma, std::size_t k) const noexcept;
  T step_gamma(std::size_t k, const CycleWorkspace<T>& work) const noexcept;
  T volume_before(std::size_t k) const noexcept;
  std::size_t fill_heat_release(const Charge<T>& charge, const T& soc_cad, CycleWorkspace<T>& work) const noexcept;
  template <bool ConstantGamma, WallHeatModel Model>
  void integrate(const Charge<T>& charge, std::size_t first_burning, CycleWorkspace<T>& work) const noexcept;

  BasicCylinder<T> cylinder_;
  Geometry<T> geometry_;
  Integrator integrator_;
  std::vector<double> angles_;
  std::vector<T> volume_, wall_term_, motored_ratio_;
  std::vector<T> keep_, gain_;  // constant gamma only
  T volume_before_first_;
};

extern template class CycleModel<double>;
extern template class CycleModel<Dual<4>>;
extern template class CycleModel<Dual<8>>;

}  // namespace mgdd::engine
