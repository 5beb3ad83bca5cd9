#include "core/events.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

namespace grainclock::core {
namespace {

using tests::Random;

/// The cubic Hermite path of the overlap over a step, by its basis functions.
struct Path {
  Approach start, end;
  double h;
  Approach at(double u) const {
    const double a = (1.0 + 2.0 * u) * (1.0 - u) * (1.0 - u), b = u * (1.0 - u) * (1.0 - u), c = u * u * (3.0 - 2.0 * u),
                 d = -u * u * (1.0 - u);
    const double slope = 6.0 * u * (1.0 - u);
    return {a * start.overlap + b * h * start.rate + c * end.overlap + d * h * end.rate,
            slope * (end.overlap - start.overlap) / h + (1.0 - u) * (1.0 - 3.0 * u) * start.rate +
                u * (3.0 * u - 2.0) * end.rate};
  }
};

/// Which formula of the law holds: what an event is a change of.
int branch(const ContactLaw& law, const Approach& a) {
  if (a.overlap > 0.0) return law.tension || law.k * a.overlap + law.c * a.rate > 0.0 ? 1 : 2;
  return law.reach > 0.0 && a.overlap >= -law.reach && a.rate < 0.0 ? 3 : 0;
}

struct Brute {
  double impulse, displacement, dissipated;  // beyond the quadrature
  bool changes_branch = false;
  double force = 0.0, power = 0.0;  // largest
};

/// The law along the path by the midpoint rule.
Brute integrate(const ContactLaw& law, const Path& path, int n) {
  Brute out{};
  const auto power = [&](const Approach& a) {
    return (contact_force(law, a.overlap, a.rate) - (a.overlap > 0.0 ? law.k * a.overlap : 0.0)) * a.rate;
  };
  const int first = branch(law, path.start);
  double impulse = 0.0, moment = 0.0, work = 0.0;
  for (int i = 0; i < n; ++i) {
    const double u = (i + 0.5) / n;
    const Approach a = path.at(u);
    const double force = contact_force(law, a.overlap, a.rate);
    impulse += force / n;
    moment += (1.0 - u) * force / n;
    work += power(a) / n;
    out.force = std::max(out.force, std::abs(force));
    out.power = std::max(out.power, std::abs(power(a)));
    out.changes_branch |= branch(law, a) != first;
  }
  const double f0 = contact_force(law, path.start.overlap, path.start.rate);
  const double f1 = contact_force(law, path.end.overlap, path.end.rate);
  out.impulse = path.h * (impulse - 0.5 * (f0 + f1));
  out.displacement = path.h * path.h * (moment - 0.5 * f0);
  out.dissipated = path.h * (work - 0.5 * (power(path.start) + power(path.end)));
  return out;
}

constexpr double kStep = 1e-4;  // s
constexpr int kPoints = 20000;

void expect_correction(const ContactLaw& law, const Path& path, const std::string& what) {
  const EventCorrection found = event_correction(law, path.start, path.end, path.h);
  const Brute exact = integrate(law, path, kPoints);
  // The midpoint rule misplaces each jump of force or power by up to half an interval, at most four times.
  const double part = 2.0 / kPoints + 1e-9;
  EXPECT_TRUE(found.is_event) << what;
  EXPECT_NEAR(found.impulse, exact.impulse, part * path.h * exact.force) << what;
  EXPECT_NEAR(found.displacement, exact.displacement, part * path.h * path.h * exact.force) << what;
  EXPECT_NEAR(found.dissipated, exact.dissipated, part * path.h * exact.power) << what;
}

struct Kindred {
  std::string name;
  ContactLaw law;
};

std::vector<Kindred> laws() {
  const double k = 1e9, c = 2e5;
  return {{"clamp", {k, c, 0.0, false}},
          {"tension", {k, c, 0.0, true}},
          {"strong", {k, 50.0 * c, 0.0, false}},
          {"cohesion", {k, c, 2e-5, false}},
          {"cohesion with tension", {k, c, 2e-5, true}},
          {"undamped", {k, 0.0, 0.0, false}},
          {"undamped cohesion", {k, 0.0, 2e-5, false}}};
}

TEST(EventCorrection, IntegratesTheLawAlongRandomPaths) {
  Random random(1);
  int events = 0, quiet = 0;
  for (const Kindred& kindred : laws()) {
    for (int trial = 0; trial < 400; ++trial) {
      // Ends near the branches: overlaps of some v h around zero.
      const Path path{{random.between(-1e-4, 1e-4), random.between(-1.0, 1.0)},
                      {random.between(-1e-4, 1e-4), random.between(-1.0, 1.0)},
                      kStep};
      const Brute coarse = integrate(kindred.law, path, 500);
      const EventCorrection found = event_correction(kindred.law, path.start, path.end, path.h);
      if (coarse.changes_branch && coarse.force > 0.0) {
        expect_correction(kindred.law, path, kindred.name + " " + std::to_string(trial));
        ++events;
      } else if (!found.is_event) {  // else a change too short for 500 points
        EXPECT_EQ(found.impulse, 0.0);
        EXPECT_EQ(found.displacement, 0.0);
        EXPECT_EQ(found.dissipated, 0.0);
        ++quiet;
      }
    }
  }
  EXPECT_GT(events, 500);
  EXPECT_GT(quiet, 500);
}

/// A step of kStep under a law.
struct Case {
  const char* what;
  ContactLaw law;
  Approach start, end;
};
constexpr ContactLaw kClamp{1e9, 2e5, 0.0, false}, kTension{1e9, 2e5, 0.0, true}, kCohesion{1e9, 2e5, 2e-5, false};

TEST(EventCorrection, CoversEveryWayToChangeBranch) {
  const Case all[] = {
      {"closes", kTension, {-3e-5, 1.0}, {6e-5, 0.8}},
      {"opens", kTension, {3e-5, -1.0}, {-6e-5, -0.9}},
      {"is clamped", kClamp, {3e-4, -0.5}, {2e-4, -1.1}},
      {"is released from the clamp", kClamp, {1e-4, -1.0}, {1e-4, 1.0}},
      {"opens and closes", kTension, {2e-5, -1.0}, {2e-5, 1.0}},
      {"closes and opens", kTension, {-2e-5, 1.0}, {-2e-5, -1.0}},
      {"closes and is clamped", kClamp, {-1e-5, 1.0}, {1e-6, -0.7}},
      {"cohesion begins", kCohesion, {1e-5, -0.2}, {-1e-5, -0.2}},
      {"cohesion ends by distance", kCohesion, {-1e-5, -0.2}, {-3e-5, -0.2}},
      {"cohesion ends by turning", kCohesion, {-1e-5, -0.05}, {-1e-5, 0.05}},
      {"cohesion begins by turning", kCohesion, {-1e-5, 0.05}, {-1.1e-5, -0.06}},
      {"all of it", kCohesion, {-3e-5, 1.2}, {-3e-5, -1.2}},
  };
  for (const Case& one : all) expect_correction(one.law, {one.start, one.end, kStep}, one.what);
}

TEST(EventCorrection, IsNothingWithoutChangeOfBranch) {
  const Case all[] = {
      {"apart", kTension, {-3e-4, 1.0}, {-2e-4, 1.0}},
      {"apart, turning", kTension, {-3e-4, 1.0}, {-3e-4, -1.0}},
      {"apart, beyond reach", kCohesion, {-3e-4, 1.0}, {-3e-4, -1.0}},
      {"approaching within reach", kCohesion, {-1.5e-5, 0.05}, {-1e-5, 0.05}},
      {"parting within reach", kCohesion, {-1e-5, -0.05}, {-1.5e-5, -0.05}},
      {"in touch", kTension, {3e-4, 1.0}, {4e-4, 1.0}},
      {"in touch, turning", kTension, {3e-4, 1.0}, {3e-4, -1.0}},
      {"in touch, turning, where apart it would cohere", kCohesion, {3e-4, 0.1}, {3e-4, -0.1}},
      {"pressed throughout", kClamp, {3e-4, 0.3}, {3e-4, -0.3}},
      {"clamped throughout", kClamp, {3e-5, -1.0}, {1e-6, -0.3}},
      {"clamp passed while apart", kClamp, {-3e-4, 1.0}, {-1e-4, 1.0}},
  };
  for (const Case& one : all) {
    const EventCorrection found = event_correction(one.law, one.start, one.end, kStep);
    EXPECT_FALSE(found.is_event) << one.what;
    EXPECT_EQ(found.impulse, 0.0) << one.what;
    EXPECT_EQ(found.displacement, 0.0) << one.what;
    EXPECT_EQ(found.dissipated, 0.0) << one.what;
  }
}

TEST(EventCorrection, IsSmallWhereTheStepIsSmoothButLongerThanTheEvent) {
  // A closing contact without dashpot, touching halfway: F rises linearly from the touch. By hand, with overlap v t
  // from the middle on: impulse k v h^2 / 8 against the trapezoid's k v h^2 / 4.
  const double k = 1e7, v = 1.0;
  const EventCorrection found = event_correction({k, 0.0, 0.0, false}, {-0.5 * v * kStep, v}, {0.5 * v * kStep, v}, kStep);
  const double unit = k * v * kStep * kStep;
  EXPECT_NEAR(found.impulse, unit * (0.125 - 0.25), 1e-12 * unit);  // rounding
  // Displacement integral: k v h^3 times the integral of (1 - u)(u - 1/2) over the second half = 1/48.
  EXPECT_NEAR(found.displacement, unit * kStep / 48.0, 1e-12 * unit * kStep);
  EXPECT_EQ(found.dissipated, 0.0);
}

TEST(EventCorrection, MovesWithTheEventContinuously) {
  // A touch at the very start or end of a step is worth what the trapezoid rule misses of the jump c v: -+ h c v / 2.
  const double c = 2e4, v = 1.0, h = kStep;
  const ContactLaw law{1.0, c, 0.0, true};
  const auto at = [&](double u) {
    return event_correction(law, {-u * v * h, v}, {(1.0 - u) * v * h, v}, h).impulse / (h * c * v);
  };
  EXPECT_NEAR(at(1e-9), 0.5, 1e-6);
  EXPECT_NEAR(at(0.5), 0.0, 1e-6);
  EXPECT_NEAR(at(1.0 - 1e-9), -0.5, 1e-6);  // k is not quite nothing: 1e-4 / 2e4 of it
}

// ---- the book ----

TEST(EventBook, CountsActionAndReactionAndShiftsEachBallOnce) {
  Materials materials;
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, 0.2);
  state.add(1, Kind::content, {0.39999, 0.0, 0.0}, {-1.0, 0.0, 0.0}, 0.2);
  state.add(2, Kind::content, {0.0, 0.39999, 0.0}, {0.0, -1.0, 0.0}, 0.2);
  state.add(3, Kind::wall, {0.0, 0.0, -0.39999}, Vec3::Zero(), 0.2);
  state.velocity[0] = {0.0, 0.0, -1.0};
  const Balls balls(state, materials, true);
  const ForceScale scale = force_scale(materials, 9.81, 0.4, 1, 3);
  EventBook book(scale, 0.5 * kStep);
  const std::vector<std::uint32_t> i{0, 0}, j{1, 2}, fixed_i{0}, fixed_j{balls.first_fixed_row()}, both{0, 1}, one{0};
  const auto step = [](std::uint32_t) { return kStep; };
  const auto at_rest = [](std::uint32_t) { return Vec3(0.0, 0.0, 0.0); };
  book.examine(balls.rows, {i.data(), j.data(), 2}, both, sweep_law(materials, false, scale, kStep), step, at_rest);
  book.examine(balls.rows, {fixed_i.data(), fixed_j.data(), 1}, one, sweep_law(materials, true, scale, kStep), step,
               at_rest);
  ASSERT_EQ(book.entries().size(), 3u);
  // The touch came a tenth of a step before the end, at 1 m/s head on.
  const EventCorrection expected =
      event_correction({materials.ball.k, materials.ball.c, 0.0, false}, {-9e-5, 1.0}, {1e-5, 1.0}, kStep);
  const EventBook::Entry& first = book.entries()[0];
  EXPECT_TRUE(first.both);
  // Ball 0 lies at smaller x than ball 1: a push is along -x. The path is not quite straight to ball 0 (1e-5).
  EXPECT_NEAR(static_cast<double>(first.impulse[0]) * book.impulse_unit() / -expected.impulse, 1.0, 1e-3);
  EXPECT_NEAR(static_cast<double>(first.displacement[0]) * book.displacement_unit() / -expected.displacement, 1.0, 1e-3);
  EXPECT_NEAR(static_cast<double>(first.dissipated) * book.energy_unit() / expected.dissipated, 1.0, 1e-3);
  EXPECT_NEAR(static_cast<double>(first.magnitude) * book.energy_unit() / std::abs(expected.impulse), 1.0, 1e-3);
  EXPECT_FALSE(book.entries()[2].both);

