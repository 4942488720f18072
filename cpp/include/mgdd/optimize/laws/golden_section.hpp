// Golden-section search of one input (Kiefer 1953) that knows about noise: two inner points are measured in turns until
// their means differ by more than chance or a budget is spent; a draw cuts both ends. Once draws say that the bracket
// is as small as the noise allows, the search goes on as triples around the vertex of a parabola through its samples,
// so that it keeps tracking. ask and tell are noexcept and allocation-free.
#pragma once

#include <array>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker_core.hpp"

namespace mgdd::optimize {

struct GoldenSectionSettings {
  SearchSpace space;          ///< one input, finite bounds: the bracket
  double noise_sd = 0.0;      ///< of one measurement of J; 0 = exact, every comparison is believed
  double significance = 2.0;  ///< standard errors that decide a comparison
  int samples_max = 8;        ///< measurements of each inner point before a draw
  double tolerance = 0.0;     ///< bracket width at which an exact search ends, input unit; 0 = a fiftieth of its scale
  bool maximize = true;
  std::vector<Limit> limits;
};
inline auto fields_of(const GoldenSectionSettings&) {
  using S = GoldenSectionSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::noise_sd>("noise_sd", "of one measurement of J"),
      field<&S::significance>("significance", "standard errors that decide a comparison"),
      field<&S::samples_max>("samples_max", "measurements of each inner point"),
      field<&S::tolerance>("tolerance", "width of the bracket at which an exact search ends", DefaultForm::none),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
  };
}

class GoldenSection : public SeekerCore<GoldenSection, GoldenSectionSettings> {
 public:
  explicit GoldenSection(GoldenSectionSettings settings);

  const Inputs& ask() noexcept;
  /// New operating point: back to the whole bracket, the estimate stays until the next decision.
  void restart() noexcept;

  double lower() const noexcept { return lower_; }  ///< of the bracket
  double upper() const noexcept { return upper_; }
  bool converged() const noexcept { return refining_; }

  /// Moves the estimate, within the bounds; `by` is finite. A search that goes on elsewhere is restarted first.
  void shift_estimate(const Inputs& by) noexcept;

  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const { require_within_space("estimate", estimate_, settings_.space); }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    SeekerCore::visit_core(self, v);
    v("lower", self.lower_);
    v("upper", self.upper_);
    v("width", self.width_);
    v("draws", self.draws_, counts_end);
    v("stayed", self.stayed_, counts_end);
    v("last_asked", self.last_asked_);
    v("refining", self.refining_);
    v("turn", self.turn_, self.refining_ ? 3 : 2);
    v("sample_input", self.sample_input_);
    v("sample_j", self.sample_j_);
    v("samples", self.samples_, counts_end);
    for (std::size_t p = 0; p < 2; ++p) {
      const std::string name = "point" + std::to_string(p);
      v(name + "_count", self.points_[p].count);
      v(name + "_sum", self.points_[p].sum);
      v(name + "_excess", self.points_[p].excess);
      v(name + "_judged", self.points_[p].judged);
      v(name + "_missed", self.points_[p].missed);
      v(name + "_squares", self.points_[p].squares);
      v(name + "_least", self.points_[p].least);
      v(name + "_most", self.points_[p].most);
    }
  }

 private:
  friend SeekerCore;
  bool judged_together() const noexcept { return false; }
  void begin_anew() noexcept {
    restart();
    estimate_ = settings_.space.start;
  }
  void learn(const Reading& reading, const Inputs& applied) noexcept;
  struct Point {
    // Sums: of J, of the worst scaled excess over the limits in `judged` cycles, of the applied input less the asked
    // one; and of squares of J about the mean.
    double count = 0.0, sum = 0.0, excess = 0.0, judged = 0.0, missed = 0.0, squares = 0.0;
    double least = 0.0, most = 0.0;  // of that excess
  };
  struct Parabola {
    double vertex, bend;
  };
  double inner(std::size_t p) const noexcept;
  static double excess_at(const Point& point) noexcept;
  void judge(Point& point, const Reading& reading) noexcept;
  void next_turn() noexcept;
  void decide() noexcept;
  void cut(double lower, double upper) noexcept;
  Parabola parabola() const noexcept;
  void refine() noexcept;
  void centre_bracket(double width) noexcept;

  double lower_, upper_;
  double width_;           // of the bracket when the refinement began
  std::int64_t turn_ = 0;  // which inner point, or which of a triple, is measured now
  std::int64_t draws_ = 0;
  std::int64_t stayed_ = 0;  // cycles in a row at the same point
  double last_asked_ = 0.0;
  bool refining_ = false;
  std::array<Point, 2> points_;
  std::vector<double> sample_input_, sample_j_;  // the last samples, a ring
  std::int64_t samples_ = 0;
};

}  // namespace mgdd::optimize
