// Seeking a whole map: the operating point is a context of the processes of J and of every limit (Krause and Ong 2011),
// so that a reading at one point teaches all others. `suggest` gives the point and input whose reading is expected to
// raise the J of the whole map most: the knowledge gradient (Frazier, Powell and Dayanik 2009) summed over the cells,
// and what less doubt about the limits that hold cells back would free. `ask` gives the input that is worth most at a
// point that others choose. Nothing is asked far from what was read or from the best of its cell where there are
// limits, nor where one may break in forty readings by more than the stated probability lets it. Once no more than
// noise is to be learnt, cells that were never read are, and those where nothing may be asked at their surest input. A
// visit that is odd is made again before it counts. Where no input is known to be safe the map gives the one that most
// likely is. With a guide the model is the mean, with a factor and a place that are learnt; what it misses is a smooth
// function of point and input. ask and tell are noexcept and allocation-free; all randomness is a function of (seed,
// readings).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "mgdd/common/record.hpp"
#include "mgdd/common/state.hpp"
#include "mgdd/optimize/ask_tell/seeker.hpp"
#include "mgdd/optimize/belief/process_model.hpp"
#include "mgdd/optimize/laws/climb.hpp"
#include "mgdd/optimize/laws/most_worth.hpp"
#include "mgdd/optimize/limits/failing_process.hpp"
#include "mgdd/optimize/limits/limit_process.hpp"
#include "mgdd/optimize/watch/surprise.hpp"

namespace mgdd::optimize {

struct MapSeekingSettings {
  SearchSpace space;                        ///< finite bounds
  std::vector<Input> context;               ///< numbers of an operating point, finite bounds
  std::vector<std::vector<double>> axes{};  ///< entries of each, whose product are the cells; none: `ask` alone
  std::optional<double> noise_sd{};         ///< of one reading of J, > 0; none: learnt
  double horizon = 60.0;                    ///< readings at a point for which what is learnt pays, of `ask`
  double averaged = 1.0;                    ///< readings whose mean a visit gives
  double moving_cost = 0.0;                 ///< of another operating point, in readings
  double memory_readings = 1000.0;          ///< in which level and place are expected to wander by what counts
  int kept = 200;                           ///< readings at most, 10 to 500
  double smoothness = 0.0;                  ///< J that a squared bend of the map costs, see `Bend`
  double reach = 0.1;                       ///< from the best input of a cell, in bounds, where there are limits
  double limit_probability = 0.95;          ///< with which a limit holds in a cell, and in forty readings
  std::uint64_t seed = 0;
  bool maximize = true;
  std::vector<Limit> limits{};
  std::vector<Surface> guide{};         ///< what a model says of J over context and inputs, or none
  std::vector<Surface> limit_guides{};  ///< the same of every limit
};
inline auto fields_of(const MapSeekingSettings&) {
  using S = MapSeekingSettings;
  return std::tuple{
      space_fields<&S::space>(),
      field<&S::context>("context", "numbers of an operating point", DefaultForm::none),
      field<&S::axes>("axes", "entries of each, whose product are the cells", DefaultForm::none),
      field<&S::noise_sd>("noise_sd", "of one reading of J"),
      field<&S::horizon>("horizon", "readings at a point for which what is learnt pays"),
      field<&S::averaged>("averaged", "readings whose mean a visit gives"),
      field<&S::moving_cost>("moving_cost", "of another operating point, in visits"),
      field<&S::memory_readings>("memory_readings", "in which level and place are expected to wander"),
      field<&S::kept>("kept", "readings at most"),
      field<&S::smoothness>("smoothness", "J that a squared bend of the map costs"),
      field<&S::reach>("reach", "from the best input of a cell, share of the bounds"),
      field<&S::limit_probability>("limit_probability", "with which a limit holds in a cell"),
      field<&S::seed>("seed", "of the inputs that are compared"),
      field<&S::maximize>("maximize", "False to minimise J"),
      field<&S::limits>("limits", "measured quantities to keep"),
      field<&S::guide>("guide", "what a model says of J", DefaultForm::none),
      field<&S::limit_guides>("limit_guides", "the same of every limit", DefaultForm::none),
  };
}

/// With what is left open filled in. Throws ParameterError or ShapeError naming the field.
MapSeekingSettings resolved(MapSeekingSettings settings);

class MapSeeking {
 public:
  /// Throws ParameterError or ShapeError naming the field.
  explicit MapSeeking(MapSeekingSettings settings);

