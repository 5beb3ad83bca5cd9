#include "benchmarks/trajectories_rows.hpp"

#include "core/check.hpp"
#include "tests/support/scratch.hpp"

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

/// One ball that falls by 1 m, off by `error` at the end.
State ball_at(double z) {
  State state;
  state.add(0, Kind::content, Vec3(0, 0, z), Vec3(0, 0, -1), 0.2);
  return state;
}

Outcome outcome(double error, double wall_s, const std::string& host = "here") {
  Outcome made;
  made.method_used = "uniform";
  made.step = 1e-5;
  made.steps = 100;
  made.costs.contact_evaluations = static_cast<std::uint64_t>(1000.0 / error);
  made.wall_s = wall_s;
  made.end = ball_at(1.0 + error);
  made.made_by.host = host;
  return made;
}

Point uniform(const std::string& name, bool events) {
  Point point;
  point.name = name;
  point.stepping.method = core::Method::uniform;
  point.stepping.events = events;
  point.stepping.step = 1e-5;
  return point;
}

class StudyRows : public testing::Test {
 protected:
  StudyRows() {
    start_.name = "start";
    start_.state = ball_at(2.0);
    runs_.points.push_back({uniform("plain", false), {outcome(1e-2, 10.0)}});
    runs_.points.push_back({uniform("ours", true), {outcome(1e-2, 2.0), outcome(1e-2, 3.0), outcome(1e-2, 7.0)}});
    runs_.reference = {uniform("reference", true), {outcome(1e-9, 100.0)}};
    runs_.reference.outcomes.front().end = ball_at(1.0);
    runs_.check = {uniform("reference_check", true), {outcome(1e-5, 50.0)}};
  }
  std::vector<Row> rows() const { return rows_of(runs_, std::nullopt); }

  StartState start_;
  StartRuns runs_{start_, {}, {}, {}};
};

TEST_F(StudyRows, ClocksAreMediansAndGainsRatios) {
  const auto all = rows();
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(*all[1].wall_s, 3.0);
  EXPECT_NEAR(*all[0].error_rms, 1e-2, 1e-14);            // rounding of a position of 1 m
  EXPECT_NEAR(*all[1].measured_gain, 10.0 / 3.0, 1e-12);  // rounding through log and pow
  EXPECT_NEAR(*all[1].counted_gain, 1.0, 1e-12);          // the same
  EXPECT_EQ(all[2].status, "ok");
  EXPECT_FALSE(all[2].error_rms);
}

TEST_F(StudyRows, ClocksOfDifferentMachinesGiveNoGain) {
  runs_.points[1].outcomes[2].made_by.host = "there";
  const auto all = rows();
  EXPECT_EQ(all[1].host, "here; there");
  for (const Row& row : all) {
    EXPECT_FALSE(row.measured_gain);
    EXPECT_FALSE(row.gain_events_measured);
  }
  EXPECT_NEAR(*all[1].counted_gain, 1.0, 1e-12);  // rounding through log and pow
}

TEST_F(StudyRows, AReferenceElsewhereSpoilsNoGain) {
  runs_.reference.outcomes.front().made_by.host = "there";
  EXPECT_TRUE(rows()[1].measured_gain);
}

TEST_F(StudyRows, TheReferenceMustBeTenTimesAsGoodAsTheBestPoint) {
  runs_.check.outcomes.front().end = ball_at(1.0 + 0.99e-3);
  EXPECT_EQ(rows()[2].status, "ok");
  runs_.check.outcomes.front().end = ball_at(1.0 + 1.01e-3);
  EXPECT_EQ(rows()[2].status.find("too coarse: twice its step"), 0u) << rows()[2].status;
  runs_.reference.point.sundials = ReferenceSettings{};
  EXPECT_EQ(rows()[2].status.find("too coarse: 10 times its rtol"), 0u) << rows()[2].status;
  runs_.check.outcomes.front().status = "failed: blew up";
  EXPECT_EQ(rows()[2].status.find("unchecked"), 0u) << rows()[2].status;
}

TEST_F(StudyRows, SweepsAreEvaluationsOverAllPairsWhateverTheReferenceIs) {
  // 100 steps with 1e12 evaluations: 1e10 pairs.
  Outcome& reference = runs_.reference.outcomes.front();
  reference.levels.listed = 9e9;                                       // at the end
  EXPECT_NEAR(*rows()[2].sweeps, 100.0, 1e-6);                         // truncation of 1000 / 1e-9 evaluations
  runs_.reference.point.stepping.integrator = core::Integrator::pece;  // two evaluations in each step
  EXPECT_NEAR(*rows()[2].sweeps, 1e12 / 9e9, 1e-6);
  runs_.reference.point.sundials = ReferenceSettings{};
  EXPECT_NEAR(*rows()[2].sweeps, 1e12 / 9e9, 1e-6);
}

TEST_F(StudyRows, BranchChangesAreCountedInTotalWithRootsOnly) {
  Point point = uniform("cvode", true);
  point.sundials = ReferenceSettings{};
  Outcome made = outcome(1e-3, 1.0);
  made.changes = {1, 2, 3, 4, 5, 6, 7, 8};
  made.restarts = 36;
  runs_.points.push_back({point, {made}});
  EXPECT_FALSE(rows()[2].branch_changes);
  runs_.points.back().point.sundials->roots = true;
  EXPECT_EQ(*rows()[2].branch_changes, 36.0);
  EXPECT_EQ(*rows()[2].restarts, 36.0);
  EXPECT_EQ(rows()[2].roots, "true");
  EXPECT_FALSE(rows()[2].momentum_residual);
}

TEST(TrajectoriesFile, OutcomesReadBackAsTheyWere) {
  const tests::Scratch scratch;
  Outcome written = outcome(1e-3, 1.25);
  written.changes = {1, 2, 3, 4, 5, 6, 7, 8};
  written.momentum_residual = 1e-15;
  written.levels = {{1e-5, 2e-5}, {3.5, 4.5}, {5.5, 6.5}, 7.0};
  written.wall_force = {1.0, 2.0};
  const core::Scene scene;
  write_outcome(scratch / "a.h5", written, {scene, 3}, true);
  const Outcome read = read_outcome(scratch / "a.h5");
  EXPECT_EQ(read.status, "ok");
  EXPECT_EQ(read.costs.contact_evaluations, written.costs.contact_evaluations);
  EXPECT_EQ(read.changes.nearing, 8u);
  EXPECT_EQ(read.momentum_residual, written.momentum_residual);
  EXPECT_FALSE(read.energy_residual.has_value());
  EXPECT_EQ(read.levels.contacts, written.levels.contacts);
  EXPECT_EQ(read.levels.listed, 7.0);
  EXPECT_EQ(read.wall_s, 1.25);
  EXPECT_EQ(read.wall_force, written.wall_force);
  EXPECT_EQ(read.end.position.at(0), written.end.position.at(0));
  EXPECT_EQ(read.made_by.threads, 3);
  EXPECT_FALSE(read.made_by.host.empty());
  write_outcome(scratch / "b.h5", written, {scene, 1}, false);
  EXPECT_EQ(read_outcome(scratch / "b.h5").end.size(), 0u);
  EXPECT_THROW(read_outcome(scratch / "none.h5"), core::FileError);
}

}  // namespace
}  // namespace grainclock::benchmarks
