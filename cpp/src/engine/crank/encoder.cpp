#include "mgdd/engine/crank/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <string>

#include "mgdd/common/error.hpp"
#include "mgdd/common/text.hpp"
#include "mgdd/engine/crank/edges.hpp"

namespace mgdd::engine {
namespace {

using Column = std::vector<double>;
using Counts = std::vector<long>;

constexpr double spike_share = 0.02;    // of the samples that a spike may hold and be none of the levels
constexpr double trusted_share = 0.8;   // of the turns, and of the edges, that must be as the wheel is said to be
constexpr double longest_step = 0.5;    // of the record between two samples: more is no record of a turning wheel
constexpr std::size_t turns_ahead = 3;  // that a false mark may hide

// Marks in pitches from the first edge: behind each gap that is as wide as the one of the wheel.
Counts marks_behind_gaps(const Counts& at, long missing) {
  Counts out;
  for (std::size_t k = 0; k + 1 < at.size(); ++k) {
    if (at[k + 1] - at[k] == missing + 1) out.push_back(at[k + 1]);
  }
  return out;
}

// The index stands by the same part of a pitch behind an edge in every turn, which is returned beside the marks.
std::pair<Counts, double> marks_of_index(const Column& index, const Column& t, const Counts& at) {
  Column place;
  double east = 0.0, north = 0.0;
  for (const double time : index) {
    if (time < t.front() || time > t.back()) continue;
    const auto next = static_cast<std::size_t>(std::upper_bound(t.begin() + 1, t.end() - 1, time) - t.begin());
    const double share = (time - t[next - 1]) / (t[next] - t[next - 1]);
    place.push_back(static_cast<double>(at[next - 1]) + share * static_cast<double>(at[next] - at[next - 1]));
    const double turned = 2.0 * std::numbers::pi * place.back();
    east += std::cos(turned), north += std::sin(turned);
  }
  const double behind = std::atan2(north, east) / (2.0 * std::numbers::pi);
  Counts out;
  for (const double p : place) {  // an index that bounces has one mark
    const long mark = std::lround(p - behind);
    if (out.empty() || mark > out.back()) out.push_back(mark);
  }
  return {out, behind};
}

// How far apart neighbouring marks are most often.
long usual_distance(const Counts& marks) {
  std::map<long, std::size_t> found;
  for (std::size_t k = 0; k + 1 < marks.size(); ++k)
    ++found[marks[k + 1] - marks[k]];
  const auto most = std::ranges::max_element(found, {}, [](const auto& each) { return each.second; });
  return most == found.end() ? 0 : most->first;
}

// How many marks are a turn from a neighbour.
std::size_t in_step(const Counts& marks, long turn) {
  std::size_t out = 0;
  for (std::size_t k = 0; k < marks.size(); ++k) {
    const bool after = k > 0 && marks[k] - marks[k - 1] == turn;
    const bool before = k + 1 < marks.size() && marks[k + 1] - marks[k] == turn;
    out += after || before ? 1 : 0;
  }
  return out;
}

struct Turns {
  Counts marks;  // those that begin a turn
  std::size_t passed_over = 0;
};

// Goes from mark to mark by whole turns; one that is out of step is false where a later one is in step, and else the
// count has slipped, and the next mark that has a partner takes over.
Turns follow(const Counts& marks, long turn) {
  const auto paired = [&](std::size_t k) { return k + 1 < marks.size() && (marks[k + 1] - marks[k]) % turn == 0; };
  Turns out;
  std::size_t k = 0;
  while (k < marks.size() && !paired(k))
    ++k, ++out.passed_over;
  while (k < marks.size()) {
    out.marks.push_back(marks[k]);
    std::size_t next = k + 1;
    const long end = marks[k] + static_cast<long>(turns_ahead) * turn;
    while (next < marks.size() && marks[next] <= end && (marks[next] - marks[k]) % turn != 0)
      ++next;
    const bool found = next < marks.size() && (marks[next] - marks[k]) % turn == 0;
    if (!found) {
      next = k + 1;
      while (next < marks.size() && !paired(next))
        ++next;
    }
    out.passed_over += next - k - 1;
    k = next;
  }
  return out;
}

// Slopes of a cubic through the edges that stays monotone (Fritsch and Butland 1984).
Column slopes(const Column& x, const Column& y) {
  const std::size_t n = x.size();
  Column d(n), out(n);
  for (std::size_t k = 0; k + 1 < n; ++k)
    d[k] = (y[k + 1] - y[k]) / (x[k + 1] - x[k]);
  out.front() = d.front(), out.back() = d[n - 2];
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double before = x[k] - x[k - 1], after = x[k + 1] - x[k];
    const double w1 = 2.0 * after + before, w2 = after + 2.0 * before;
    out[k] = (w1 + w2) / (w1 / d[k - 1] + w2 / d[k]);
  }
  return out;
}

Column between(std::span<const double> time, const Column& x, const Column& y) {
  const Column slope = slopes(x, y);
  Column out(time.size(), std::numeric_limits<double>::quiet_NaN());
  std::size_t k = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (time[i] < x.front() || time[i] > x.back()) continue;
    while (k + 2 < x.size() && time[i] > x[k + 1])
      ++k;
    const double h = x[k + 1] - x[k], u = (time[i] - x[k]) / h, v = 1.0 - u;
    out[i] = v * v * ((1.0 + 2.0 * u) * y[k] + u * h * slope[k]) +
             u * u * ((1.0 + 2.0 * v) * y[k + 1] - v * h * slope[k + 1]);
  }
  return out;
}

