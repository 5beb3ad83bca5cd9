#include "silo/frame_contacts.hpp"

#include "core/check.hpp"
#include "silo/observables.hpp"
#include "tests/support/gated_run.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using tests::Scratch;

double largest(const std::vector<double>& values) { return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end()); }

TEST(PhaseLaws, PhasesOverrideTheScenesContact) {
  const auto laws = phase_laws(toml::parse(R"(
[material]
density = 900.0
[contact]
k_ball = 1.0
k_wall = 2.0
c_ball = 3.0
c_wall = 4.0
tension = true
cohesion = 5.0
[[phase]]
duration = 1.5
outlet = "closed"
[phase.contact]
k_wall = 7.0
tension = false
[[phase]]
until = "empty"
max_duration = 10.0
outlet = "open"
[[phase]]
duration = 0.5
outlet = "closed"
)"));
  ASSERT_EQ(laws.size(), 3u);
  EXPECT_EQ(laws[0].materials.density, 900.0);
  EXPECT_EQ(laws[0].materials.wall.k, 7.0);
  EXPECT_EQ(laws[0].materials.wall.c, 4.0);
  EXPECT_FALSE(laws[0].materials.tension);
  EXPECT_EQ(laws[1].materials.wall.k, 2.0);
  EXPECT_EQ(laws[1].materials.ball.k, 1.0);
  EXPECT_EQ(laws[1].materials.ball.c, 3.0);
  EXPECT_TRUE(laws[1].materials.tension);
  EXPECT_EQ(laws[1].materials.cohesion, 5.0);
  EXPECT_FALSE(laws[0].outlet_open);
  EXPECT_TRUE(laws[1].outlet_open);
  // A phase that ends by a condition may end at once, or last its longest time.
  EXPECT_EQ(laws[0].earliest, 0.0);
  EXPECT_EQ(laws[0].latest, 1.5);
  EXPECT_EQ(laws[1].earliest, 1.5);
  EXPECT_EQ(laws[1].latest, 11.5);
  EXPECT_EQ(laws[2].earliest, 1.5);
  EXPECT_EQ(laws[2].latest, 12.0);
}

TEST(PhaseLaws, DamagedScenesAreTold) {
  for (const char* text : {"", "[contact]\n[material]\n", "[contact]\n[material]\n[[phase]]\nname = \"a\"\n", "[contact]\n[material]\nphase = [1]\n"})
    EXPECT_THROW(phase_laws(toml::parse(text)), core::FileError) << text;
}

TEST(FrameContacts, GiveTheEnergiesAndForcesThatTheRunRecorded) {
  const Scratch scratch;
  const RunReader run(tests::gated_run(scratch));
  const ContactFinder finder(run);
  int open = 0, closed_again = 0;
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) {
    const State state = run.state(frame);
    const FrameContacts found = finder.contacts(frame, state);
    ASSERT_EQ(static_cast<double>(found.contacts.size()), run.observable("contacts", frame)->at(0)) << state.time;
    const auto wanted = *run.observable(kWallForceByLayer, frame);
    const auto force = wall_force_by_layer(state, found.contacts, *layers_of(state));
    // Rounding: an overlap of balls some metres from the origin is known to 1e-15 m, hence a force to 1e9 times that.
    for (std::size_t k = 0; k < wanted.size(); ++k) ASSERT_NEAR(force[k], wanted[k], 1e-5 + 1e-9 * largest(wanted)) << state.time;
    if (state.time > 0.2 + 1e-9 && !found.contacts.empty()) (found.outlet_open ? open : closed_again) += 1;
    // By hand: the push of contacts at rest or nearly so is k d + c d' with the phase's k and c.
    for (const core::Contact& c : found.contacts) {
      const bool soft = state.time <= 0.2 + 1e-9, hard = !soft && !found.outlet_open;
      const double k = c.other != Kind::content ? (soft ? 1e8 : 1e9) : hard ? 3e7 : 1e7, damper = c.other == Kind::content ? 2e4 : soft ? 9e4 : 2e5;
      ASSERT_NEAR(c.force.norm(), std::max(0.0, k * c.overlap + damper * c.rate), 1e-9 * (1.0 + k * std::abs(c.overlap) + damper * std::abs(c.rate)))  // rounding
          << state.time;
    }
  }
  // In some frames all balls fly, which tells nothing of the outlet; in these they touch.
  EXPECT_GT(open, 2);
  EXPECT_GT(closed_again, 1);
}

/// The same run as a version that did not record phases would have left it.
std::string without_phases(const Scratch& scratch, const std::string& path) {
  const RunReader run(path);
  const std::string older = scratch / "older";
  std::filesystem::create_directory(older);
  const State start = RunFile::start_in(path);
  RunFile file(older, start, {core::read_scene(scratch / "gated.toml", {}), 1, edges(*layers_of(start))});
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) {
    Frame same{run.times()[static_cast<std::size_t>(frame)], run.step(frame), run.state(frame), {}};
    for (const std::string& name : run.observables()) {
      if (name == "phase") continue;
      const std::vector<double> values = *run.observable(name, frame);
      same.observables.push_back({name, "", values.size() == 1 ? std::vector<std::uint64_t>{} : std::vector<std::uint64_t>{values.size()}, values});
    }
    file.add(same);
  }
  file.flush();
  return older;
}

TEST(FrameContacts, OlderRunsAreMatchedByTheirEnergiesAndForces) {
  const Scratch scratch;
  const std::string path = tests::gated_run(scratch);
  const RunReader run(path), older(without_phases(scratch, path));
  ASSERT_FALSE(older.observable("phase", 0));
  const ContactFinder finder(run), matching(older);
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) {
    const State state = run.state(frame);
    const FrameContacts wanted = finder.contacts(frame, state), found = matching.contacts(frame, state);
    ASSERT_EQ(found.contacts.size(), wanted.contacts.size());
    for (std::size_t k = 0; k < wanted.contacts.size(); ++k) EXPECT_EQ(found.contacts[k].force, wanted.contacts[k].force) << state.time;
    EXPECT_TRUE(wanted.contacts.empty() || found.outlet_open == wanted.outlet_open) << state.time;
  }
}

TEST(FrameContacts, EmptyFramesHaveNone) {
  const Scratch scratch;
  const RunReader run(tests::gated_run(scratch));
  const State state = run.state(run.frames() - 1);
  ASSERT_EQ(state.count(Kind::content), 0u);
  const FrameContacts found = ContactFinder(run).contacts(run.frames() - 1, state);
  EXPECT_TRUE(found.contacts.empty());
  EXPECT_TRUE(found.outlet_open);
}

}  // namespace
}  // namespace grainclock::silo
