// A short run through phases that differ in stiffness and outlet, the way a silo is filled, opened and shut.
#pragma once

#include "core/snapshot.hpp"
#include "silo/run.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace grainclock::tests {

/// 72 balls in a tray whose floor is a plug, its rim a wall.
inline core::State gated_tray() {
  core::State state = tray(5, 8, 1);
  for (std::size_t i = 0; i < state.size(); ++i) {
    const core::Vec3& x = state.position[i];
    const bool inside = x[0] > 0.1 && x[0] < 2.1 && x[1] > 0.1 && x[1] < 2.1;
    if (state.kind[i] == core::Kind::wall && x[2] == 0.0 && inside) state.kind[i] = core::Kind::plug;
  }
  return state;
}

/// The scene of gated_run(). Only the first phase tells when it ends.
constexpr const char* kGatedScene = R"(
[initial]
state = "tray.h5"
[contact]
k_ball = 1e7
k_wall = 1e9
c_ball = 2e4
c_wall = 2e5
[domain]
outlet_z = -1.0
[stepping]
method = "uniform"
step = 2e-5
[output]
every = 0.1
[[phase]]
name = "settle"
duration = 0.2
contact = { k_wall = 1e8, c_wall = 9e4 }
[[phase]]
name = "flow"
until = "discharged:0.2"
max_duration = 2.0
outlet = "open"
[[phase]]
name = "shut"
until = "rest"
max_duration = 0.3
contact = { k_ball = 3e7 }
[[phase]]
name = "empty"
until = "empty"
max_duration = 2.0
outlet = "open"
)";

/// Runs it into SCRATCH/run and gives that path; `overrides` as of --set.
inline std::string gated_run(const Scratch& scratch, const std::vector<std::string>& overrides = {}) {
  core::write_state(scratch / "tray.h5", gated_tray());
  testing::internal::CaptureStdout();
  silo::run_scene(core::read_scene(scratch.file("gated.toml", kGatedScene), overrides), scratch / "run", {});
  testing::internal::GetCapturedStdout();
  return scratch / "run";
}

}  // namespace grainclock::tests