void check(std::span<const double> time, std::span<const double> signal, std::span<const double> index,
           const EncoderOptions& o) {
  if (o.teeth < 2 || o.teeth > 36000) throw ParameterError("teeth", o.teeth, "must be in [2, 36000]");
  if (2 * o.missing_teeth >= o.teeth)
    throw ParameterError("missing_teeth", o.missing_teeth, "must be below half of teeth = " + std::to_string(o.teeth));
  if (o.missing_teeth > 0 && !index.empty()) {
    throw ParameterError("missing_teeth", o.missing_teeth,
                         "must be 0 beside an index channel: the mark of a turn is the gap or the index");
  }
  if (signal.size() != time.size() || (!index.empty() && index.size() != time.size())) {
    throw about("signal", ShapeError("time_s has " + std::to_string(time.size()) + " samples, signal " +
                                     std::to_string(signal.size()) + " and index " + std::to_string(index.size()) +
                                     ": they must be equally long"));
  }
  if (time.size() < 20)
    throw DataError("the signal has " + std::to_string(time.size()) + " samples: at least 20 are needed");
  for (std::size_t k = 1; k < time.size(); ++k) {
    if (!(time[k] > time[k - 1])) {
      throw about("time_s", DataError("time_s[" + std::to_string(k) + "] = " + text(time[k]) + " after " +
                                      text(time[k - 1]) + ": times must increase"));
    }
    if (time[k] - time[k - 1] > longest_step * (time.back() - time.front())) {
      throw about("time_s", DataError("time_s[" + std::to_string(k) + "] = " + text(time[k]) + " after " +
                                      text(time[k - 1]) + ", half of the record or more between two samples: the " +
                                      "clock has jumped; read the record before and behind it by itself"));
    }
  }
}

[[noreturn]] void refuse_wheel(const EncoderOptions& o, const std::string& what) {
  std::string wheel = std::to_string(o.teeth);
  if (o.missing_teeth > 0) wheel += "-" + std::to_string(o.missing_teeth);
  throw about("teeth", DataError("the signal is not one of a wheel of " + wheel + " teeth: " + what));
}

// What the wheel is rather, by its widest common gap.
std::string other_wheel(const Counts& at) {
  std::map<long, Counts> behind;
  for (std::size_t k = 0; k + 1 < at.size(); ++k) {
    if (at[k + 1] - at[k] > 1) behind[at[k + 1] - at[k]].push_back(at[k + 1]);
  }
  for (const auto& [wide, marks] : behind) {
    const long apart = usual_distance(marks);
    if (marks.size() > 2 && 2 * in_step(marks, apart) > marks.size()) {
      return "every " + std::to_string(apart) + " pitches " + std::to_string(wide - 1) +
             " teeth are missing: say teeth = " + std::to_string(apart) +
             ", missing_teeth = " + std::to_string(wide - 1);
    }
  }
  return "no gap in the teeth returns: say missing_teeth = 0 if the wheel has none, or set the level of the edges";
}

