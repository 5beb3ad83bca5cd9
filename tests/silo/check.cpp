// What `check` and the start of each phase warn of.
#include "silo/check.hpp"

#include "core/critical_step.hpp"
#include "core/scene.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/closed_forms.hpp"

#include <gtest/gtest.h>

namespace grainclock::silo {
namespace {

constexpr double kStiffness = 1e7, kRadius = 0.2;  // N/m, m

/// The report of two balls in contact.
std::string report_at(core::Method method, core::Interface interface, double damping_ratio) {
  core::Materials materials;
  materials.ball = {kStiffness, tests::dashpot(kStiffness, 0.5 * materials.mass(kRadius), damping_ratio)};
  core::StepperSetup setup = tests::weightless(materials, 1e-4);
  setup.stepping.method = method;
  setup.stepping.interface = interface;
  setup.stepping.events = false;
  setup.stepping.levels = 2;
  const core::State state = tests::two_balls(materials, kRadius, kRadius, -1e-4, 0.0, core::Kind::content);
  core::Phase phase;
  phase.stepping = setup.stepping;
  return phase_report(phase, state, setup).text(0);
}

TEST(PhaseReport, WarnsWhereStepsOfDifferentLengthsMayResonate) {
  using core::Interface, core::Method;
  // Half and twice the damping ratios at which tests/multirate/ see the growth of each strategy end.
  for (const auto& [interface, least] : {std::pair{Interface::accumulate, 0.02}, {Interface::frozen, 0.02},
                                         {Interface::extrapolate, 0.1}, {Interface::impulse, 0.3}}) {
    EXPECT_NE(report_at(Method::multirate, interface, 0.5 * least).find("may resonate"), std::string::npos) << name(interface);
    EXPECT_EQ(report_at(Method::multirate, interface, 2.0 * least).find("may resonate"), std::string::npos) << name(interface);
    EXPECT_EQ(report_at(Method::uniform, interface, 0.5 * least).find("may resonate"), std::string::npos) << name(interface);
  }
}

TEST(CheckScene, SaysWhatSelectiveStepsWillGainAndThatTheyWillNotPayOnSmallScenes) {
  // The studies' smallest scenes: clocks say a third of the speed of uniform steps at best, benchmarks/README.md.
  for (const std::string name : {"pair", "chain", "pile"}) {
    const core::Scene scene = core::read_scene(std::string(GRAINCLOCK_SOURCE) + "/benchmarks/scenes/" + name + ".toml");
    const std::string said = check_scene(scene, 1).text();
    EXPECT_NE(said.find("predicted gain over those, contact evaluations"), std::string::npos) << said;
    EXPECT_NE(said.find("coarse steps tried out for that"), std::string::npos) << said;
    EXPECT_NE(said.find("multi-rate will not pay in this state"), std::string::npos) << said;
  }
}

}  // namespace
}  // namespace grainclock::silo
