// What selective stepping refuses, and how it fails.
#include "multirate/stepper.hpp"

#include "core/check.hpp"
#include "tests/support/packing.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace grainclock::multirate {
namespace {

using core::InputError;
using core::NumericsError;
using core::StepperSetup;

StepperSetup setup_of(double step) { return tests::silo_setup(core::Method::multirate, step, false); }

/// Expects every one of `words` in a message.
void expect_says(const std::string& message, std::initializer_list<std::string> words) {
  for (const std::string& word : words)
    EXPECT_NE(message.find(word), std::string::npos) << "no \"" << word << "\" in: " << message;
}

/// The message for a setup with one thing changed.
template <class Change>
std::string refusal(Change change) {
  StepperSetup setup = setup_of(1e-4);
  change(setup);
  return tests::message_of<InputError>([&] { make_multirate_stepper(tests::resting_silo(), setup); });
}

TEST(Refusals, NameTheKeyItsValueAndWhatIsOffered) {
  expect_says(refusal([](StepperSetup& s) { s.stepping.integrator = core::Integrator::lagged; }),
              {"stepping.integrator", "lagged", "predicted"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.integrator = core::Integrator::pece; }),
              {"stepping.integrator", "pece", "predicted"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.dashpot = core::Dashpot::relaxed; }),
              {"stepping.dashpot", "relaxed", "explicit"});
  for (const core::Interface its : {core::Interface::impulse, core::Interface::frozen}) {
    expect_says(refusal([its](StepperSetup& s) { s.stepping.interface = its; }),
                {"stepping.events = true", std::string(name(its)), "events = false", "accumulate"});
  }
  expect_says(refusal([](StepperSetup& s) { s.first_impact = true; }), {"first_impact", "uniform"});
}

TEST(Refusals, NameNumbersOutOfRange) {
  expect_says(refusal([](StepperSetup& s) { s.stepping.levels = 0; }), {"stepping.levels = 0", "1 to 12"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.levels = 13; }), {"stepping.levels = 13", "1 to 12"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.limiter = 0; }), {"stepping.limiter = 0", "at least 1"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.tolerance = 0.0; }), {"stepping.tolerance = 0", "above 0"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.tolerance = -1e-4; }), {"stepping.tolerance = -0.0001"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.tolerance = std::numeric_limits<double>::quiet_NaN(); }),
              {"stepping.tolerance = nan"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.step.reset(); }), {"step"});
  expect_says(refusal([](StepperSetup& s) { s.stepping.step = 0.0; }), {"step"});
}

TEST(Refusals, LimitsThemselvesAreOffered) {
  for (const int levels : {1, 12}) {
    StepperSetup setup = setup_of(1e-4);
    setup.stepping.levels = levels;
    setup.stepping.limiter = 1;
    EXPECT_NO_THROW(make_multirate_stepper(tests::resting_silo(), setup)->advance(2));
  }
}

constexpr double kFarTooLarge = 2e-3;  // 18 times the stability bound at the wall, 6 times that of the bulk

TEST(Failures, ACoarsestStepFarBeyondTheBoundBlowsUpWithADiagnosis) {
  StepperSetup setup = setup_of(kFarTooLarge);
  setup.stepping.levels = 1;
  const auto stepper = make_multirate_stepper(tests::resting_silo(), setup);
  const std::string message = tests::message_of<NumericsError>([&] { stepper->advance(2000); });
  expect_says(message, {"ball ", "step", "0.002 s", "use a smaller step"});
}

TEST(Failures, FinerLevelsSaveTheSameCoarsestStep) {
  const auto fine = core::make_uniform_stepper(tests::resting_silo(), tests::silo_setup(core::Method::uniform, 2e-5, false));
  const auto stepper = make_multirate_stepper(tests::resting_silo(), setup_of(kFarTooLarge));
  fine->advance(10000);
  stepper->advance(100);
  // An unstable step would heat at once; the packing's own motion differs by what chaos makes of the steps in 0.2 s.
  EXPECT_NEAR(stepper->energies().kinetic, fine->energies().kinetic, 0.1 * fine->energies().kinetic);
}

TEST(Failures, ABallThatMayPassThroughOthersIsNamed) {
  core::State state = tests::resting_silo();
  state.position[7] = core::Vec3(0.0, 0.0, 5.0);
  state.velocity[7] = core::Vec3(0.0, 0.0, 1000.0);  // 0.1 m in a step
  const auto stepper = make_multirate_stepper(state, setup_of(1e-4));
  EXPECT_NO_THROW(stepper->advance(2));
  state.velocity[7].z() = 1200.0;
  const auto faster = make_multirate_stepper(state, setup_of(1e-4));
  const std::string message = tests::message_of<NumericsError>([&] { faster->advance(50); });
  expect_says(message, {"ball 7 at", "moves by 0.12 m", "use a smaller step"});
}

TEST(Failures, ABallThatLeavesTheDomainIsNamed) {
  StepperSetup setup = setup_of(1e-4);
  core::State state = tests::resting_silo();
  state.position[7] = core::Vec3(0.0, 0.0, 10.0);
  state.velocity[7] = core::Vec3(0.0, 0.0, 60.0);
  const auto stepper = make_multirate_stepper(state, setup);
  const std::string message = tests::message_of<NumericsError>([&] { stepper->advance(10000); });
  expect_says(message, {"ball 7 left the domain"});
}

}  // namespace
}  // namespace grainclock::multirate
