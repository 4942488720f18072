// Mean and covariance of a Gaussian process before any reading (Rasmussen and Williams 2006, ch. 2): level, slopes,
// bends and couplings with priors that grow with one number, the bend; where there is a guide, what it says, times a
// factor near the one it counts by and moved to first order; and a Matern 5/2 term for what they miss. Inputs are
// counted in their ranges, 0 to 1. noexcept and free of allocation after construction.
#pragma once

#include "mgdd/optimize/ask_tell/inputs.hpp"
#include "mgdd/optimize/belief/surface.hpp"

namespace mgdd::optimize {

using InputTable = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  // a row per point
using Columns = Eigen::Ref<const InputTable, 0, Eigen::OuterStride<>>;                      // a column per point

/// A guide of a process: a surface over inputs within these bounds, or none.
struct ProcessGuide {
  Surface surface{};
  Inputs lower{}, upper{};
  double sign = 1.0;       ///< -1 where less is better
  double factor_sd = 0.5;  ///< of its factor about the one it counts by
  double place_sd = 0.2;   ///< of its place, in ranges
  double secant = 0.0;     ///< half of what its slopes over inputs are taken across, in ranges; 0 for tangents
};

inline constexpr int most_kept = 500;  ///< readings of a process

class ProcessKernel {
 public:
  struct Scales {
    double bend = 1.0;                              ///< of what the guide does not say
    double guide = 0.0;                             ///< that the guide is multiplied by
    double noise_variance = 0.0;                    ///< of a reading
    double rest = 0.0;                              ///< variance of the Matern term over bend^2
    double wander_level = 0.0, wander_slope = 0.0;  ///< variances per reading
    Inputs inverse_length{};
  };
  /// What the terms without a length amount to for two points, over their scales.
  struct Fixed {
    double quadratic, guide;
  };

  /// `context`: how many of the inputs, the first ones, others set: there no maximum is expected.
  ProcessKernel(Eigen::Index inputs, Eigen::Index context, bool bends_down, ProcessGuide guide);

  bool guided() const noexcept { return !guide_.surface.empty(); }
  Eigen::Index inputs() const noexcept { return inputs_; }
  /// Numbers that describe a point: its inputs, then the guide there and its slopes.
  Eigen::Index width() const noexcept { return inputs_ + (guided() ? 1 + inputs_ : 0); }
  void describe(const Inputs& z, double* point) const noexcept;

  /// The bend of a parabola with the spread of the guide; 0 without one.
  double guide_bend() const noexcept { return guide_bend_; }
  /// Of J as a whole.
  double whole_bend(const Scales& s) const noexcept { return s.bend + s.guide * guide_bend_; }
  double mean(const double* point, const Scales& s) const noexcept;
  /// How large the guide is at a point, of which `mean` holds `guide` times as much.
  double guide_at(const double* point) const noexcept { return guided() ? point[inputs_] : 0.0; }

  Fixed fixed(const double* a, const double* b) const noexcept;
  double matern(const double* a, const double* b, const Inputs& inverse_length) const noexcept;
  double join(const Fixed& f, double matern, const Scales& s) const noexcept;
  double covariance(const double* a, const double* b, const Scales& s) const noexcept {
    return join(fixed(a, b), matern(a, b, s.inverse_length), s);
  }
  /// The same of one point with `count` others, whose descriptions are columns of a table.
  void covariances(const double* point, const Columns& others, Eigen::Index count, const Scales& s,
                   double* out) const noexcept;

 private:
  Eigen::Index inputs_, context_;
  bool bends_down_;
  ProcessGuide guide_;
  double guide_middle_ = 0.0, guide_bend_ = 0.0;
  double of_context_ = 1.0;  // variance of slopes over the context, over that of the inputs
};

}  // namespace mgdd::optimize
