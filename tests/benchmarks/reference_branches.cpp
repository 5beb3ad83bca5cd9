// Branches of the law, their ends, and pairs that keep theirs, without any integrator.
#include "benchmarks/watched_pairs.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

namespace grainclock::benchmarks {
namespace {

using core::Approach;
using core::ContactLaw;
using core::Materials;
using core::State;

constexpr double kStiffness = 1e6, kDashpot = 2e3, kReach = 1e-3;
const ContactLaw kLaws[] = {{kStiffness, kDashpot, 0.0, false},    {kStiffness, kDashpot, 0.0, true},
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

/// A flight past each other without forces: closest, by `overlap`, in the middle of a step of 1 s; `curvature` of the
/// overlap [m/s2].
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
  const Approach on_limit{slope, -1.0},
      after{slope + 1e-15, -1.0};  // 1e-15 m in 1e-12 s is far from the -1 m/s that it moves at
  EXPECT_EQ(passage(clamp, on_limit, after, h, kRounding), Passage::none);
}

/// Ball 0 between ball 1 and the fixed ball 2, along z; overlaps with both [m], and upward speed of ball 0 [m/s].
State between(double overlap_ball, double overlap_wall, double up) {
  State state;
  state.add(0, core::Kind::content, {0.0, 0.0, 0.4 - overlap_wall}, {0.0, 0.0, up}, 0.2);
  state.add(1, core::Kind::content, {0.0, 0.0, 0.75 - overlap_wall - overlap_ball}, core::Vec3::Zero(), 0.15);
  state.add(2, core::Kind::wall, core::Vec3::Zero(), core::Vec3::Zero(), 0.2);
  return state;
}

TEST(WatchedPairs, KeepTheirBranchesInEveryPart) {
  // Begun in one place and evaluated in another: law and correction together are the first place's formula.
  Materials materials;
  materials.ball = {2e6, 3e3};
  materials.wall = {5e6, 4e4};
  for (const double cohesion : {0.0, 2e3}) {
    materials.cohesion = cohesion;
    tests::Random random(3);
    int kept[5] = {};
    for (int trial = 0; trial < 300; ++trial) {
      const auto anywhere = [&] {
        return between(random.between(-2e-3, 2e-3), random.between(-2e-3, 2e-3), random.between(-1.0, 1.0));
      };
      const State begun = anywhere(), now = anywhere();
      core::ForceField field(now, materials, core::Vec3::Zero(), false, 1);
      WatchedPairs watched(begun, materials, false, 1e-3, {0.0, 0.0});
      const auto motion_of = [&](const State& state) {
        Motion motion;
        for (std::size_t i = 0; i < 2; ++i) {
          motion.x.insert(motion.x.end(), state.position[i].data(), state.position[i].data() + 3);
          motion.v.insert(motion.v.end(), state.velocity[i].data(), state.velocity[i].data() + 3);
        }
        watched.append_fixed(motion);
        return motion;
      };
      watched.renew(motion_of(begun));
      ASSERT_EQ(watched.pairs().size(), 2U);
      const Motion motion = motion_of(now);
      const auto part = [&](core::Part which) {
        std::vector<double> a(6);
        field.acceleration({motion.x.data(), 6}, {motion.v.data(), 6}, a, which);
        watched.keep_branches(motion, which, a);
        return a;
      };
      double force[2], spring[2];  // N, with the wall and with the ball
      for (const WatchedPair& pair : watched.pairs()) {
        const bool with_wall = pair.j == 2;
        const Approach at = watched.approach(pair, motion);
        force[with_wall ? 0 : 1] = branch_force(watched.law(pair), pair.branch, at);
        spring[with_wall ? 0 : 1] = branch_spring(watched.law(pair), pair.branch, at);
        kept[static_cast<int>(pair.branch)] += pair.branch == branch_of(watched.law(pair), at) ? 0 : 1;
      }
      const double m0 = materials.mass(0.2), m1 = materials.mass(0.15);
      // Forces up to 5e4 N, rounded; in units of 1e-10 N.
      constexpr double kNear = 1e-9;
      const auto expect = [&](core::Part which, double wall, double ball) {
        const auto a = part(which);
        EXPECT_NEAR(a[2], (wall - ball) / m0, kNear);
        EXPECT_NEAR(a[5], ball / m1, kNear);
      };
      expect(core::Part::all, force[0], force[1]);
      expect(core::Part::springs, spring[0], spring[1]);
      expect(core::Part::dashpots, force[0] - spring[0], force[1] - spring[1]);
      expect(core::Part::ball_pairs, 0.0, force[1]);
      expect(core::Part::fixed_pairs, force[0], 0.0);
    }
    for (const Branch branch : {Branch::apart, Branch::nearing, Branch::parting, Branch::pressed, Branch::clamped}) {
      const bool exists = cohesion > 0.0 || (branch != Branch::nearing && branch != Branch::parting);
      if (exists) {
        EXPECT_GT(kept[static_cast<int>(branch)], 0) << static_cast<int>(branch);
      }
    }
  }
}

}  // namespace
}  // namespace grainclock::benchmarks