  const std::vector<Shift> moves = shifts(book.entries());
  ASSERT_EQ(moves.size(), 3u);  // content only, in order, each once
  std::int64_t sum[3] = {0, 0, 0};
  for (std::size_t m = 0; m < moves.size(); ++m) {
    EXPECT_EQ(moves[m].row, m);
    for (int axis = 0; axis < 3; ++axis) sum[axis] += moves[m].displacement[axis];
  }
  // What the wall gave is all that is not balanced.
  for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(sum[axis], book.entries()[2].displacement[axis]);
  EXPECT_TRUE(shifts({}).empty());

  book.clear();
  const auto skipped = [](std::uint32_t) { return 0.0; };
  book.examine(balls.rows, {i.data(), j.data(), 2}, both, sweep_law(materials, false, scale, kStep), skipped, at_rest);
  EXPECT_TRUE(book.entries().empty());
}

TEST(EventBook, KnowsByTheParabolasWhereAPairCameFrom) {
  // Head on along x, slowed down by 4000 m/s2: at the end 1e-5 m deep at 1 m/s, a step before that faster by a h and apart.
  Materials materials;
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, 0.2);
  state.add(1, Kind::content, {0.39999, 0.0, 0.0}, {-1.0, 0.0, 0.0}, 0.2);
  const Balls balls(state, materials, true);
  const ForceScale scale = force_scale(materials, 9.81, 0.4, 1, 2);
  EventBook book(scale, 0.5 * kStep);
  const std::vector<std::uint32_t> i{0}, j{1}, one{0};
  const auto acceleration = [](std::uint32_t row) { return Vec3(row == 0 ? -1e3 : 3e3, 0.0, 0.0); };
  book.examine(balls.rows, {i.data(), j.data(), 1}, one, sweep_law(materials, false, scale, kStep),
               [](std::uint32_t) { return kStep; }, acceleration);
  ASSERT_EQ(book.entries().size(), 1u);
  const double a = 4e3;
  const EventCorrection expected = event_correction({materials.ball.k, materials.ball.c, 0.0, false},
                                                    {1e-5 - kStep - 0.5 * kStep * kStep * a, 1.0 + kStep * a}, {1e-5, 1.0}, kStep);
  // Places of 0.4 m are rounded to 1e-11 of the overlap, impulses to whole units, 1e-8 of this one.
  const EventBook::Entry& entry = book.entries()[0];
  EXPECT_NEAR(static_cast<double>(entry.impulse[0]) * book.impulse_unit() / -expected.impulse, 1.0, 1e-6);
  EXPECT_NEAR(static_cast<double>(entry.displacement[0]) * book.displacement_unit() / -expected.displacement, 1.0, 1e-6);
}