  /// A point and an input to read there.
  struct Visit {
    Inputs context, input;
    double gain = 0.0;  ///< by which the reading is expected to raise J, summed over the cells
    double sd = 0.0;    ///< of J there, before it
  };
  /// What is known of the best input of a point; NaN while there are fewer readings than numbers.
  struct Best {
    Inputs input, input_sd;
    double expected = 0.0, sd = 0.0;  ///< of J there, without the noise of a reading
    double regret = 0.0;  ///< by which J of the true best is expected to be above; its range where none is safe
    double excess = 0.0;  ///< of the worst limit with its probability, in its scale: above 0 where none is safe
  };

  /// Where to read next; needs cells.
  const Visit& suggest() noexcept;
  /// The input that is worth most at a point that others have chosen, within the bounds of the context.
  const Inputs& ask(const Inputs& context) noexcept;
  /// What was best at the point of the last `ask`, as it was known then.
  Inputs estimate() const noexcept { return unscaled(places_.back().best); }
  /// What was read at an input and a point, or the mean of several readings, and the standard deviations of these, of
  /// J and every limit; none, or 0, where they are not known.
  TellStatus tell(const Inputs& context, const Inputs& input, const Reading& reading, double readings = 1.0,
                  std::span<const double> sd = {}) noexcept;
  void reseed(std::uint64_t seed) noexcept;

  std::size_t cells() const noexcept { return places_.size() - 1; }
  /// The point of a cell, the last axis fastest.
  Inputs cell(std::size_t c) const noexcept;
  Best best(std::size_t c) noexcept;
  /// Probability that limit i holds at the best input of a cell.
  double holds(std::size_t c, std::size_t i) noexcept;

  double noise_sd() const noexcept { return j_.noise_sd(); }
  double guide_factor() const noexcept { return j_.guide_factor(); }
  /// Least share of the bends of J that the guide holds, as learnt; 1 without one.
  double trust() const noexcept { return j_.guide_share(); }
  std::int64_t readings() const noexcept { return told_; }
  std::int64_t doubts() const noexcept { return doubts_; }
  const MapSeekingSettings& settings() const noexcept { return settings_; }

  template <class Self, class V>
  static void visit(Self& self, V& v) {
    v("readings", self.told_, counts_end);
    v("doubts", self.doubts_, counts_end);
    v("since_doubt", self.since_doubt_, counts_end);
    v("failures", self.failures_);
    v("read", self.read_);
    v("lowest", self.lowest_);
    v("highest", self.highest_);
    v("last_context", self.last_context_);
    v("last_input", self.last_input_);
    v("again", self.again_, most_again + 1);
    for (std::size_t c = 0; c < self.places_.size(); ++c) {
      v("place" + std::to_string(c), self.places_[c].from);
    }
    v("asked_context", self.places_.back().context);
    Surprise::visit(self.surprise_, v, "surprise");
    ProcessModel::visit(self.j_, v, "j");
    for (std::size_t i = 0; i < self.limited_.size(); ++i)
      LimitProcess::visit(self.limited_[i], v, "limit" + std::to_string(i));
    FailingProcess::visit(self.failing_, v);
    if constexpr (!std::is_const_v<Self>) {
      self.searched_ = false;
      for (Place& place : self.places_)
        place.best = place.from;
    }
  }
  /// ParameterError for a restored state that these settings do not allow.
  void require_usable() const;

 private:
  // Candidates of a place, from everywhere and near its best. With 12 near an adiabatic guide loses a third more.
  static constexpr int spread = 14, near = 20, per_place = 1 + near + spread;
  static constexpr int most_visits = 6;  // of a cell, that are compared; eight find no better map
  static constexpr std::int64_t most_again = 2;
  static constexpr double odd_visit = 12.0;  // squared standard deviations, from which on it is taken again
  static constexpr double given_up = 3.0;    // failures of a cell in a row, then it is left alone

