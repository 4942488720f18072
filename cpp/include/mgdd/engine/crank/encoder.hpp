// Crank angle of every sample of a record over time, from the signal of an encoder or of a toothed wheel: edges, what
// is lost or too much among them, the turns by a gap in the teeth or by an index channel, angle between the edges.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace mgdd::engine {

struct EncoderOptions {
  std::size_t teeth = 360;        ///< pulses of a turn, missing ones counted: 60 of a 60-2 wheel
  std::size_t missing_teeth = 0;  ///< side by side; their gap is the mark of the turn
  bool falling = false;           ///< edges that count
  std::optional<double> level{};  ///< where an edge is, in units of the signal; none: midway between low and high
};

struct EncoderAngle {
  /// Running on, 0 at a mark: the edge behind the gap, the edge of the index, or else the first edge of all. NaN before
  /// and behind the turns that can be told [deg].
  std::vector<double> angle_deg;
  std::vector<double> mark_s;  ///< time of each mark
  std::size_t lost = 0;        ///< edges that are missing beside the gap: the angle runs through
  std::size_t extra = 0;       ///< edges that are left out, as those of noise
  std::size_t lost_marks = 0;  ///< marks that are missing or false where the count of edges is right
  /// Whole turns in which the count is wrong: the angle is only right at their ends [deg].
  std::vector<std::pair<double, double>> slipped_deg;
};

/// `time_s` rises; `index` is empty, or has one pulse a turn at each sample. ParameterError for a wheel that cannot be;
/// DataError for a signal that does not move, or that is of another wheel, with what was counted instead.
EncoderAngle encoder_angle(std::span<const double> time_s, std::span<const double> signal,
                           std::span<const double> index, const EncoderOptions& options);

/// Samples at even angles `from_deg + k step_deg`, by a cubic through the four samples around each. `angle_deg` rises
/// and holds the angles asked for; the samples are even in time.
std::vector<double> at_even_angles(std::span<const double> angle_deg, std::span<const double> values, double from_deg,
                                   double step_deg, std::size_t count);

}  // namespace mgdd::engine
