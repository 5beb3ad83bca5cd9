#include "benchmarks/compare.hpp"

#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

/// The number after `"key": ` in a report's JSON; the first one of that name.
double number(const silo::Report& report, const std::string& key) {
  const std::string json = report.json(), wanted = fmt::format("\"{}\": ", key);
  const std::size_t at = json.find(wanted);
  if (at == std::string::npos) ADD_FAILURE() << "no " << key << " in " << json;
  return at == std::string::npos ? 0.0 : std::stod(json.substr(at + wanted.size()));
}

/// Four balls a metre apart, pushed along y by `moved` [m] at 2 m/s.
State row(double moved) {
  State state;
  for (int ball = 0; ball < 4; ++ball) {
    state.add(ball, Kind::content, Vec3(ball, moved, 1), moved > 0.0 ? Vec3(0, 2, 0) : Vec3::Zero(), 0.2);
  }
  state.add(9, Kind::wall, Vec3(0, 0, 0), Vec3::Zero(), 0.2);
  return state;
}

class Compare : public testing::Test {
 protected:
  std::string file(const std::string& name, const State& state) const {
    core::write_state(scratch_ / name, state);
    return scratch_ / name;
  }
  tests::Scratch scratch_;
};

TEST_F(Compare, StatesAreFarApartByTheHandComputedDistances) {
  State off = row(0.5);
  off.position[2] += Vec3(0.03, 0, 0.04);
  const silo::Report report = compare(file("a.h5", off), file("b.csv", row(0.5)), {});
  // A few roundings of coordinates of order one.
  EXPECT_EQ(number(report, "common"), 4.0);
  EXPECT_NEAR(number(report, "distance_rms"), 0.025, 1e-14);
  EXPECT_EQ(number(report, "distance_median"), 0.0);
  EXPECT_NEAR(number(report, "distance_p99"), 0.97 * 0.05, 1e-14);  // place 2.97 of 0..3
  EXPECT_NEAR(number(report, "distance_max"), 0.05, 1e-14);
  EXPECT_EQ(report.json().find("\"position\""), std::string::npos) << "no start, no scale";
}

TEST_F(Compare, AStartGivesTheErrorsOfStudies) {
  State off = row(0.5);
  off.position[2] += Vec3(0.03, 0, 0.04);
  CompareOptions options;
  options.start = file("start.h5", row(0.0));
  const silo::Report report = compare(file("a.h5", off), file("b.h5", row(0.5)), options);
  EXPECT_NEAR(number(report, "rms"), 0.05, 1e-14);  // 0.1 displacements for one of four; the position's comes first
  EXPECT_NEAR(number(report, "displacement"), 0.5, 1e-14);
  EXPECT_EQ(number(report, "missing"), 0.0);
}

TEST_F(Compare, BallsThatTheResultLostAreCounted) {
  State lost;
  for (std::size_t i = 0; i < 3; ++i) lost.add(row(0.5).id[i], Kind::content, row(0.5).position[i], Vec3(0, 2, 0), 0.2);
  CompareOptions options;
  options.start = file("start.h5", row(0.0));
  const silo::Report report = compare(file("a.h5", lost), file("b.h5", row(0.5)), options);
  EXPECT_EQ(number(report, "common"), 3.0);
  EXPECT_EQ(number(report, "missing"), 1.0);
}

TEST_F(Compare, StatesOfDifferentScenesAreRefusedByName) {
  State other;
  other.add(77, Kind::content, Vec3::Zero(), Vec3::Zero(), 0.2);
  const std::string a = file("a.h5", other), b = file("b.h5", row(0.5));
  const std::string message = tests::message_of<core::InputError>([&] { compare(a, b, {}); });
  EXPECT_NE(message.find("a.h5"), std::string::npos) << message;
  EXPECT_NE(message.find("no content balls in common"), std::string::npos) << message;
}

}  // namespace
}  // namespace grainclock::benchmarks
