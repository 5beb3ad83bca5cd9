// The reference integrators in tests: all schemes by name, runs, what happened to a pair.
#pragma once

#include "benchmarks/reference.hpp"
#include "tests/support/balls.hpp"

#include <gtest/gtest.h>
#include <array>
#include <string>

namespace grainclock::tests {

using benchmarks::BranchChanges;
using benchmarks::ChangeKind;
using benchmarks::ReferenceRun;
using benchmarks::Scheme;

inline constexpr std::array kSchemes{Scheme::cvode_adams,      Scheme::cvode_bdf,    Scheme::erkstep,
                                     Scheme::arkstep_implicit, Scheme::arkstep_imex, Scheme::mristep};
/// Those whose accuracy the tolerance alone decides.
inline constexpr std::array kAdaptive{Scheme::cvode_adams, Scheme::cvode_bdf, Scheme::erkstep, Scheme::arkstep_implicit,
                                      Scheme::arkstep_imex};

inline std::string name_of(Scheme scheme) {
  constexpr const char* kNames[] = {"adams", "bdf", "erk", "implicit", "imex", "mri"};
  return kNames[static_cast<int>(scheme)];
}
inline std::string test_name(const testing::TestParamInfo<Scheme>& scheme) { return name_of(scheme.param); }

/// With roots.
inline ReferenceRun judged(Scheme scheme, double rtol, const core::State& start, const core::StepperSetup& setup,
                           double seconds, double slow_step = 1e-5) {
  return benchmarks::integrate({scheme, rtol, slow_step, true}, start, setup, seconds);
}

/// Time [s] of the only change of this kind.
inline double time_of(const ReferenceRun& run, ChangeKind kind) {
  double time = 0.0;
  int found = 0;
  for (const benchmarks::BranchChange& change : run.log) {
    if (change.kind != kind) continue;
    time = change.time;
    ++found;
  }
  EXPECT_EQ(found, 1) << "changes of kind " << static_cast<int>(kind);
  return time;
}

/// Expects exactly these changes, and as many restarts.
inline void expect_changes(const ReferenceRun& run, const BranchChanges& expected) {
  EXPECT_EQ(run.changes.touched, expected.touched);
  EXPECT_EQ(run.changes.lost, expected.lost);
  EXPECT_EQ(run.changes.clamped, expected.clamped);
  EXPECT_EQ(run.changes.unclamped, expected.unclamped);
  EXPECT_EQ(run.changes.out_of_reach, expected.out_of_reach);
  EXPECT_EQ(run.changes.into_reach, expected.into_reach);
  EXPECT_EQ(run.changes.parting, expected.parting);
  EXPECT_EQ(run.changes.nearing, expected.nearing);
  EXPECT_EQ(run.restarts, run.log.size());
  EXPECT_EQ(run.log.size(), expected.touched + expected.lost + expected.clamped + expected.unclamped +
                                expected.out_of_reach + expected.into_reach + expected.parting + expected.nearing);
}

/// Largest difference of content positions [m] and velocities [m/s].
struct Distance {
  double x = 0.0, v = 0.0;
};
inline Distance distance(const core::State& a, const core::State& b) {
  Distance out;
  for (std::size_t i = 0; i < a.size(); ++i) {
    out.x = std::max(out.x, (a.position[i] - b.position[i]).norm());
    out.v = std::max(out.v, (a.velocity[i] - b.velocity[i]).norm());
  }
  return out;
}

/// A ball above a floor of one fixed ball (id 1), `gap` [m] away (negative: overlap), with an upward speed [m/s].
inline core::State ball_on_floor(double gap, double up) {
  core::State state;
  state.add(0, core::Kind::content, {0.0, 0.0, 0.44 + gap}, {0.0, 0.0, up}, 0.22);
  state.add(1, core::Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.22);
  return state;
}
/// The same below a fixed ball, with an upward speed.
inline core::State ball_under_ceiling(double gap, double up) {
  core::State state = ball_on_floor(gap, up);
  state.position[0].z() *= -1.0;
  return state;
}

}  // namespace grainclock::tests
