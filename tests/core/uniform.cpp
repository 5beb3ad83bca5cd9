// The uniform stepper: the same bits whatever does not matter, restart, failures, removal.
#include "core/check.hpp"
#include "core/stepper.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <ostream>
#include <string>

namespace grainclock::core {
namespace {

using tests::message_of;
using tests::same_bits;

constexpr double kStep = 1e-4;  // s
constexpr int kSteps = 400;     // the content falls, hits, and first balls leave

/// 320 balls over a tray with a hole: they fall, collide, and some leave.
State start() {
  State state = tests::tray(10, 5, 1);
  State with_plug;
  for (std::size_t i = 0; i < state.size(); ++i) {
    const bool hole = state.kind[i] == Kind::wall && state.position[i].z() == 0.0 &&
                      (state.position[i] - Vec3(2.2, 2.2, 0.0)).norm() < 0.9;
    Vec3 v = state.velocity[i];
    if (state.kind[i] == Kind::content) v.z() -= 6.0;
    with_plug.add(state.id[i], hole ? Kind::plug : state.kind[i], state.position[i], v, state.radius[i]);
  }
  return with_plug;
}

StepperSetup tray_setup(Integrator integrator, bool first_impact = false) {
  StepperSetup setup = tests::weightless(Materials{}, kStep, integrator);
  setup.gravity = {0.0, 0.0, -9.81};
  setup.outlet_open = true;
  setup.first_impact = first_impact;
  setup.domain.outlet_z = 0.2;
  return setup;
}

std::vector<double> numbers(const Ledger& l) {
  std::vector<double> out{l.dissipated,      l.first_impact,  l.event_work,  l.removed_energy,
                          l.switched_energy, l.total_impulse, l.turned_over, static_cast<double>(l.discharged)};
  for (const Vec3* v : {&l.wall_impulse, &l.gravity_impulse, &l.first_impact_impulse, &l.removed_momentum}) {
    out.insert(out.end(), v->data(), v->data() + 3);
  }
  return out;
}

/// Everything a run leaves but the costs of its lists.
struct Outcome {
  State state;
  std::vector<double> ledger;
  Energies energies;
  std::uint64_t events = 0, ball_updates = 0;
};

Outcome outcome(const Stepper& stepper) {
  return {stepper.state(), numbers(stepper.ledger()), stepper.energies(), stepper.costs().events,
          stepper.costs().ball_updates};
}

void expect_same_bits(const Outcome& a, const Outcome& b, const std::string& what) {
  EXPECT_TRUE(same_bits(a.state.id, b.state.id)) << what;
  EXPECT_TRUE(same_bits(a.state.position, b.state.position)) << what;
  EXPECT_TRUE(same_bits(a.state.velocity, b.state.velocity)) << what;
  EXPECT_TRUE(same_bits(a.state.evaluated_position, b.state.evaluated_position)) << what;
  EXPECT_TRUE(same_bits(a.state.evaluated_velocity, b.state.evaluated_velocity)) << what;
  EXPECT_TRUE(same_bits(a.state.impacted, b.state.impacted)) << what;
  EXPECT_TRUE(same_bits(a.ledger, b.ledger)) << what;
  EXPECT_EQ(a.energies.total(), b.energies.total()) << what;
  EXPECT_EQ(a.energies.momentum, b.energies.momentum) << what;
  EXPECT_EQ(a.events, b.events) << what;
  EXPECT_EQ(a.ball_updates, b.ball_updates) << what;
}

Outcome run(const State& from, const StepperSetup& setup, int steps = kSteps) {
  const auto stepper = make_uniform_stepper(from, setup);
  stepper->advance(steps);
  return outcome(*stepper);
}

struct Variant {
  std::string name;
  Integrator integrator;
  bool first_impact;
};

void PrintTo(const Variant& variant, std::ostream* out) { *out << variant.name; }

class Uniform : public testing::TestWithParam<Variant> {
 protected:
  StepperSetup setup() const { return tray_setup(GetParam().integrator, GetParam().first_impact); }
};

TEST_P(Uniform, RunIsAsLivelyAsTheTestsBelowNeed) {
  const auto stepper = make_uniform_stepper(start(), setup());
  stepper->advance(kSteps);
  const Ledger& ledger = stepper->ledger();
  EXPECT_GT(ledger.discharged, 1);
  EXPECT_LT(ledger.discharged, 100);
  EXPECT_GT(stepper->costs().list_builds, 5u);
  EXPECT_GT(stepper->contacts().size(), 20u);
  if (setup().stepping.events) {
    EXPECT_GT(stepper->costs().events, 100u);
  }
  if (setup().first_impact) {
    EXPECT_GT(ledger.first_impact, 0.0);
  }
}

TEST_P(Uniform, ThreadsDoNotChangeABit) {
  // Only the liveliest part: threads that wait for each other on busy cores take their time.
  const State middle = run(start(), setup(), 280).state;
  const Outcome one = run(middle, setup(), 80);
  for (const int threads : {2, 4}) {
    StepperSetup more = setup();
    more.threads = threads;
    expect_same_bits(run(middle, more, 80), one, std::to_string(threads) + " threads");
  }
}

TEST_P(Uniform, SkinsDoNotChangeABit) {
  const Outcome usual = run(start(), setup());
  for (const double skin : {2e-4, 0.03, 0.3}) {
    StepperSetup other = setup();
    other.skin = skin;
    expect_same_bits(run(start(), other), usual, "skin " + std::to_string(skin));
  }
}

TEST_P(Uniform, OrderOfTheBallsDoesNotChangeABit) {
  const State given = start();
  const Outcome usual = run(given, setup());
  // The same balls by other names, hence in another order.
  std::vector<std::size_t> order(given.size());
  std::iota(order.begin(), order.end(), 0U);
  tests::Random random(3);
  for (std::size_t k = order.size() - 1; k > 0; --k)
    std::swap(order[k], order[random.below(static_cast<std::uint32_t>(k + 1))]);
  State shuffled;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::size_t from = order[k];
    shuffled.add(static_cast<BallId>(k), given.kind[from], given.position[from], given.velocity[from], given.radius[from]);
  }
  const Outcome found = run(shuffled, setup());
  ASSERT_EQ(found.state.size(), usual.state.size());
  std::size_t same = 0;
  for (std::size_t k = 0; k < found.state.size(); ++k) {
    const auto named = static_cast<BallId>(order[static_cast<std::size_t>(found.state.id[k])]);
    const auto at = static_cast<std::size_t>(std::lower_bound(usual.state.id.begin(), usual.state.id.end(), named) -
                                             usual.state.id.begin());
    ASSERT_LT(at, usual.state.size());
    ASSERT_EQ(usual.state.id[at], named);
    same +=
        found.state.position[k] == usual.state.position[at] && found.state.velocity[k] == usual.state.velocity[at] ? 1 : 0;
  }
  EXPECT_EQ(same, usual.state.size());
}

TEST_P(Uniform, AdvancingInPiecesDoesNotChangeABit) {
  const Outcome whole = run(start(), setup());
  for (const int piece : {1, 7}) {
    const auto stepper = make_uniform_stepper(start(), setup());
    for (int done = 0; done < kSteps; done += piece) {
      stepper->advance(std::min(piece, kSteps - done));
      (void)stepper->state();
      (void)stepper->contacts();
    }
    EXPECT_EQ(stepper->steps_done(), kSteps);
    expect_same_bits(outcome(*stepper), whole, "pieces of " + std::to_string(piece));
  }
}

// Steps that sweep and move in one go keep force sums only for the rows that are in work. Here these are a part of all.
TEST(UniformSums, MakeRoomForLaterRowsWithoutChangingABit) {
  const State many = tests::tray(20, 16, 3);
  for (const Integrator integrator : {Integrator::predicted, Integrator::lagged}) {
    StepperSetup setup = tray_setup(integrator);
    setup.stepping.events = false;
    setup.outlet_open = false;
    const auto stepper = make_uniform_stepper(many, setup);
    for (int k = 0; k < kSteps / 4; ++k) stepper->advance(1);  // swept first, then moved
    const Outcome apart = outcome(*stepper);
    EXPECT_GT(stepper->contacts().size(), 5000U);
    for (const int threads : {1, 2, 4, 7}) {
      setup.threads = threads;
      expect_same_bits(run(many, setup, kSteps / 4), apart, std::to_string(threads) + " threads");
    }
  }
}

TEST_P(Uniform, RestartContinuesBitForBit) {
  const Outcome whole = run(start(), setup());
  // Stopped and started again and again, at every step for a while: whatever happens there, happens in one of them.
  auto stepper = make_uniform_stepper(start(), setup());
  const auto restart = [&] {
    EXPECT_TRUE(stepper->is_checkpointable());
    StepperSetup from = setup();
    from.ledger = stepper->ledger();
    from.costs = stepper->costs();
    from.steps_done = stepper->steps_done();
    stepper = make_uniform_stepper(stepper->state(), from);
    EXPECT_EQ(stepper->costs().contact_evaluations, from.costs.contact_evaluations);
    EXPECT_GE(stepper->costs().list_builds, from.costs.list_builds);
  };
  stepper->advance(37);
  restart();
  stepper->advance(kSteps / 2 - 37);
  for (int k = 0; k < 60; ++k) {
    restart();
    stepper->advance(1);
  }
  restart();
  stepper->advance(kSteps / 2 - 60);
  EXPECT_EQ(stepper->steps_done(), kSteps);
  expect_same_bits(outcome(*stepper), whole, "restarted");
  // Time is counted from the restart, in one rounding.
  EXPECT_NEAR(stepper->state().time, kSteps * kStep, 1e-15);
}

INSTANTIATE_TEST_SUITE_P(All, Uniform,
                         testing::Values(Variant{"predicted", Integrator::predicted, false},
                                         Variant{"pece", Integrator::pece, false},
                                         Variant{"lagged", Integrator::lagged, false},
                                         Variant{"predicted_first_impact", Integrator::predicted, true},
                                         Variant{"lagged_first_impact", Integrator::lagged, true}),
                         [](const auto& tested) { return tested.param.name; });

// ---- what is refused ----

TEST(UniformInput, IsRefusedWithTheKeyAndTheRemedy) {
  const State state = tests::tray(5, 1, 1);
  const auto refusal = [&](const std::function<void(StepperSetup&)>& change) {
    StepperSetup setup = tests::weightless(Materials{}, kStep);
    change(setup);
    return message_of<InputError>([&] { (void)make_uniform_stepper(state, setup); });
  };
  EXPECT_NE(refusal([](StepperSetup& s) { s.stepping.step.reset(); }).find("step"), std::string::npos);
  EXPECT_NE(refusal([](StepperSetup& s) { s.stepping.step = 0.0; }).find("step"), std::string::npos);
  for (const Integrator integrator : {Integrator::lagged, Integrator::pece}) {
    const std::string text = refusal([&](StepperSetup& s) { s.stepping.integrator = integrator; });
    EXPECT_NE(text.find("events"), std::string::npos) << text;
    EXPECT_NE(text.find(name(integrator)), std::string::npos) << text;
  }
  State walls;
  walls.add(0, Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  EXPECT_NE(message_of<InputError>([&] {
              (void)make_uniform_stepper(walls, tests::weightless(Materials{}, kStep));
            }).find("content"),
            std::string::npos);
}

// ---- what fails ----

const Integrator kIntegrators[] = {Integrator::predicted, Integrator::pece, Integrator::lagged};

/// The complaint when `state` is stepped in a box of 10 m.
std::string failure(const State& state, Integrator integrator, std::int64_t steps = 1000, double force_limit = 0.0) {
  StepperSetup setup = tests::weightless(Materials{}, kStep, integrator);
  setup.domain.lower = Vec3(-5.0, -5.0, -5.0);
  setup.domain.upper = Vec3(5.0, 5.0, 5.0);
  setup.domain.outlet_z = -4.0;
  setup.force_limit = force_limit;
  return message_of<NumericsError>([&] { make_uniform_stepper(state, setup)->advance(steps); });
}

TEST(UniformFailure, NamesABallThatLeavesTheDomainElsewhere) {
  for (const Integrator integrator : kIntegrators) {
    for (const Vec3& way :
         {Vec3(1.0, 0.0, 0.0), Vec3(-1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, -1.0, 0.0), Vec3(0.0, 0.0, 1.0)}) {
      State state = tests::tray(5, 2, 1);
      state.position[7] = 4.9 * way;
      state.velocity[7] = 20.0 * way;
      const std::string text = failure(state, integrator, 100);
      EXPECT_EQ(text.rfind("ball 7 left the domain at (", 0), 0u) << text;
      EXPECT_NE(text.find("t = 0.005"), std::string::npos) << text;
      EXPECT_NE(text.find("now 0.0001 s"), std::string::npos) << text;
      EXPECT_NE(text.find("check the geometry"), std::string::npos) << text;
    }
  }
}

TEST(UniformFailure, NamesABallThatMayPassThroughOthers) {
  // Under 1e6 m/s2 a ball falls by k 0.01 m in its k-th step of 1e-4 s; half the radius of 0.2 m is passed in the 11th.
  // It is looked at when lists are made, which covers its way for a few steps ahead.
  State state;
  state.add(3, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  for (const Integrator integrator : kIntegrators) {
    StepperSetup setup = tests::weightless(Materials{}, kStep, integrator);
    setup.gravity = Vec3(0.0, 0.0, -1e6);
    const auto stepper = make_uniform_stepper(state, setup);
    EXPECT_NO_THROW(stepper->advance(10));
    const std::string text = message_of<NumericsError>([&] { stepper->advance(20); });
    EXPECT_EQ(text.rfind("ball 3 at (0, 0, ", 0), 0u) << text;
    EXPECT_NE(text.find("more than half its radius of 0.2 m"), std::string::npos) << text;
  }
}

TEST(UniformFailure, NamesABallThatIsNoLongerFinite) {
  // Alone, among few, and among more than the list treats by themselves.
  State alone;
  alone.add(3, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  for (const State& given : {alone, tests::tray(5, 1, 1), tests::tray(9, 6, 1)}) {
    for (const Integrator integrator : kIntegrators) {
      for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
        State state = given;
        state.velocity[state.size() == 1 ? 0 : 3].y() = bad;
        const std::string text = failure(state, integrator, 10);
        EXPECT_NE(text.find("ball 3 "), std::string::npos) << text;
      }
    }
  }
}

TEST(UniformFailure, NamesTheContactThatIsTooDeepOrTooStrong) {
  for (const Integrator integrator : kIntegrators) {
    State deep = tests::tray(5, 1, 1);
    deep.position[4] = deep.position[2] + Vec3(0.0, 0.2, 0.0);
    std::string text = failure(deep, integrator);
    EXPECT_NE(text.find("ball 2 "), std::string::npos) << text;
    EXPECT_NE(text.find("ball 4"), std::string::npos) << text;
    EXPECT_NE(text.find("overlap 0.2"), std::string::npos) << text;

    State same = tests::tray(5, 1, 1);
    same.position[4] = same.position[2];
    text = failure(same, integrator);
    EXPECT_NE(text.find("ball 2 "), std::string::npos) << text;
    EXPECT_NE(text.find("ball 4"), std::string::npos) << text;

    State fast = tests::tray(5, 1, 1);
    fast.velocity[4] = {0.0, 0.0, -100.0};
    text = failure(fast, integrator, 1000, 1e7);
    EXPECT_NE(text.find("ball 4 "), std::string::npos) << text;
    EXPECT_NE(text.find("wall "), std::string::npos) << text;
    EXPECT_NE(text.find("(limit 1.68e+07)"), std::string::npos) << text;
    EXPECT_NE(text.find("smaller step"), std::string::npos) << text;
  }
}

TEST(UniformFailure, NamesTheSameContactWhereOthersHaveMovedOnAlready) {
  // Rows move on while later pairs are still to be swept; the bad contact is in the last rows of four thousand.
  State state = tests::tray(66, 1, 1);
  const std::size_t last = 4000;
  ASSERT_EQ(state.kind[last], Kind::content);
  state.velocity[last] = {0.0, 0.0, -60.0};
  const auto text_of = [&](std::int64_t steps_at_once, int threads) {
    StepperSetup setup = tray_setup(Integrator::predicted);
    setup.stepping.events = false;
    setup.threads = threads;
    setup.force_limit = 8e6;  // N; springs give up to 6e6 N, the dashpot of a wall 1.2e7 N at that speed
    const auto stepper = make_uniform_stepper(state, setup);
    try {
      for (std::int64_t k = 0; k < 200; k += steps_at_once) stepper->advance(steps_at_once);
    } catch (const NumericsError& error) {
      return std::string(error.what());
    }
    return std::string("no failure");
  };
  const std::string one_by_one = text_of(1, 1);
  EXPECT_NE(one_by_one.find("ball 4000 "), std::string::npos) << one_by_one;
  EXPECT_EQ(text_of(200, 1), one_by_one);
  EXPECT_EQ(text_of(200, 3), one_by_one);
}

TEST(UniformEnergies, KineticEnergyAloneIsThatOfAllAndTheSameInAnySort) {
  const State state = tests::tray(9, 4, 3);
  std::vector<double> found;
  for (const double skin : {0.0, 0.05}) {
    StepperSetup setup = tray_setup(Integrator::predicted);
    setup.skin = skin;
    const auto stepper = make_uniform_stepper(state, setup);
    stepper->advance(300);
    found.push_back(stepper->kinetic_energy());
    const double all = stepper->energies().kinetic;
    EXPECT_NEAR(found.back(), all, 1e-9 * all);  // rounding to 2^-38 of the fastest ball's, ball by ball
    EXPECT_GT(all, 0.0);
  }
  EXPECT_EQ(found[0], found[1]);
}

TEST(UniformEnergies, MomentumAloneIsThatOfAllAndTheSameInAnySort) {
  const State state = tests::tray(9, 4, 3);
  std::vector<Vec3> found;
  for (const double skin : {0.0, 0.05}) {
    StepperSetup setup = tray_setup(Integrator::predicted);
    setup.skin = skin;
    const auto stepper = make_uniform_stepper(state, setup);
    stepper->advance(300);
    found.push_back(stepper->momentum());
    const Vec3 all = stepper->energies().momentum;
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(found.back()[k], all[k], 1e-9 * all.norm());  // rounding to 2^-38 of the fastest ball's, ball by ball
    EXPECT_GT(all.norm(), 0.0);
  }
  EXPECT_EQ(found[0], found[1]);
}

TEST(UniformForces, OfFixedBallsAreThoseOfTheContactsAndTheSameInAnySort) {
  const State state = tests::tray(9, 4, 3);
  std::vector<std::vector<FixedForce>> found;
  for (const double skin : {0.0, 0.05}) {
    StepperSetup setup = tray_setup(Integrator::predicted);
    setup.skin = skin;
    const auto stepper = make_uniform_stepper(state, setup);
    stepper->advance(300);
    found.push_back(stepper->fixed_forces());
    std::map<BallId, Vec3> wanted;
    double largest = 0.0;
    for (const Contact& contact : stepper->contacts()) {
      if (contact.other == Kind::content) continue;
      wanted.try_emplace(contact.j, Vec3::Zero()).first->second -= contact.force;
      largest = std::max(largest, contact.force.norm());
    }
    ASSERT_GT(largest, 0.0);
    EXPECT_EQ(found.back().size(), state.count(Kind::wall));
    for (const FixedForce& its : found.back()) {
      const Vec3 sum = wanted.contains(its.id) ? wanted[its.id] : Vec3::Zero();
      // Each contact is rounded to a force unit, 2^-36 N or near it; sums in doubles round to 1e-16 of theirs.
      EXPECT_LE((its.force - sum).norm(), 1e-9 + 1e-14 * largest) << its.id;
    }
  }
  for (std::size_t k = 0; k < found[0].size(); ++k) {
    EXPECT_EQ(found[0][k].id, found[1][k].id);
    EXPECT_EQ(found[0][k].force, found[1][k].force);
  }
}

// ---- what leaves ----

TEST(UniformRemoval, CountsAndBooksWhatLeavesThroughTheOutlet) {
  for (const Integrator integrator : kIntegrators) {
    Materials materials;
    State state;
    state.add(3, Kind::content, {0.0, 0.0, 0.05}, {0.5, 0.0, -2.0}, 0.2);
    state.add(5, Kind::content, {0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}, 0.25);
    state.add(8, Kind::wall, {3.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
    StepperSetup setup = tests::weightless(materials, 1e-3, integrator);
    setup.gravity = {0.0, 0.0, -10.0};
    setup.domain.outlet_z = 0.0;
    setup.domain.lower = Vec3(-5.0, -5.0, -5.0);
    const auto stepper = make_uniform_stepper(state, setup);
    const Energies before = stepper->energies();
    stepper->advance(20);
    EXPECT_EQ(stepper->ledger().discharged, 0);
    stepper->advance(10);  // z = 0.05 - 2 t - 5 t^2 is zero at 23.6 ms: gone after 24
    const double t = 0.024, m = materials.mass(0.2);
    EXPECT_EQ(stepper->ledger().discharged, 1);
    const State after = stepper->state();
    EXPECT_EQ(after.id, (std::vector<BallId>{5, 8}));
    // Free fall is exact in all schemes; rounding.
    const Vec3 v(0.5, 0.0, -2.0 - 10.0 * t);
    EXPECT_NEAR((stepper->ledger().removed_momentum - m * v).norm(), 0.0, 1e-12 * m);
    EXPECT_NEAR(stepper->ledger().removed_energy, m * (0.5 * v.squaredNorm() + 10.0 * (0.05 - 2.0 * t - 5.0 * t * t)),
                1e-11 * m);
    EXPECT_LT(momentum_residual(before, stepper->energies(), stepper->ledger()), 1e-14);
    EXPECT_NEAR(stepper->ledger().gravity_impulse.z(), -10.0 * (m * t + materials.mass(0.25) * 0.03), 1e-10);
    EXPECT_NEAR(after.velocity[0].z(), -0.3, 1e-14);
  }
}

TEST(UniformRemoval, ManyLeavingAtOnceAreBookedAlikeWhateverTheirSort) {
  // A layer of pressed balls falls through the outlet in one step.
  tests::Random random(8);
  State state;
  for (int i = 0; i < 64; ++i) {
    state.add(i, Kind::content, {0.43 * (i % 8), 0.43 * (i / 8), 0.002 + random.between(0.0, 1e-5)},
              {random.between(-0.1, 0.1), 0.0, -4.0}, random.between(0.215, 0.22));
  }
  const auto ledger = [&](double skin) {
    StepperSetup setup = tests::weightless(Materials{}, 1e-3);
    setup.domain.outlet_z = 0.0;
    setup.skin = skin;
    const auto stepper = make_uniform_stepper(state, setup);
    stepper->advance(1);
    EXPECT_EQ(stepper->ledger().discharged, 64);
    return numbers(stepper->ledger());
  };
  const std::vector<double> usual = ledger(0.0);
  for (const double skin : {1e-4, 0.05, 0.2, 0.5}) EXPECT_TRUE(same_bits(ledger(skin), usual)) << skin;
}

TEST(UniformRemoval, LastBallMayLeave) {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.01}, {0.0, 0.0, -2.0}, 0.2);
  StepperSetup setup = tests::weightless(Materials{}, 1e-3);
  setup.domain.outlet_z = 0.0;
  const auto stepper = make_uniform_stepper(state, setup);
  stepper->advance(50);
  EXPECT_EQ(stepper->state().size(), 0u);
  EXPECT_EQ(stepper->ledger().discharged, 1);
  EXPECT_EQ(stepper->energies().kinetic, 0.0);
}

TEST(UniformRemoval, TakesTheSpringEnergyOfItsContactsAlong) {
  Materials materials;
  materials.ball.c = 0.0;
  State state;
  const double overlap = 1e-3;
  state.add(0, Kind::content, {0.0, 0.0, 1e-6}, {0.0, 0.0, -1.0}, 0.2);
  state.add(1, Kind::content, {0.0, 0.0, 0.4 - overlap + 1e-6}, {0.0, 0.0, -1.0}, 0.2);
  StepperSetup setup = tests::weightless(materials, 2e-6);
  setup.domain.outlet_z = 0.0;
  const auto stepper = make_uniform_stepper(state, setup);
  stepper->advance(1);
  const double m = materials.mass(0.2), spring = 0.5 * materials.ball.k * overlap * overlap;
  // The spring hardly moves in 2 us: w h = 1.5e-3, squared.
  EXPECT_NEAR(stepper->ledger().removed_energy,
              0.5 * m * stepper->ledger().removed_momentum.squaredNorm() / (m * m) + spring, 1e-5 * spring);
  EXPECT_EQ(stepper->contacts().size(), 0u);
}

// ---- what can be seen ----

TEST(UniformView, PlugIsThereOnlyWhileTheOutletIsClosed) {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.399}, Vec3::Zero(), 0.2);
  state.add(1, Kind::plug, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  for (const bool open : {false, true}) {
    StepperSetup setup = tests::weightless(Materials{}, 1e-5);
    setup.outlet_open = open;
    const auto stepper = make_uniform_stepper(state, setup);
    EXPECT_EQ(stepper->contacts().size(), open ? 0u : 1u);
    EXPECT_EQ(stepper->state().size(), 2u) << "it stays in the state";
    stepper->advance(10);
    EXPECT_EQ(stepper->state().velocity[0].z() > 0.0, !open);
  }
}

TEST(UniformView, ContactsAndEnergiesAreThoseOfTheState) {
  Materials materials;
  State state;
  state.add(1, Kind::content, {0.0, 0.0, 0.0}, {0.0, 0.0, -1.0}, 0.2);
  state.add(4, Kind::content, {0.0, 0.0, 0.399}, {0.0, 0.3, -1.5}, 0.2);
  state.add(6, Kind::wall, {0.398, 0.0, 0.0}, Vec3::Zero(), 0.2);
  state.add(7, Kind::wall, {-0.41, 0.0, 0.0}, Vec3::Zero(), 0.2);
  StepperSetup setup = tests::weightless(materials, 1e-5);
  setup.gravity = {0.0, 0.0, -9.81};
  const auto stepper = make_uniform_stepper(state, setup);
  const std::vector<Contact> contacts = stepper->contacts();
  ASSERT_EQ(contacts.size(), 2u);
  // Rounding of the overlap, 1e-16 m, in k times it.
  EXPECT_EQ(contacts[0].i, 1);
  EXPECT_EQ(contacts[0].j, 4);
  EXPECT_EQ(contacts[0].other, Kind::content);
  EXPECT_NEAR(contacts[0].overlap, 0.001, 1e-16);
  EXPECT_NEAR(contacts[0].rate, 0.5, 1e-15);
  EXPECT_NEAR((contacts[0].force - Vec3(0.0, 0.0, -(1e4 + 0.5 * 2e4))).norm(), 0.0, 1e-8);
  EXPECT_EQ(contacts[1].i, 1);
  EXPECT_EQ(contacts[1].j, 6);
  EXPECT_EQ(contacts[1].other, Kind::wall);
  EXPECT_NEAR((contacts[1].force - Vec3(-2e6, 0.0, 0.0)).norm(), 0.0, 1e-6);
  const Energies e = stepper->energies();
  const double m = materials.mass(0.2);
  EXPECT_NEAR(e.kinetic, 0.5 * m * (1.0 + 0.09 + 2.25), 1e-12);
  EXPECT_NEAR(e.gravity, m * 9.81 * 0.399, 1e-12);
  EXPECT_NEAR(e.elastic, 0.5 * 1e7 * 1e-6 + 0.5 * 1e9 * 4e-6, 1e-8);
  EXPECT_NEAR((e.momentum - m * Vec3(0.0, 0.3, -2.5)).norm(), 0.0, 1e-12);
}

TEST(UniformView, CostsCountEveryListedPairOfEverySweep) {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  state.add(1, Kind::content, {0.0, 0.0, 0.401}, Vec3::Zero(), 0.2);
  state.add(2, Kind::wall, {0.401, 0.0, 0.0}, Vec3::Zero(), 0.2);
  for (const Integrator integrator : kIntegrators) {
    const auto stepper = make_uniform_stepper(state, tests::weightless(Materials{}, 1e-5, integrator));
    EXPECT_EQ(stepper->costs().contact_evaluations, 0u) << "making a stepper costs nothing";
    stepper->advance(10);
    EXPECT_EQ(stepper->costs().contact_evaluations, integrator == Integrator::pece ? 40u : 20u);
    EXPECT_EQ(stepper->costs().ball_updates, 20u);
    EXPECT_EQ(stepper->costs().missed_contacts, 0u);
    const LevelStatistics levels = stepper->level_statistics();
    EXPECT_EQ(levels.step, std::vector<double>{1e-5});
    EXPECT_EQ(levels.balls, std::vector<double>{2.0});
    EXPECT_EQ(levels.contacts, std::vector<double>{2.0});
    EXPECT_EQ(levels.listed, 2.0);
  }
}

TEST(UniformView, NothingIsDoneByNoStep) {
  const auto stepper = make_uniform_stepper(start(), tray_setup(Integrator::predicted));
  const Outcome before = outcome(*stepper);
  stepper->advance(0);
  stepper->advance(-3);
  expect_same_bits(outcome(*stepper), before, "no step");
}

}  // namespace
}  // namespace grainclock::core