// Edges [first, last) with their places in pitches from the first mark.
struct Places {
  Column of;
  std::vector<bool> in_gap;  // where the wheel has no tooth
  std::size_t first = 0, last = 0, lost_marks = 0;
  std::vector<std::pair<double, double>> slipped{};
};

Places without_marks(const Counts& at) {
  return {.of = Column(at.begin(), at.end()), .in_gap = std::vector<bool>(at.size(), false), .last = at.size()};
}

// Between two marks the count is a number of whole turns; where it is not, it is stretched to the nearest.
Places by_marks(const Counts& at, const Counts& candidates, double behind, const EncoderOptions& o) {
  const auto turn = static_cast<long>(o.teeth);
  const std::size_t good = in_step(candidates, turn);
  if (static_cast<double>(good) < trusted_share * static_cast<double>(candidates.size())) {
    refuse_wheel(o, "of " + std::to_string(candidates.size()) + " marks " + std::to_string(good) +
                        " are a turn from the next: set the level of the edges, or say another wheel");
  }
  auto [marks, lost] = follow(candidates, turn);
  Places out = without_marks(at);
  out.lost_marks = lost;
  double shift = -static_cast<double>(marks.front()) - behind;
  std::size_t k = 0;
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const long from = marks[m], to = m + 1 < marks.size() ? marks[m + 1] : at.back() + 1;
    const bool slipped = m + 1 < marks.size() && (to - from) % turn != 0;
    const auto counted = static_cast<double>(to - from), turns = std::round(counted / static_cast<double>(turn));
    const double factor = slipped ? std::max(turns, 1.0) * static_cast<double>(turn) / counted : 1.0;
    if (m + 1 < marks.size() && !slipped) out.lost_marks += static_cast<std::size_t>(turns) - 1;
    for (; k < at.size() && at[k] < to; ++k) {
      const long past = at[k] - from, in_turn = (past % turn + turn) % turn;
      out.of[k] = static_cast<double>(from) + shift + (past > 0 ? factor : 1.0) * static_cast<double>(past);
      out.in_gap[k] = !slipped && in_turn >= turn - static_cast<long>(o.missing_teeth);
    }
    if (!slipped) continue;
    const double start = static_cast<double>(from) + shift;
    shift += (factor - 1.0) * counted;
    out.slipped.emplace_back(start, static_cast<double>(to) + shift);
  }
  // What lies further than a turn from a mark has been counted, and nothing says that it was counted right.
  const auto one = static_cast<double>(turn), end = static_cast<double>(marks.back()) + shift + one;
  out.first = static_cast<std::size_t>(std::lower_bound(out.of.begin(), out.of.end(), -one) - out.of.begin());
  out.last = static_cast<std::size_t>(std::upper_bound(out.of.begin(), out.of.end(), end) - out.of.begin());
  return out;
}

Places by_gaps(const Counts& at, const EncoderOptions& o) {
  const auto turn = static_cast<long>(o.teeth);
  const Counts found = marks_behind_gaps(at, static_cast<long>(o.missing_teeth));
  if (found.size() == 1)
    refuse_wheel(o, "one gap of that width is in the record, and two are needed: record more turns");
  const long usual = usual_distance(found);
  if (usual == 0 || usual % turn != 0) refuse_wheel(o, other_wheel(at));
  return by_marks(at, found, 0.0, o);
}

Places by_index(const Column& index, const Column& t, const Counts& at, const EncoderOptions& o) {
  const auto [found, behind] = marks_of_index(index, t, at);
  const long usual = usual_distance(found);
  if (usual == 0) refuse_wheel(o, "the index has less than two pulses beside its edges");
  if (usual % static_cast<long>(o.teeth) != 0) {
    refuse_wheel(o, "between two pulses of the index there are usually " + std::to_string(usual) +
                        " edges: say teeth = " + std::to_string(usual));
  }
  return by_marks(at, found, behind, o);
}

