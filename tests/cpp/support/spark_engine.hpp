// A spark engine that shares no code with the package: torque over spark advance, held back by knock; and searches for
// its map.
#pragma once

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"
#include "support/test.hpp"

namespace mgdd::test_support {

using namespace mgdd::optimize;

inline constexpr double knock_limit = 1.0;

struct Plant {
  double octane = 0.0;  // degrees of spark by which knock comes later
  double mbt_shift = 0.0, scale = 1.0;
  double motored = 0.0;  // least knock signal, which says nothing of the spark

  double mbt(const Inputs& at) const { return 14.0 + 6.0 * (at[0] - 1.0) - 9.0 * at[1] + mbt_shift; }
  double torque(const Inputs& at, double spark) const {
    const double off = spark - mbt(at);
    return scale * at[1] * (200.0 - 0.11 * off * off - 0.0012 * off * off * off);
  }
  double knock(const Inputs& at, double spark) const {
    return std::max(motored,
                    0.25 * std::exp((spark - 20.0 - octane + 22.0 * (at[1] - 0.5) - 2.0 * (at[0] - 2.0)) / 7.0));
  }
  // Best spark under the knock limit.
  double best(const Inputs& at) const {
    double spark = -10.0;
    for (double tried = -10.0; tried <= 45.0; tried += 0.01)
      if (knock(at, tried) <= knock_limit && torque(at, tried) > torque(at, spark)) spark = tried;
    return spark;
  }
};

inline Inputs point(double krpm, double load) {
  Inputs out(2);
  out << krpm, load;
  return out;
}

inline Surface surface_of(const Plant& plant, bool knock) {
  const std::vector<double> speeds{1.0, 2.0, 3.0, 4.0}, loads{0.3, 0.6, 0.9};
  std::vector<double> sparks, values;
  for (double spark = -10.0; spark <= 45.0; spark += 2.5)
    sparks.push_back(spark);
  for (const double speed : speeds) {
    for (const double load : loads) {
      for (const double spark : sparks)
        values.push_back(knock ? plant.knock(point(speed, load), spark) : plant.torque(point(speed, load), spark));
    }
  }
  return Surface({speeds, loads, sparks}, values);
}

inline MapSeekingSettings settings(std::uint64_t seed, const Plant* guide) {
  MapSeekingSettings s;
  s.space = {scalar_input(2.0), scalar_input(-10.0), scalar_input(45.0)};
  s.context = {{"speed_krpm", 1.0, 4.0}, {"load", 0.3, 0.9}};
  s.axes = {{1.0, 2.0, 3.0, 4.0}, {0.3, 0.6, 0.9}};
  s.limits = {{"knock", knock_limit}};
  s.seed = seed;
  if (guide != nullptr) {
    s.guide = {surface_of(*guide, false)};
    s.limit_guides = {surface_of(*guide, true)};
  }
  return s;
}

inline void read(MapSeeking& search, const Plant& plant, const Inputs& at, const Inputs& input, std::uint64_t draw) {
  const double noise = 0.2 * random::normal(9, 1, draw), knock_noise = 0.01 * random::normal(9, 2, draw);
  const double torque = plant.torque(at, input[0]) + noise;
  const std::array<double, 1> knock{plant.knock(at, input[0]) + knock_noise};
  ASSERT_EQ(search.tell(at, input, {.components = {&torque, 1}, .limits = knock}), TellStatus::accepted);
}

struct Judged {
  double worst_loss = 0.0, worst_knock = 0.0;
};

inline Judged visited(MapSeeking& search, const Plant& plant, int visits, std::uint64_t seed) {
  Judged out;
  for (int k = 0; k < visits; ++k) {
    const MapSeeking::Visit visit = search.suggest();
    out.worst_knock = std::max(out.worst_knock, plant.knock(visit.context, visit.input[0]));
    read(search, plant, visit.context, visit.input, 1000 * seed + static_cast<std::uint64_t>(k));
  }
  for (std::size_t c = 0; c < search.cells(); ++c) {
    const Inputs at = search.cell(c);
    const double own = search.best(c).input[0];
    out.worst_loss = std::max(out.worst_loss, plant.torque(at, plant.best(at)) - plant.torque(at, own));
  }
  return out;
}

}  // namespace mgdd::test_support