  struct Place {
    Inputs context, best;  // scaled
    Inputs from;           // that its search begins at, so that it is a function of the readings alone
    Climb climb{};
    double rough = 0.0;  // what the bends at the best cost, as its worth has it
    int known = 0;       // candidate that the map gives
    int visit = -1;      // candidate that would teach most, or that none may be asked there
  };
  /// A second difference of the map along an axis that a cell is part of, in ranges of the inputs, the axis counted in
  /// its mean steps: `own` times the input of the cell, plus those of two others.
  struct Bend {
    double own;
    std::array<std::size_t, 2> others;
    std::array<double, 2> weights;
  };
  std::vector<std::vector<Bend>> bends_of_cells() const;
  double roughness(const Place& place, const Inputs& z) const noexcept;
  double worth(int point) const noexcept { return j_.mean(point) - rough_[static_cast<std::size_t>(point)]; }
  void know_roughness(const Place& place, int from, int count, bool counts) noexcept;
  /// Candidate k of a place: the best one, some near it, then some from everywhere.
  int point_of(std::size_t c, int k) const noexcept {
    const int place = static_cast<int>(c);
    return k <= near ? place * (1 + near) + k : searching_ * (1 + near) + place * spread + k - 1 - near;
  }
  int last_point() const noexcept { return searching_ * per_place; }
  std::size_t place_of(int point) const noexcept {
    const int far = point - searching_ * (1 + near);
    return static_cast<std::size_t>(far < 0 ? point / (1 + near) : far / spread);
  }
  std::span<Place> all_cells() noexcept { return {places_.data(), cells()}; }
  Inputs scaled_context(const Inputs& context) const noexcept;
  Inputs scaled(const Inputs& input) const noexcept;
  Inputs unscaled(const Inputs& z) const noexcept;
  Inputs settable(const Inputs& z) const noexcept;
  double uniform(std::uint64_t stream, int index) const noexcept;
  double normal(std::uint64_t stream, int index) const noexcept;
  void put(int row, const Inputs& context, const Inputs& z) noexcept;
  void judge(int points, int from) noexcept;
  void judge_failing(int points, int from) noexcept;
  bool safe(int point, const Place& place) const noexcept;
  bool known() const noexcept;
  Climb::Worth worth_of(int point) const noexcept;
  void consider(Place& place, int from, int count, bool smooth) noexcept;
  void spread_out(std::span<Place> places) noexcept;
  void climb(std::span<Place> places, bool smooth) noexcept;
  void cloud_around(std::span<const Place> places) noexcept;
  void search(std::span<Place> places) noexcept;
  void know_cells() noexcept;
  void know_likeliest(std::size_t c, Place& place) noexcept;
  void choose_safe(std::span<Place> places) noexcept;
  int visits_of(std::size_t c, std::span<int> out) const noexcept;
  bool within_reach(int point) const noexcept;
  int surest(std::size_t c, bool dare) const noexcept;
  int untried(bool dare) const noexcept;
  int least_unsafe(std::span<const Place> places) const noexcept;
  double gain_of(int point, const double* covariances) noexcept;
  void sample(std::size_t c, Best& out) noexcept;
  Inputs first_input(const Inputs& context) const noexcept;
  void first_visit() noexcept;

  MapSeekingSettings settings_;
  double quantile_, cautious_quantile_;  // of the map, and of what is asked for
  Eigen::Index context_, inputs_;
  Steps steps_;
  ProcessModel j_;
  std::vector<LimitProcess> limited_;
  FailingProcess failing_;
  Surprise surprise_;
  std::int64_t told_ = 0, doubts_ = 0, since_doubt_ = 0;
  std::vector<Place> places_;     // the cells, the last axis fastest, and the point of the last `ask`
  std::vector<double> failures_;  // of the last readings of each cell, in a row
  std::vector<double> read_;      // how often each cell was
  Inputs lowest_, highest_;       // inputs that were read, scaled
  Inputs last_context_, last_input_;
  std::int64_t again_ = 0;                // times in a row that the last reading was odd
  std::vector<std::vector<Bend>> bends_;  // of every cell, where smoothness counts
  bool searched_ = false;                 // what is known of the cells is that of all readings
  bool suggested_ = false;                // by it, so that looking at the map alone changes nothing
  Visit visit_;
  Inputs asked_;
  // Scratch: of points, then of cells and limits.
  InputTable candidates_;
  std::vector<double> over_, cautious_, mean_over_, odds_, rough_;
  std::vector<int> safe_, safe_from_;  // candidates that keep the limits, cell by cell
  int searching_ = 0;                  // places at once
  Inputs aside_;                       // of an input, for slopes
  std::vector<double> multipliers_, edge_over_;
  NearestStep nearest_;
  InputTable edges_, excess_, joint_, effects_;
  WorthScratch worth_;
};

}  // namespace mgdd::optimize
