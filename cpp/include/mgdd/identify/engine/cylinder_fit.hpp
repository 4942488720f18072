// Calibration of the cycle model to measured pressure traces: per load the burn (start, duration, heat, shape), for all
// loads together the cylinder (wall heat and whatever else is freed). Residual: (model - measured)/p_max per trace.
// Angles °CA aTDC, pressure bar, heat J. Desk-time code; the search itself allocates nothing.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::identify {

/// One measured closed cycle with its conditions. The first sample is p(IVC); the trapped amount is the point's mass,
/// or eta_V p(IVC) V_s/(R T_in). Fuel and intake pressure of `point` are not used.
struct MeasuredCycle {
  std::string label;
  std::vector<double> angle_cad;
  std::vector<double> pressure_bar;
  engine::OperatingPoint point;
};

/// Burn of one load: what may be freed per trace. Shape fields act for the shapes that have them.
template <class T>
struct BasicLoadBurn {
  T soc_cad{-5.0};
  T burn_duration_cad{50.0};
  T fuel_heat_j{1000.0};
  T wiebe_m{1.5};
  T second_fraction{0.6};
  T second_delay_cad{3.0};
  T second_duration_cad{50.0};
  T second_wiebe_m{0.8};

  bool operator==(const BasicLoadBurn&) const = default;
};
using LoadBurn = BasicLoadBurn<double>;

/// Search domain of a parameter: bounds, and whether it is searched as a logarithm.
struct SearchDomain {
  std::string_view name, unit;
  double lower, upper;
  bool log_scaled;
};

template <class T>
struct LoadField {
  SearchDomain domain;
  T BasicLoadBurn<T>::* member;
};

template <class T>
constexpr auto load_fields() {
  using B = BasicLoadBurn<T>;
  using F = LoadField<T>;
  return std::array{F{{"soc_cad", "°CA aTDC", -30.0, engine::timing_upper_cad, false}, &B::soc_cad},
                    F{{"burn_duration_cad", "°CA", 2.0, 150.0, true}, &B::burn_duration_cad},
                    F{{"fuel_heat_j", "J", 1e-2, 1e6, true}, &B::fuel_heat_j},
                    F{{"wiebe_m", "-", 0.0, 5.0, false}, &B::wiebe_m},
                    F{{"second_fraction", "-", 0.0, 1.0, false}, &B::second_fraction},
                    F{{"second_delay_cad", "°CA", 0.0, 40.0, false}, &B::second_delay_cad},
                    F{{"second_duration_cad", "°CA", 5.0, 150.0, true}, &B::second_duration_cad},
                    F{{"second_wiebe_m", "-", 0.0, 5.0, false}, &B::second_wiebe_m}};
}

inline constexpr double wall_heat_scale_upper = 2.5;  ///< search bound offline, in textbook laws

struct CylinderFitOptions {
  double step_cad = 0.25;  ///< largest step of the model; measured steps are divided evenly
  engine::Integrator integrator = engine::Integrator::trapezoid;
  optimize::LeastSquaresOptions search{};
};

/// Model against measurement of one load, on the measured angles.
struct LoadFit {
  LoadBurn burn;
  std::vector<double> model_bar;
  double p_max_bar = undefined<double>();  ///< highest measured sample
  double rmse_bar = undefined<double>();
  double rmse_percent = undefined<double>();
  double imep_closed_bar = undefined<double>();
  double imep_closed_model_bar = undefined<double>();
  double imep_closed_error_percent = undefined<double>();
  double largest_error_bar = undefined<double>();
  double largest_error_cad = undefined<double>();
  double ca50_cad = undefined<double>();            ///< of the burn law
  double heat_loss_fraction = undefined<double>();  ///< of the fuel heat
};

struct CylinderFit {
  engine::Cylinder cylinder;  ///< with the common parameters fitted; burn shape fields stay the start's
  std::vector<LoadFit> loads;
  optimize::FitReport report;
  Eigen::MatrixXd correlation_if_free;  ///< as the report's, but with parameters at a bound taken as free there
};

/// Names that may be freed per load, and those that may be freed for all loads (cylinder fields).
std::vector<std::string> load_parameters();
std::vector<std::string> common_parameters();

/// A start from the heat release of the trace: burn angles give start and duration, net heat plus a tenth the fuel
/// heat.
LoadBurn estimate_burn(const MeasuredCycle& trace, const engine::Cylinder& cylinder);

/// The cylinder with the shape fields of one load's burn.
template <class T>
engine::BasicCylinder<T> with_burn(engine::BasicCylinder<T> cylinder, const BasicLoadBurn<T>& burn) noexcept {
  cylinder.wiebe_m = burn.wiebe_m;
  cylinder.second_fraction = burn.second_fraction;
  cylinder.second_delay_cad = burn.second_delay_cad;
  cylinder.second_duration_cad = burn.second_duration_cad;
  cylinder.second_wiebe_m = burn.second_wiebe_m;
  return cylinder;
}

/// Fits. `free` mixes per-load and common names; all others keep their start value. Names, starts and traces are
/// checked before any work (ParameterError, ShapeError, DataError). Parameters are named `soc_cad[label]` per load.
CylinderFit fit_cylinder(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder,
                         const std::vector<LoadBurn>& start, const std::vector<std::string>& free,
                         const CylinderFitOptions& options = {});

}  // namespace mgdd::identify