// Teeth that the wheel has between two places.
std::size_t teeth_between(double one, double other, const EncoderOptions& o) {
  const auto turn = static_cast<long>(o.teeth);
  const long first = std::lround(one), between = std::lround(other - one) - 1;
  if (between <= 0) return 0;
  const long there = turn - static_cast<long>(o.missing_teeth);
  std::size_t out = static_cast<std::size_t>(between / turn) * static_cast<std::size_t>(there);
  for (long k = 1; k <= between % turn; ++k)
    out += ((first + k) % turn + turn) % turn < there ? 1 : 0;
  return out;
}

}  // namespace

EncoderAngle encoder_angle(std::span<const double> time, std::span<const double> signal, std::span<const double> index,
                           const EncoderOptions& o) {
  check(time, signal, index, o);
  EncoderAngle out;
  Column t = edge_times(time, signal, {.falling = o.falling, .level = o.level, .spike_share = spike_share}, "signal");
  if (t.size() < std::max<std::size_t>(o.teeth - o.missing_teeth, 4))
    refuse_wheel(o, std::to_string(t.size()) + " edges are less than a turn");
  out.extra = drop_extra(t);
  const Counts at = count_pitches(t);
  Places places = o.missing_teeth > 0 ? by_gaps(at, o)
                  : index.empty()     ? without_marks(at)
                                      : by_index(edge_times(time, index, {.falling = o.falling}, "index"), t, at, o);
  out.lost_marks = places.lost_marks;
  out.slipped_deg = std::move(places.slipped);
  const double pitch = 360.0 / static_cast<double>(o.teeth);
  for (auto& [from, to] : out.slipped_deg)
    from *= pitch, to *= pitch;
  Column x, y;
  for (std::size_t k = places.first; k < places.last; ++k) {
    if (places.in_gap[k]) {
      ++out.extra;
      continue;
    }
    if (!x.empty()) out.lost += teeth_between(y.back(), places.of[k], o);
    x.push_back(t[k]), y.push_back(places.of[k]);
  }
  if (x.size() < 3) refuse_wheel(o, "too few edges remain between its marks");
  if (static_cast<double>(out.lost + out.extra) > (1.0 - trusted_share) * static_cast<double>(x.size())) {
    refuse_wheel(o, std::to_string(out.lost) + " edges are lost and " + std::to_string(out.extra) + " too many of " +
                        std::to_string(x.size()) + ": set the level of the edges, or say another wheel");
  }
  for (double& each : y)
    each *= pitch;
  out.angle_deg = between(time, x, y);
  for (double mark = 360.0 * std::ceil(y.front() / 360.0); mark <= y.back(); mark += 360.0) {
    const auto after = std::lower_bound(y.begin() + 1, y.end() - 1, mark) - y.begin();
    const auto k = static_cast<std::size_t>(after);
    out.mark_s.push_back(x[k - 1] + (x[k] - x[k - 1]) * (mark - y[k - 1]) / (y[k] - y[k - 1]));
  }
  return out;
}

std::vector<double> at_even_angles(std::span<const double> angle, std::span<const double> values, double from,
                                   double step, std::size_t count) {
  std::vector<double> out(count);
  std::size_t k = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = from + step * static_cast<double>(i);
    while (k + 2 < angle.size() && angle[k + 1] <= wanted)
      ++k;
    // The four samples around it, at the ends of the record the outer ones, by Lagrange's formula on their places.
    const std::size_t first = std::min(k > 0 ? k - 1 : 0, angle.size() - 4);
    const double u = static_cast<double>(k - first) + (wanted - angle[k]) / (angle[k + 1] - angle[k]);
    const double* v = values.data() + first;
    out[i] = -v[0] * (u - 1.0) * (u - 2.0) * (u - 3.0) / 6.0 + v[1] * u * (u - 2.0) * (u - 3.0) / 2.0 -
             v[2] * u * (u - 1.0) * (u - 3.0) / 2.0 + v[3] * u * (u - 1.0) * (u - 2.0) / 6.0;
  }
  return out;
}

}  // namespace mgdd::engine
