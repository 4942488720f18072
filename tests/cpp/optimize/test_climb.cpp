// Laws of the climb, on functions of its own.
#include "mgdd/common/random.hpp"
#include "mgdd/optimize/belief/process_kernel.hpp"
#include "mgdd/optimize/laws/climb.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"
#include "support/test.hpp"

namespace mgdd::optimize {
namespace {

// J of three inputs, whose best is held back by a sphere and a plane that meet; `unit` of J.
struct Corner {
  double unit = 1.0;

  double worth(const Inputs& z) const { return unit * (2.0 * z[0] + z[1] + 0.4 * z[2] - 1.5 * z[2] * z[2]); }
  double excess(int limit, const Inputs& z) const {
    return limit == 0 ? z.squaredNorm() / 0.36 - 1.0 : z[0] - 0.5 * z[1] - 0.3;
  }
  // On the plane, z = (0.3 + off + y/2, y, w): with the best w inside the sphere for every y of a fine grid.
  double most(double off) const {
    double out = -unlimited;
    for (double y = 0.0; y < 0.6; y += 1e-4) {
      const double x = 0.3 + off + 0.5 * y, left = 0.36 - y * y - x * x;
      if (left < 0.0) break;
      Inputs z(3);
      z << x, y, std::min(std::sqrt(left), 0.4 / 3.0);
      out = std::max(out, worth(z));
    }
    return out;
  }
  Climb::Worth known(const Inputs& z) const { return {std::max(excess(0, z), excess(1, z)), worth(z)}; }

  Inputs top(Inputs from, int times) const {
    const Inputs aside = Inputs::Constant(3, 0.01);
    for (int search = 0; search < times; ++search) {
      Climb climb;
      climb.begin(from, known(from));
      for (int round = 0; round < Climb::rounds; ++round) {
        std::array<double, 2> over{};
        NearestStep nearest(2);
        InputTable edges(2, 3);
        for (int i = 0; i < 2; ++i) {
          climb.slopes(aside, [&](int k) { return excess(i, climb.beside(k, aside)); }, edges.row(i));
          over[static_cast<std::size_t>(i)] = excess(i, climb.best()) + Climb::inside;
        }
        climb.aim(aside, [&](int k) { return worth(climb.beside(k, aside)); }, edges, over, nearest);
        for (int k = 0; k < Climb::tries; ++k) {
          const Inputs tried = climb.tried(k);
          climb.consider(tried, known(tried));
          for (int i = 0; i < 2; ++i)
            over[static_cast<std::size_t>(i)] = excess(i, tried) + Climb::inside;
          const Inputs back = climb.moved_back(k, edges, over, nearest);
          climb.consider(back, known(back));
        }
        climb.narrow();
      }
      from = climb.best();
    }
    return from;
  }
};

TEST(Climb, SlidesIntoTheCornerWhereTwoLimitsMeet) {
  const double most = Corner{}.most(0.0);
  Inputs start(3);
  start << 0.05, 0.3, 0.4;
  for (const double unit : {1.0, 1e-9, 1e6}) {
    const Corner own{unit};
    const Inputs z = own.top(start, 3);
    EXPECT_LE(own.known(z).over, 0.0);
    EXPECT_NEAR(own.worth(z) / unit, most, 2e-3) << unit << ": " << z.transpose();
  }
}

// The same with an operating point, which moves the plane, by noisy readings.
struct Corners {
  const Corner corner{};
  double plane(double load, const Inputs& z) const { return corner.excess(1, z) - 0.1 * load; }

  MapSeekingSettings settings(std::uint64_t seed) const {
    MapSeekingSettings out;
    out.space = {Inputs::Constant(3, 0.2), Inputs::Zero(3), Inputs::Ones(3)};
    out.context = {{"load", 0.0, 1.0}};
    out.axes = {{0.0, 0.4, 1.0}};
    out.limits = {{.name = "sphere"}, {.name = "plane"}};
    out.seed = seed;
    return out;
  }
  // A guide that lies elsewhere.
  static Surface surface(const auto& value) {
    std::vector<double> nodes, values;
    for (int k = 0; k <= 8; ++k)
      nodes.push_back(k / 8.0);
    for (const double load : {0.0, 1.0}) {
      for (const double a : nodes) {
        for (const double b : nodes) {
          for (const double c : nodes) {
            Inputs z(3);
            z << a - 0.05, b, c;
            values.push_back(value(load, z));
          }
        }
      }
    }
    return Surface({{0.0, 1.0}, nodes, nodes, nodes}, values);
  }
  // The largest loss of a cell; no cell and no visit is above a limit by more.
  double lost(MapSeeking& search, std::uint64_t visits, double above) const {
    const std::uint64_t seed = search.settings().seed;
    for (std::uint64_t k = 0; k < visits; ++k) {
      const MapSeeking::Visit visit = search.suggest();
      const auto read = [&](double value, std::uint64_t what) { return value + 2e-3 * random::normal(seed, what, k); };
      const double sphere = corner.excess(0, visit.input), flat = plane(visit.context[0], visit.input);
      EXPECT_LE(std::max(sphere, flat), above) << seed << ' ' << k;
      const std::array<double, 1> j{read(corner.worth(visit.input), 90)};
      const std::array<double, 2> limits{read(sphere, 91), read(flat, 92)};
      search.tell(visit.context, visit.input, {.components = j, .limits = limits});
    }
    double out = 0.0;
    for (std::size_t c = 0; c < search.cells(); ++c) {
      const double load = search.cell(c)[0];
      const Inputs z = search.best(c).input;
      EXPECT_LE(std::max(corner.excess(0, z), plane(load, z)), 2e-3) << seed << ' ' << load;
      out = std::max(out, corner.most(0.1 * load) - corner.worth(z));
    }
    return out;
  }
};

TEST(Climb, BringsASearchForAMapIntoTheCorners) {
  const Corners own;
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    MapSeekingSettings settings = own.settings(seed);
    settings.guide = {Corners::surface([&](double, const Inputs& z) { return 1.3 * own.corner.worth(z); })};
    settings.limit_guides = {Corners::surface([&](double, const Inputs& z) { return own.corner.excess(0, z); }),
                             Corners::surface([&](double load, const Inputs& z) { return own.plane(load, z); })};
    MapSeeking search(settings);
    EXPECT_LE(own.lost(search, 40, 2e-3), 0.008) << seed;
  }
}

// Without a guide readings at two loads may leave every input at the third in doubt: it is read all the same.
TEST(MapSeeking, ACellWhereNothingMayBeAskedIsEnteredOnceTheOthersAreKnown) {
  const Corners own;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    MapSeeking search(own.settings(seed));
    EXPECT_LE(own.lost(search, 60, 0.1), 0.02) << seed;
  }
}

TEST(Climb, StaysWhereNothingIsToBeGained) {
  Climb climb;
  const Inputs at = Inputs::Constant(2, 0.25), aside = Inputs::Constant(2, 0.01);
  climb.begin(at, {-1.0, 3.0});
  std::array<double, 0> none{};
  NearestStep nearest(0);
  climb.aim(aside, [](int) { return 3.0; }, InputTable(0, 2), none, nearest);
  EXPECT_EQ(climb.tried(0), at);
  climb.consider(Inputs::Constant(2, 0.5), {-1.0, 3.0});
  EXPECT_EQ(climb.best(), at);
}

}  // namespace
}  // namespace mgdd::optimize
