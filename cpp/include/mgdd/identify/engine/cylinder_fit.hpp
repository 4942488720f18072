// Calibration of the cycle model to measured pressure traces: per load the burn (start, duration, heat, shape), for all
// loads together the cylinder (wall heat and whatever else is freed). Residual: (model - measured)/p_max per trace.
// Angles °CA aTDC, pressure bar, heat J. Offline code; the search itself allocates nothing.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "mgdd/common/record.hpp"
#include "mgdd/engine/cycle.hpp"
#include "mgdd/engine/cylinder.hpp"
#include "mgdd/optimize/least_squares/fit_report.hpp"
#include "mgdd/optimize/least_squares/least_squares.hpp"

namespace mgdd::identify {

/// One measured closed cycle with its conditions. The cycle starts at the first sample, with its pressure unless that
/// is freed; the trapped amount is that of `engine::measured_gas_j_per_k`. Fuel and intake pressure of `point` are not
/// used.
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
  T start_pressure_bar{0.0};  ///< at the first sample; 0: as measured there

  bool operator==(const BasicLoadBurn&) const = default;
};
using LoadBurn = BasicLoadBurn<double>;

/// Fields of a load's burn; their domains are the bounds of the search.
template <class T>
constexpr auto load_fields() {
  using B = BasicLoadBurn<T>;
  return std::array{
      field<&B::soc_cad>(
          {"soc_cad", "°CA aTDC", closed(engine::timing_lower_cad, engine::timing_upper_cad), "start of combustion"}),
      field<&B::burn_duration_cad>({"burn_duration_cad", "°CA", log_scale(2.0, 150.0), "burn duration"}),
      field<&B::fuel_heat_j>({"fuel_heat_j", "J", log_scale(1e-2, 1e6), "heat of the fuel"}),
      field<&B::wiebe_m>({"wiebe_m", "-", closed(0.0, 5.0), "Wiebe shape, exponent m + 1"}),
      field<&B::second_fraction>({"second_fraction", "-", closed(0.0, 1.0), "share of the second Wiebe law"}),
      field<&B::second_delay_cad>(
          {"second_delay_cad", "°CA", closed(0.0, 40.0), "start of the second after the first"}),
      field<&B::second_duration_cad>({"second_duration_cad", "°CA", log_scale(5.0, 150.0), "duration of the second"}),
      field<&B::second_wiebe_m>({"second_wiebe_m", "-", closed(0.0, 5.0), "shape of the second"}),
      field<&B::start_pressure_bar>(
          {"start_pressure_bar", "bar", closed(0.0, 100.0), "pressure that the model starts from"})};
}

inline constexpr double wall_heat_scale_upper = 2.5;  ///< search bound offline, in textbook laws

/// Narrows the search of one free parameter: `name` of all traces, or `name[label]` of one.
struct SearchBound {
  std::string name;
  double lower;
  double upper;
};

struct CylinderFitOptions {
  double step_cad = 0.25;  ///< largest step of the model; measured steps are divided evenly
  engine::Integrator integrator = engine::Integrator::trapezoid;
  std::vector<SearchBound> bounds{};  ///< inside the domains of the fields; a start outside is moved to the bound
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
  double trapped_mass_g = undefined<double>();      ///< stated, or from p, V and T at IVC
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
  engine::BurnParameters<T>& shape = cylinder.burn;
  shape.wiebe_m = burn.wiebe_m;
  shape.second_fraction = burn.second_fraction;
  shape.second_delay_cad = burn.second_delay_cad;
  shape.second_duration_cad = burn.second_duration_cad;
  shape.second_wiebe_m = burn.second_wiebe_m;
  return cylinder;
}

/// Fits. `free` mixes per-load and common names; all others keep their start value. Names, starts and traces are
/// checked before any work (ParameterError, ShapeError, DataError). Parameters are named `soc_cad[label]` per load.
CylinderFit fit_cylinder(const std::vector<MeasuredCycle>& traces, const engine::Cylinder& cylinder,
                         const std::vector<LoadBurn>& start, const std::vector<std::string>& free,
                         const CylinderFitOptions& options = {});

}  // namespace mgdd::identify
