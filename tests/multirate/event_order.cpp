// Order of selective steps across events, at contacts between levels: about one as the trapezoid rule leaves them, two
// with event correction (tests/core/orders.cpp has the same for uniform steps).
#include "multirate/stepper.hpp"

#include "tests/support/balls.hpp"
#include "tests/support/cage.hpp"
#include "tests/support/closed_forms.hpp"
#include "tests/support/order.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <ostream>
#include <string>

namespace grainclock::multirate {
namespace {

struct Terms {
  core::Interface interface;
  bool tension;
};
void PrintTo(const Terms& terms, std::ostream* out) { *out << name(terms.interface) << ", tension " << terms.tension; }

/// Copies of three balls in line, far apart: a light fast one runs into a heavy one, which touches a third meanwhile. The
/// short collision asks for short steps of its balls, the long one does not: its contact closes between levels, and
/// opens when they are all coarse. Each copy's touches come at phases of their own within a step.
struct Strikes {
  static constexpr int kCopies = 32, kBalls = 3;
  static constexpr double kRadius[kBalls] = {0.08, 0.25, 0.3};  // m, masses of 2.7, 82 and 141 kg
  static constexpr double kSpeed[kBalls] = {4.0, 1.0, 0.0};     // m/s
  static constexpr double kShort = 6e-4, kLong = 1.1e-3;        // s, when collisions begin; of 1.6 and 7.2 ms
  static constexpr double kEnd = 0.0096;                        // s, all have parted
  static constexpr double kCoarsest = 8e-5, kTolerance = 7.5e-4;

  core::State start;
  core::StepperSetup setup;

