#include "core/state.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

namespace grainclock::core {
namespace {

State two_balls() {
  State state;
  state.add(3, Kind::content, {0.0, 0.0, 1.0}, {0.0, 0.0, -1.0}, 0.2);
  state.add(7, Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.3);
  return state;
}

// The message when `spoil` was applied to two good balls; empty if accepted.
std::string complaint(const std::function<void(State&)>& spoil) {
  State state = two_balls();
  spoil(state);
  try {
    validate(state, "start.csv");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

void expect_complaint(const std::function<void(State&)>& spoil, const std::string& ball) {
  const std::string text = complaint(spoil);
  EXPECT_EQ(text.rfind("start.csv: ", 0), 0u) << text;
  EXPECT_NE(text.find(ball), std::string::npos) << text;
}

TEST(State, AddKeepsEveryArrayTogether) {
  const State state = two_balls();
  EXPECT_EQ(state.size(), 2u);
  EXPECT_EQ(state.count(Kind::content), 1u);
  EXPECT_EQ(state.count(Kind::wall), 1u);
  EXPECT_EQ(state.count(Kind::plug), 0u);
  EXPECT_EQ(state.position[0][2], 1.0);
  EXPECT_EQ(state.velocity[0][2], -1.0);
  EXPECT_EQ(state.radius[1], 0.3);
}

TEST(State, KindNamesAreThoseOfTheCsvFormat) {
  EXPECT_EQ(name(Kind::content), "content");
  EXPECT_EQ(name(Kind::wall), "wall");
  EXPECT_EQ(name(Kind::plug), "plug");
}

TEST(State, GoodStateIsAccepted) {
  EXPECT_EQ(complaint([](State&) {}), "");
  EXPECT_EQ(complaint([](State& state) { state = State{}; }), "");
  EXPECT_EQ(complaint([](State& state) { state.level = {0, 1}; }), "");
}

TEST(State, BadBallIsNamedWithTheSource) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  expect_complaint([](State& s) { s.id[1] = 3; }, "ball 3 appears twice");
  expect_complaint([](State& s) { s.id[1] = 2; }, "ball 2 follows ball 3");
  expect_complaint([](State& s) { s.position[0][1] = kNan; }, "ball 3");
  expect_complaint([](State& s) { s.velocity[0][1] = kInf; }, "ball 3");
  expect_complaint([](State& s) { s.radius[1] = 0.0; }, "ball 7");
  expect_complaint([](State& s) { s.radius[1] = -0.1; }, "ball 7");
  expect_complaint([](State& s) { s.radius[1] = kNan; }, "ball 7");
  expect_complaint([](State& s) { s.velocity[1][0] = 1e-30; }, "wall ball 7");
  expect_complaint([](State& s) { s.kind[0] = static_cast<Kind>(9); }, "ball 3 has kind number 9");
  expect_complaint([](State& s) { s.time = kNan; }, "time");
}

TEST(State, ArraysOfDifferentLengthAreNamed) {
  expect_complaint([](State& s) { s.radius.pop_back(); }, "1 values of radius for 2 balls");
  expect_complaint([](State& s) { s.velocity.clear(); }, "velocity");
  expect_complaint([](State& s) { s.level = {1}; }, "level");
  expect_complaint([](State& s) { s.evaluated_position.resize(3); }, "evaluated_position");
}

}  // namespace
}  // namespace grainclock::core