TEST(EventCandidates, HoldEveryPairThatChangedBranch) {
  // Random pairs that have come along parabolas: whatever event_correction() finds, the sweep must have proposed.
  Random random(2);
  const double h = 1e-4;
  for (const bool tension : {false, true}) {
    for (const double cohesion : {0.0, 2e3}) {
      Materials materials;
      materials.tension = tension;
      materials.cohesion = cohesion;
      State state;
      const int pairs = 4000;
      std::vector<Vec3> acceleration;
      for (int p = 0; p < pairs; ++p) {
        const double ra = random.between(0.1, 0.3), rb = random.between(0.1, 0.3);
        const Vec3 n = random.direction(), x = 10.0 * p * Vec3::UnitX();
        const double speed = std::pow(10.0, random.between(-3.0, 1.0));
        state.add(2 * p, Kind::content, x, speed * random.direction(), ra);
        state.add(2 * p + 1, Kind::content, x - (ra + rb - speed * h * random.between(-2.0, 2.0)) * n,
                  speed * random.direction(), rb);
        for (int ball = 0; ball < 2; ++ball)
          acceleration.push_back(std::pow(10.0, random.between(0.0, 5.0)) * random.direction());
      }
      Balls balls(state, materials, true);
      std::vector<std::uint32_t> i, j, all;
      for (std::uint32_t p = 0; p < pairs; ++p) {
        i.push_back(2 * p);
        j.push_back(2 * p + 1);
        all.push_back(p);
      }
      for (std::size_t row = 0; row < acceleration.size(); ++row) balls.rows[row].a = acceleration[row].lpNorm<1>();
      const ForceScale scale = force_scale(materials, 9.81, 0.4, 1, 2 * pairs);
      const SweepLaw law = sweep_law(materials, false, scale, h);
      std::vector<std::uint32_t> proposed(pairs + kLanes);
      Candidates candidates{proposed.data()};
      std::vector<IntVec> sums(2 * pairs + 1);
      SweepTotals totals;
      const PairSpan span{i.data(), j.data(), i.size()};
      kernels().sweep(balls.rows.data(), span, law, sums.data(), totals, &candidates);
      proposed.resize(candidates.n);

      EventBook full(scale, 0.5 * h), swift(scale, 0.5 * h);
      const auto step = [h](std::uint32_t) { return h; };
      const auto path = [&](std::uint32_t row) { return acceleration[row]; };
      full.examine(balls.rows, span, all, law, step, path);
      swift.examine(balls.rows, span, proposed, law, step, path);
      EXPECT_GT(full.entries().size(), 200u);
      EXPECT_EQ(swift.entries().size(), full.entries().size()) << "tension " << tension << " cohesion " << cohesion;
      EXPECT_LT(candidates.n, static_cast<std::size_t>(pairs)) << "else nothing is gained by proposing";
    }
  }
}

}  // namespace
}  // namespace grainclock::core