  /// `division`: of the largest coarsest step. Steps may be as long as the root of the tolerance: levels stay.
  Strikes(const Terms& terms, bool events, int division) {
    constexpr double k = 1e7;  // N/m
    const core::Materials& m = setup.materials;
    const double heavy = 1.0 / (1.0 / m.mass(kRadius[1]) + 1.0 / m.mass(kRadius[2]));
    setup.materials.ball = {k, tests::dashpot(k, heavy, 0.15)};  // damping ratio 0.67 for the light ball
    setup.materials.tension = terms.tension;
    setup.gravity = core::Vec3::Zero();
    setup.stepping.interface = terms.interface;
    setup.stepping.events = events;
    setup.stepping.step = kCoarsest / division;
    setup.stepping.tolerance = kTolerance / (division * division);
    setup.stepping.levels = 4;
    for (int copy = 0; copy < kCopies; ++copy) {
      // Multiples of irrational numbers: even phases within the steps of every level.
      const auto touch = [&](double after, double by) {
        return after + std::fmod((copy + 0.5) * by, 1.0) * kCoarsest / division;
      };
      const double gap[kBalls] = {0.0, (kSpeed[0] - kSpeed[1]) * touch(kShort, 0.618034),
                                  (kSpeed[1] - kSpeed[2]) * touch(kLong, 0.754878)};
      core::Vec3 at(3.0 * copy, 0.0, 0.0);
      for (int ball = 0; ball < kBalls; ++ball) {
        if (ball > 0) at += (kRadius[ball - 1] + gap[ball] + kRadius[ball]) * tests::oblique();
        start.add(kBalls * copy + ball, core::Kind::content, at, kSpeed[ball] * tests::oblique(), kRadius[ball]);
      }
    }
  }
};

/// What a run left.
struct Left {
  std::array<double, Strikes::kBalls> error;  // relative to 1 m/s, and what that makes in the time; rms over the copies
  int between_levels = 0;                     // touching contacts between levels, summed over coarsest steps
  std::size_t open = 0;                       // contacts at the end
  std::uint64_t events = 0;
};

Left run(const Terms& terms, bool events, int division) {
  constexpr int kFiner = 128;  // the reference's step is a 16th of the finest here: its error a 256th
  const Strikes strikes(terms, events, division);
  core::StepperSetup fine = strikes.setup;
  fine.stepping.method = core::Method::uniform;
  fine.stepping.events = true;
  fine.stepping.step = *strikes.setup.stepping.step / kFiner;
  const auto steps = std::lround(Strikes::kEnd / *strikes.setup.stepping.step);
  const auto reference = core::make_uniform_stepper(strikes.start, fine);
  reference->advance(steps * kFiner);
  const core::State exact = reference->state();

  Left left;
  const auto stepper = make_multirate_stepper(strikes.start, strikes.setup);
  const core::Vec3 before = stepper->energies().momentum;
  for (std::int64_t k = 0; k < steps; ++k) {
    stepper->advance(1);
    // Rounding of some thousand kicks; what balls are still owed in mid-step is in it.
    EXPECT_LE((stepper->energies().momentum - before).norm(), 1e-13 * before.norm()) << "after coarse step " << k;
    const std::vector<int> levels = tests::levels_of(*stepper);  // ids count from 0
    for (const core::Contact& c : stepper->contacts()) {
      left.between_levels += levels[static_cast<std::size_t>(c.i)] != levels[static_cast<std::size_t>(c.j)];
    }
  }
  left.open = stepper->contacts().size();
  left.events = stepper->costs().events;
  EXPECT_EQ(stepper->costs().missed_contacts, 0U);

  const core::State found = stepper->state();
  std::array<tests::Rms, Strikes::kBalls> error;
  for (std::size_t i = 0; i < found.size(); ++i) {
    error[i % Strikes::kBalls].add(std::hypot((found.position[i] - exact.position[i]).norm() / Strikes::kEnd,
                                              (found.velocity[i] - exact.velocity[i]).norm()));
  }
  for (std::size_t ball = 0; ball < error.size(); ++ball) left.error[ball] = error[ball].value();
  return left;
}

class SelectiveStepsAcrossEvents : public testing::TestWithParam<Terms> {
 protected:
  /// Order of each ball's error.
  std::array<double, Strikes::kBalls> orders(bool events) {
    std::vector<double> step;
    std::array<std::vector<double>, Strikes::kBalls> error;
    for (const int division : {1, 2, 4, 8}) {
      SCOPED_TRACE(testing::Message() << "steps divided by " << division);
      const Left left = run(GetParam(), events, division);
      EXPECT_GT(left.between_levels, 5 * Strikes::kCopies * division);
      EXPECT_EQ(left.open, 0U);
      EXPECT_EQ(left.events >= 4U * Strikes::kCopies, events);  // both contacts close and open
      step.push_back(1.0 / division);
      for (std::size_t ball = 0; ball < error.size(); ++ball) error[ball].push_back(left.error[ball]);
    }
    std::array<double, Strikes::kBalls> out;
    for (std::size_t ball = 0; ball < error.size(); ++ball) out[ball] = tests::fitted_order(step, error[ball]);
    return out;
  }
};

// rms over 32 phases of four steps, of events that are not all alike, and classes that change now and then: the slope is
// uncertain by a tenth or two.
TEST_P(SelectiveStepsAcrossEvents, CorrectedQuadratureIsOfSecondOrder) {
  for (const double order : orders(true)) {
    EXPECT_GT(order, 1.75);
    EXPECT_LT(order, 2.25);
  }
}

TEST_P(SelectiveStepsAcrossEvents, WithoutCorrectionFirstOrderIsLeft) {
  for (const double order : orders(false)) {
    EXPECT_GT(order, 0.7);
    EXPECT_LT(order, 1.35);
  }
}

using enum core::Interface;
INSTANTIATE_TEST_SUITE_P(All, SelectiveStepsAcrossEvents,
                         testing::Values(Terms{accumulate, false}, Terms{accumulate, true}, Terms{extrapolate, false},
                                         Terms{extrapolate, true}),
                         [](const auto& tested) {
                           return std::string(name(tested.param.interface)) + (tested.param.tension ? "_tension" : "_clamp");
                         });

}  // namespace
}  // namespace grainclock::multirate
