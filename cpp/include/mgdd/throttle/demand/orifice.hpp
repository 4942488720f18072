// Flow of air through an orifice [kg/s], isentropic to its throat: choked below the critical pressure ratio, straight
// to zero near equal pressures, reversed beyond them. SI. noexcept, heap-free.
// Equations: Heywood 1988, appendix C, with gamma = 1.4. The straight part is ours: the slope stays finite, so that the
// flow can be inverted and a manifold integrated.
#pragma once

namespace mgdd::throttle {

inline constexpr double critical_ratio = 0.5282817877171742;  ///< (5/6)^3.5
inline constexpr double choked_flow = 0.6847314563772705;     ///< sqrt(1.4) (5/6)^3
inline constexpr double straight_from_ratio = 0.98;

/// Psi in m = A p/sqrt(R T) Psi(r), r the downstream over the upstream pressure in [0, 1], and its slope.
struct FlowFunction {
  double value, slope;
};
FlowFunction flow_function(double ratio) noexcept;

/// The same times 1 - pressure_loss r, by which the discharge coefficient falls with the ratio.
FlowFunction flow_function(double ratio, double pressure_loss) noexcept;

struct GasState {
  double pressure_pa, temperature_k;
};
/// Mass flow, positive from upstream, and its derivative by the downstream pressure, which is never positive.
struct OrificeFlow {
  double kg_per_s, per_downstream_pa;
};
/// Through an opening of area times discharge coefficient.
OrificeFlow orifice_flow(double effective_m2, const GasState& upstream, const GasState& downstream,
                         double pressure_loss = 0.0) noexcept;

/// p/sqrt(R T): flow per area and Psi [kg/(m² s)].
double flow_per_area(const GasState& upstream) noexcept;

}  // namespace mgdd::throttle
