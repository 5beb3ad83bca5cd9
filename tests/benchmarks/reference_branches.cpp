// Branches of the law and their ends, without any integrator.
#include "benchmarks/branch_changes.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

namespace grainclock::benchmarks {
namespace {

using core::Approach;
using core::ContactLaw;

constexpr double kStiffness = 1e6, kDashpot = 2e3, kReach = 1e-3;
const ContactLaw kLaws[] = {{kStiffness, kDashpot, 0.0, false},   {kStiffness, kDashpot, 0.0, true},
                            {kStiffness, kDashpot, kReach, false}, {kStiffness, kDashpot, kReach, true},
                            {kStiffness, 0.0, 0.0, false},         {kStiffness, 0.0, kReach, false}};
const Rounding kRounding{1e-15, 1e-14};

TEST(Branches, FormulasAreTheLawOnTheirBranch) {
  tests::Random random(1);
  ContactLaw undamped;
  for (const ContactLaw& law : kLaws) {
    undamped = law;
    undamped.c = 0.0;
    for (int trial = 0; trial < 1000; ++trial) {
      const Approach at{random.between(-2.0, 2.0) * kReach, random.between(-2.0, 2.0)};
      const Branch branch = branch_of(law, at);
      EXPECT_EQ(branch_force(law, branch, at), core::contact_force(law, at.overlap, at.rate));
      EXPECT_EQ(branch_spring(law, branch, at), core::contact_force(undamped, at.overlap, at.rate));
    }
  }
}

TEST(Branches, EveryExitIsClosedWithinAndLeadsToTheBranchBeyond) {
  // Anywhere within a branch all its exits are positive. Crossed alone, by a little, an exit leads to where the law then is.
  tests::Random random(2);
  int crossed[8] = {};
  for (const ContactLaw& law : kLaws) {
    for (int trial = 0; trial < 20000; ++trial) {
      const Approach at{random.between(-2.0, 2.0) * kReach, random.between(-2.0, 2.0)};
      const Branch branch = branch_of(law, at);
      const Exits exits = exits_of(law, branch);
      for (const Exit& exit : exits.all()) EXPECT_GE(exit.value(at), 0.0);
      const Approach moved{at.overlap + random.between(-0.05, 0.05) * kReach, at.rate + random.between(-0.05, 0.05)};
      const Branch beyond = branch_of(law, moved);
      if (beyond == branch) continue;
      int open = 0;
      const Exit* used = nullptr;
      for (const Exit& exit : exits.all()) {
        if (exit.value(moved) >= 0.0) continue;
        ++open;
        used = &exit;
      }
      // Both at once, or a jump over a corner that no motion makes: a touch while parting, a clamped contact out of nothing.
      const bool is_corner = open != 1 || used->to != beyond;
      if (is_corner) continue;
      ++crossed[static_cast<int>(used->kind)];
    }
  }
  for (const int times : crossed) EXPECT_GT(times, 50);
}

/// A flight past each other without forces: closest, by `overlap`, in the middle of a step of 1 s; `curvature` of the overlap [m/s2].
struct Flight {
  Approach start, end;
  Flight(double overlap, double curvature)
      : start{overlap - 0.125 * curvature, 0.5 * curvature}, end{overlap - 0.125 * curvature, -0.5 * curvature} {}
};

TEST(Passage, SeesAGrazeThatIsApartAtBothEnds) {
  const Exit touch = exits_of(kLaws[0], Branch::apart).exit[0];
  const Flight flight(0.01, 1.0);
  EXPECT_GT(touch.value(flight.start), 0.1);  // to an eye for signs alone nothing happens
  EXPECT_GT(touch.value(flight.end), 0.1);
  EXPECT_EQ(passage(touch, flight.start, flight.end, 1.0, kRounding), Passage::grazing);
}

TEST(Passage, IsSureOfAMissOnlyBeyondThePathsOwnError) {
  const Exit touch = exits_of(kLaws[0], Branch::apart).exit[0];
  const Flight near(-0.001, 1.0), far(-0.1, 1.0);
  EXPECT_EQ(passage(touch, near.start, near.end, 1.0, kRounding), Passage::grazing);  // to be looked at
  EXPECT_EQ(passage(touch, far.start, far.end, 1.0, kRounding), Passage::none);
}

TEST(Passage, SeesAContactThatIsClampedInBetweenOnly) {
  const ContactLaw& law = kLaws[0];
  const Exit clamp = exits_of(law, Branch::pressed).exit[0];
  const double slope = law.c / law.k, h = 1.0, d = 1e-3;
  // The overlap falls by 1.5 slope h fastest in the middle: rate -1.5 d there, zero at both ends.
  const double fall = 1.2 * d / (1.5 * slope);
  const Approach start{d + fall, 0.0}, end{d, 0.0};
  const Approach dipped{d + 0.5 * fall, -1.5 * fall / h};
  EXPECT_GT(clamp.value(start), 0.0);
  EXPECT_GT(clamp.value(end), 0.0);
  EXPECT_EQ(passage(clamp, start, end, h, kRounding), clamp.value(dipped) < 0.0 ? Passage::grazing : Passage::none);
  // Slower by a factor of a thousand nothing is near the clamp.
  const Approach slow{d + 1e-3 * fall, 0.0};
  EXPECT_EQ(passage(clamp, slow, end, h, kRounding), Passage::none);
}

TEST(Passage, ThroughAtEitherEnd) {
  const Exit touch = exits_of(kLaws[0], Branch::apart).exit[0];
  EXPECT_EQ(passage(touch, {-1e-3, 1.0}, {1e-3, 1.0}, 2e-3, kRounding), Passage::through);
  EXPECT_EQ(passage(touch, {1e-3, -1.0}, {-1e-3, -1.0}, 2e-3, kRounding), Passage::through);
  EXPECT_EQ(passage(touch, {-2e-3, 1.0}, {-1e-3, 1.0}, 1e-3, kRounding), Passage::none);
}

TEST(Passage, RoundingIsNeitherTouchNorGraze) {
  // On its limit, and in a step so short that the mean rate is all rounding.
  const Exit touch = exits_of(kLaws[0], Branch::apart).exit[0], clamp = exits_of(kLaws[0], Branch::pressed).exit[0];
  EXPECT_EQ(passage(touch, {0.0, -1.0}, {0.9e-15, -1.0}, 1e-16, kRounding), Passage::none);
  EXPECT_EQ(passage(touch, {0.0, -1.0}, {1.1e-15, -1.0}, 1e-16, kRounding), Passage::through);
  const double h = 1e-12, slope = kDashpot / kStiffness;
  const Approach on_limit{slope, -1.0}, after{slope + 1e-15, -1.0};  // 1e-15 m in 1e-12 s is far from the -1 m/s that it moves at
  EXPECT_EQ(passage(clamp, on_limit, after, h, kRounding), Passage::none);
}

}  // namespace
}  // namespace grainclock::benchmarks
