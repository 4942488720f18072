// Cycles in lanes and cycles of one operating point that share their tables, against the cycle one by one.
#include "mgdd/engine/batch/batch.hpp"

#include <initializer_list>

#include "mgdd/common/error.hpp"
#include "mgdd/engine/sensitivity.hpp"
#include "support/test.hpp"

namespace mgdd::engine {
namespace {

using Columns = std::vector<std::vector<double>>;

struct Table {
  BatchCases cases;
  std::vector<double> values;

  Table(std::vector<std::string> names, std::vector<double> rows) : values(std::move(rows)) {
    cases.names = std::move(names);
    cases.values = values;
  }
  Table(const Table&) = delete;
  Table& operator=(const Table&) = delete;
};

std::vector<IndicatorMember> all_members() {
  std::vector<IndicatorMember> members;
  for (const auto& field : indicator_fields<double>())
    members.push_back(field.member);
  return members;
}

Columns run(const BatchCases& cases, const BatchSettings& settings, std::size_t* failed = nullptr) {
  const std::vector<IndicatorMember> members = all_members();
  Columns columns(members.size(), std::vector<double>(cases.size(), -1.0));
  std::vector<double*> to;
  for (std::vector<double>& column : columns)
    to.push_back(column.data());
  const std::size_t n = simulate_batch(cases, settings, members, to);
  if (failed != nullptr) *failed = n;
  return columns;
}
Columns run(const BatchCases& cases, BatchForm form) {
  BatchSettings settings;
  settings.form = form;
  return run(cases, settings);
}

/// The largest difference, relative to the size or to 1 (of work and heat, to 10 J: they are differences of larger
/// ones); NaN must meet NaN.
double difference(const Columns& a, const Columns& b) {
  double worst = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double least = indicator_fields<double>()[i].unit == "J" ? 10.0 : 1.0;
    for (std::size_t row = 0; row < a[i].size(); ++row) {
      if (std::isnan(a[i][row]) && std::isnan(b[i][row])) continue;
      const double now = std::abs(a[i][row] - b[i][row]) / std::max(least, std::abs(b[i][row]));
      worst = now <= worst ? worst : now;  // a lone NaN stays
    }
  }
  return worst;
}
bool same_bits(const Columns& a, const Columns& b) {
  return difference(a, b) == 0.0;
}

/// Points all over the plane of a light-duty diesel, none like another.
std::vector<double> mixed_points(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  const auto within = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  std::vector<double> rows;
  for (std::size_t i = 0; i < n; ++i) {
    for (const double x :
         {within(800, 4000), within(4, 60), within(95, 260), within(280, 360), within(-30, 12), within(0.1, 1.5)})
      rows.push_back(x);
  }
  return rows;
}
const std::vector<std::string> mixed_names{"speed_rpm", "fuel_mg",        "intake_pressure_kpa", "intake_temperature_k",
                                           "soc_cad",   "wall_heat_scale"};

TEST(Batch, LanesGiveTheCyclesOneByOneForEveryLaw) {
  Table table(mixed_names, mixed_points(53, 1));  // not a multiple of the lanes
  for (const BurnShape shape : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
    for (const WallHeatModel wall : {WallHeatModel::woschni, WallHeatModel::hohenberg, WallHeatModel::eichelberg}) {
      for (const Integrator scheme :
           {Integrator::trapezoid, Integrator::split, Integrator::tan2018_lagged, Integrator::euler}) {
        table.cases.cylinder.burn.burn_shape = shape;
        table.cases.cylinder.wall_heat.wall_heat_model = wall;
        BatchSettings settings;
        settings.integrator = scheme;
        settings.form = BatchForm::lanes;
        const Columns lanes = run(table.cases, settings);
        settings.form = BatchForm::single;
        EXPECT_LT(difference(lanes, run(table.cases, settings)), 1e-10)
            << name_of(shape) << name_of(wall) << name_of(scheme);
      }
    }
  }
}

// Motored cycles have no pressure after a burn, weak ones too little of it: both run in lanes, to the last bit.
TEST(Batch, CasesOutsideOfTheSharedTablesRunInLanes) {
  std::vector<double> rows;
  for (const double fuel : {0.0, 0.05, 0.4}) {
    for (int i = 0; i < 40; ++i) {
      for (const double x : {fuel, -30.0 + i})
        rows.push_back(x);
    }
  }
  const Table table({"fuel_mg", "soc_cad"}, rows);
  const Columns shared = run(table.cases, BatchForm::shared), lanes = run(table.cases, BatchForm::lanes);
  for (std::size_t i = 0; i < shared.size(); ++i) {
    for (std::size_t row = 0; row < 40; ++row) {
      EXPECT_TRUE(shared[i][row] == lanes[i][row] || std::isnan(lanes[i][row])) << row;
    }
  }
  EXPECT_LT(difference(shared, run(table.cases, BatchForm::single)), 1e-6);
}

TEST(Batch, NumbersDoNotDependOnNeighboursThreadsOrInstructionSet) {
  for (const BatchForm form : {BatchForm::lanes, BatchForm::shared}) {
    std::vector<double> rows = mixed_points(70, 5);
    if (form == BatchForm::shared) {  // one point, many timings in no order
      for (std::size_t i = 0; i < 70; ++i) {
        for (const std::size_t k : {0U, 2U, 3U, 5U})
          rows[6 * i + k] = rows[k];
      }
    }
    const Table table(mixed_names, rows);
    BatchSettings settings;
    settings.form = form;
    settings.threads = 1;
    const Columns all = run(table.cases, settings);
    settings.set = InstructionSet::baseline;
    EXPECT_TRUE(same_bits(run(table.cases, settings), all));
    settings.threads = 2;
    settings.set = instruction_set();
    EXPECT_TRUE(same_bits(run(table.cases, settings), all));
    for (const std::size_t first : {1UL, 17UL, 64UL}) {  // a part of the rows
      const Table part(mixed_names, {rows.begin() + static_cast<std::ptrdiff_t>(6 * first), rows.end()});
      const Columns some = run(part.cases, settings);
      for (std::size_t i = 0; i < some.size(); ++i)
        EXPECT_TRUE(std::equal(some[i].begin(), some[i].end(), all[i].begin() + static_cast<std::ptrdiff_t>(first)));
    }
  }
}

TEST(Batch, ManyJobsOnTwoThreadsKeepTheirPlaces) {
  std::vector<double> timings;
  for (int i = 0; i < 9001; ++i)
    timings.push_back(-25.0 + 30.0 * ((i * 37) % 9001) / 9001.0);
  const Table table({"soc_cad"}, timings);
  BatchSettings settings;
  settings.threads = 2;
  const Columns columns = run(table.cases, settings);
  const auto fields = indicator_fields<double>();
  const auto found = std::ranges::find(fields, "ca50_cad", [](const auto& field) { return field.name; });
  const auto ca50 = static_cast<std::size_t>(found - fields.begin());
  for (std::size_t row = 0; row < timings.size(); ++row)
    EXPECT_NEAR(columns[ca50][row] - timings[row], columns[ca50][0] - timings[0], 1e-9);
}

TEST(Batch, GammaOfTemperatureRunsOneByOne) {
  Table table({"soc_cad"}, {-20.0, -6.0, 3.0});
  table.cases.cylinder.gas.gamma_model = GammaModel::linear;
  EXPECT_EQ(form_of(table.cases, BatchForm::lanes), BatchForm::single);
  EXPECT_TRUE(same_bits(run(table.cases, BatchForm::automatic), run(table.cases, BatchForm::single)));
}

// Leftovers of a job must not disturb the shared tables of the next one.
TEST(Batch, WeakCasesBetweenOthersDoNotDisturbTheSharedTables) {
  std::vector<double> rows;
  for (int i = 0; i < 9000; ++i) {
    const bool weak = i % 997 == 5;  // of another speed: its constants must not stay in the block
    for (const double x : {weak ? 2900.0 : 1400.0, weak ? 0.0 : 25.0, -25.0 + 0.004 * i})
      rows.push_back(x);
  }
  const Table table({"speed_rpm", "fuel_mg", "soc_cad"}, rows);
  EXPECT_LT(difference(run(table.cases, BatchForm::shared), run(table.cases, BatchForm::lanes)), 1e-8);
}

TEST(Batch, AMotoredCaseThatChangesThePointDoesNotKeepTheTablesOfTheLastOne) {
  std::vector<double> rows;
  for (const std::array<double, 3>& row : std::initializer_list<std::array<double, 3>>{
           {1200, 25, -6}, {2600, 0, -6}, {2600, 25, -6}, {2600, 25, -6}, {1200, 0, -6}, {1200, 25, -4}})
    rows.insert(rows.end(), row.begin(), row.end());
  const Table table({"speed_rpm", "fuel_mg", "soc_cad"}, rows);
  const Columns shared = run(table.cases, BatchForm::shared), single = run(table.cases, BatchForm::single);
  EXPECT_LT(difference(shared, single), 1e-6);
  EXPECT_GT(std::abs(single[0][2] - single[0][0]), 0.01);  // the points do differ
}

TEST(Batch, DerivativesInLanesAreThoseOfOneCycle) {
  const std::vector<std::string> along{"soc_cad", "fuel_mg",         "speed_rpm",       "burn_duration_cad",
                                       "wiebe_m", "wall_heat_scale", "trapped_mass_g",  "wall_temperature_k",
                                       "bore_mm", "gamma",           "second_fraction", "volumetric_efficiency"};
  Table table(mixed_names, mixed_points(19, 8));
  const std::vector<IndicatorMember> members = all_members();
  for (const BurnShape shape : {BurnShape::triangle, BurnShape::wiebe, BurnShape::double_wiebe}) {
    for (const WallHeatModel wall : {WallHeatModel::woschni, WallHeatModel::hohenberg, WallHeatModel::eichelberg}) {
      table.cases.cylinder.burn.burn_shape = shape;
      table.cases.cylinder.wall_heat.wall_heat_model = wall;
      Columns found(along.size() * members.size(), std::vector<double>(table.cases.size()));
      std::vector<double*> to;
      for (std::vector<double>& column : found)
        to.push_back(column.data());
      differentiate_batch(table.cases, {}, members, along, to);
      for (std::size_t row = 0; row < table.cases.size(); ++row) {
        Cylinder cylinder = table.cases.cylinder;
        OperatingPoint point;
        const double* x = table.values.data() + 6 * row;
        point.speed_rpm = x[0], point.fuel_mg = x[1], point.intake_pressure_kpa = x[2];
        point.intake_temperature_k = x[3], cylinder.wall_heat.wall_heat_scale = x[5];
        for (std::size_t i = 0; i < along.size(); ++i) {  // one by one: an optional that is asked for stays constant
          const Indicators<double> expected = sensitivities(cylinder, point, x[4], {along[i]}).indicators.front();
          for (std::size_t o = 0; o < members.size(); ++o) {
            const double wanted = expected.*members[o];
            const double now = found[i * members.size() + o][row];
            EXPECT_NEAR(now, wanted, 1e-8 * std::max(1.0, std::abs(wanted)))
                << along[i] << ' ' << indicator_fields<double>()[o].name << ' ' << name_of(shape) << name_of(wall);
          }
        }
      }
    }
  }
  EXPECT_THROW(differentiate_batch(table.cases, {}, members, {"ivc_cad"}, {}), ParameterError);
}

TEST(Batch, RefusesBeforeItWritesAndNamesTheCase) {
  const auto message = [](const BatchCases& cases) {
    std::vector<double> column(cases.size() + 1, 7.0);
    double* const to[] = {column.data()};
    const IndicatorMember members[] = {&Indicators<double>::p_max_bar};
    try {
      simulate_batch(cases, {}, members, to);
    } catch (const Error& e) {
      EXPECT_TRUE(std::ranges::all_of(column, [](double x) { return x == 7.0; }));
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  const Table late({"soc_cad"}, {-6.0, -7.0, 30.0});
  EXPECT_NE(message(late.cases).find("case 2: soc_cad = 30"), std::string::npos) << message(late.cases);
  const Table nan({"speed_rpm", "fuel_mg"}, {1500.0, 20.0, std::numeric_limits<double>::quiet_NaN(), 20.0});
  EXPECT_NE(message(nan.cases).find("case 1: speed_rpm"), std::string::npos) << message(nan.cases);
  const Table valves({"ivc_cad"}, {-140.0, 10.0});
  EXPECT_NE(message(valves.cases).find("case 1: ivc_cad"), std::string::npos) << message(valves.cases);
  const Table unknown({"boost"}, {1.0});
  EXPECT_NE(message(unknown.cases).find("must be one of soc_cad, burn_duration_cad"), std::string::npos);
  const Table twice({"soc_cad", "soc_cad"}, {1.0, 1.0});
  EXPECT_NE(message(twice.cases).find("stands there twice"), std::string::npos);
  const Table ragged({"soc_cad", "fuel_mg"}, {1.0, 1.0, 2.0});
  EXPECT_NE(message(ragged.cases).find("must be 2 for each case"), std::string::npos);
  EXPECT_THROW(parse_indicator("imep"), ParameterError);
  EXPECT_EQ(message(Table({"soc_cad"}, {-6.0}).cases), "accepted");
}

}  // namespace
}  // namespace mgdd::engine
