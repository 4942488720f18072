// Laws of the limited step and of the climb that is made of it, on functions of their own.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "mgdd/common/random.hpp"
#include "mgdd/optimize/belief/process_kernel.hpp"
#include "mgdd/optimize/laws/climb.hpp"
#include "mgdd/optimize/laws/map_seeking.hpp"

namespace mgdd::optimize {
namespace {

double drawn(std::uint64_t stream, std::uint64_t index) {
  return random::normal(7, stream, index);
}

// Karush, Kuhn and Tucker: nothing is broken, nothing pushes that does not hold, and what pushes balances the rise.
TEST(LimitedStep, IsTheOptimumOfItsProgram) {
  for (std::uint64_t k = 0; k < 200; ++k) {
    const Eigen::Index n = 1 + static_cast<Eigen::Index>(k % 4), m = static_cast<Eigen::Index>(k % 3);
    Inputs rise(n), bend(n), low(n), high(n);
    InputTable edges(m, n);
    std::vector<double> over(static_cast<std::size_t>(m)), multipliers(over);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto stream = static_cast<std::uint64_t>(10 * i);
      rise[i] = drawn(stream, k);
      bend[i] = std::exp(drawn(stream + 1, k));
      low[i] = -0.1 - 0.4 * random::uniform(7, stream + 2, k);
      high[i] = 0.1 + 0.4 * random::uniform(7, stream + 3, k);
      for (Eigen::Index j = 0; j < m; ++j)
        edges(j, i) = drawn(stream + 4 + static_cast<std::uint64_t>(j), k);
    }
    for (double& own : over)  // the point itself keeps them
      own = -0.3 * random::uniform(7, 99, k);
    const Inputs step = limited_step(rise, bend, edges, over, low, high, std::span(multipliers));
    Inputs left = rise - bend.cwiseProduct(step);
    for (Eigen::Index j = 0; j < m; ++j) {
      const auto at = static_cast<std::size_t>(j);
      const double excess = over[at] + edges.row(j).dot(step);
      EXPECT_LE(excess, 1e-3) << k;
      EXPECT_GE(multipliers[at], 0.0) << k;
      EXPECT_NEAR(multipliers[at] * excess, 0.0, 2e-3) << k;
      left -= multipliers[at] * edges.row(j).transpose();
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      EXPECT_GE(left[i], step[i] < low[i] + 1e-4 ? -unlimited : -5e-3) << k;
      EXPECT_LE(left[i], step[i] > high[i] - 1e-4 ? unlimited : 5e-3) << k;
    }
  }
}

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
        std::array<double, 2> over{}, multipliers{}, unused{};
        InputTable edges(2, 3);
        for (int i = 0; i < 2; ++i) {
          climb.slopes(aside, [&](int k) { return excess(i, climb.beside(k, aside)); }, edges.row(i));
          over[static_cast<std::size_t>(i)] = excess(i, climb.best()) + Climb::inside;
        }
        climb.aim(aside, [&](int k) { return worth(climb.beside(k, aside)); }, edges, over, std::span(multipliers));
        for (int k = 0; k < Climb::tries; ++k) {
          const Inputs tried = climb.tried(k);
          climb.consider(tried, known(tried));
          for (int i = 0; i < 2; ++i)
            over[static_cast<std::size_t>(i)] = excess(i, tried) + Climb::inside;
          const Inputs back = climb.moved_back(k, edges, over, std::span(unused));
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

// The same with an operating point, which moves the plane, by noisy readings, with a guide that lies elsewhere.
TEST(Climb, BringsASearchForAMapIntoTheCorners) {
  const Corner corner;
  const auto plane = [&](double load, const Inputs& z) { return corner.excess(1, z) - 0.1 * load; };
  const auto inputs = [](double a, double b, double c) {
    Inputs out(3);
    out << a, b, c;
    return out;
  };
  const auto guide = [&](const auto& value) {
    std::vector<double> nodes, values;
    for (int k = 0; k <= 8; ++k)
      nodes.push_back(k / 8.0);
    for (const double load : {0.0, 1.0}) {
      for (const double a : nodes) {
        for (const double b : nodes) {
          for (const double c : nodes)
            values.push_back(value(load, inputs(a - 0.05, b, c)));
        }
      }
    }
    return Surface({{0.0, 1.0}, nodes, nodes, nodes}, values);
  };
  MapSeekingSettings own;
  own.space = {Inputs::Constant(3, 0.2), Inputs::Zero(3), Inputs::Ones(3)};
  own.context = {{"load", 0.0, 1.0}};
  own.axes = {{0.0, 0.4, 1.0}};
  own.limits = {{.name = "sphere"}, {.name = "plane"}};
  own.guide = {guide([&](double, const Inputs& z) { return 1.3 * corner.worth(z); })};
  own.limit_guides = {guide([&](double, const Inputs& z) { return corner.excess(0, z); }), guide(plane)};
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    own.seed = seed;
    MapSeeking search(own);
    for (std::uint64_t k = 0; k < 40; ++k) {
      const MapSeeking::Visit visit = search.suggest();
      const auto read = [&](double value, std::uint64_t what) { return value + 2e-3 * random::normal(seed, what, k); };
      const std::array<double, 1> j{read(corner.worth(visit.input), 90)};
      const std::array<double, 2> limits{read(corner.excess(0, visit.input), 91),
                                         read(plane(visit.context[0], visit.input), 92)};
      search.tell(visit.context, visit.input, {.components = j, .limits = limits});
    }
    for (std::size_t c = 0; c < search.cells(); ++c) {
      const double load = search.cell(c)[0];
      const Inputs z = search.best(c).input;
      EXPECT_LE(std::max(corner.excess(0, z), plane(load, z)), 2e-3) << seed << ' ' << load;
      EXPECT_LE(corner.most(0.1 * load) - corner.worth(z), 0.008) << seed << ' ' << load << ": " << z.transpose();
    }
  }
}

TEST(Climb, StaysWhereNothingIsToBeGained) {
  Climb climb;
  const Inputs at = Inputs::Constant(2, 0.25), aside = Inputs::Constant(2, 0.01);
  climb.begin(at, {-1.0, 3.0});
  std::array<double, 0> none{};
  climb.aim(aside, [](int) { return 3.0; }, InputTable(0, 2), none, std::span<double>(none));
  EXPECT_EQ(climb.tried(0), at);
  climb.consider(Inputs::Constant(2, 0.5), {-1.0, 3.0});
  EXPECT_EQ(climb.best(), at);
}

}  // namespace
}  // namespace mgdd::optimize
