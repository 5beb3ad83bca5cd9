// Dashpots that are not explicit: each scheme's order, limit, momentum, energy and restarts.
#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/snapshot.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/closed_forms.hpp"
#include "tests/support/order.hpp"
#include "tests/support/scratch.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>

namespace grainclock::core {
namespace {

constexpr double kRadius = 0.22;
constexpr Dashpot kSchemes[] = {Dashpot::relaxed, Dashpot::pairwise, Dashpot::solve};

StepperSetup setup_of(Dashpot dashpot, const Materials& materials, double step) {
  StepperSetup setup = tests::weightless(materials, step);
  setup.stepping.dashpot = dashpot;
  setup.stepping.events = false;
  return setup;
}

/// Dampers as Table 1 of the paper prints them: damping ratio about 3,000.
Materials printed() {
  Materials materials;
  materials.ball.c = 1e8;
  materials.wall.c = 1e7;
  return materials;
}

/// A ball pressed onto a wall ball, 1 cm deep at rest; it swings about that, `swing` [m] away at first. Along an axis, so that
/// rounding does not make it fall off.
struct Swing {
  double k, c, swing;
  bool tension = true;

  static constexpr double kRest = 0.01;  // m
  Materials materials() const {
    Materials out;
    out.wall = {k, c};
    out.tension = tension;
    return out;
  }
  double mass() const { return Materials{}.mass(kRadius); }
  double load() const { return k * kRest; }  // N
  Approach start() const { return {kRest + swing, 0.0}; }
  std::unique_ptr<Stepper> stepper(Dashpot scheme, double step) const {
    StepperSetup setup = setup_of(scheme, materials(), step);
    setup.gravity = Vec3(0.0, 0.0, -load() / mass());
    State state;
    state.add(0, Kind::content, Vec3(0.0, 0.0, 2.0 * kRadius - start().overlap), Vec3::Zero(), kRadius);
    state.add(1, Kind::wall, Vec3::Zero(), Vec3::Zero(), kRadius);
    return make_uniform_stepper(state, setup);
  }
};

class Dashpots : public testing::TestWithParam<Dashpot> {};
INSTANTIATE_TEST_SUITE_P(All, Dashpots, testing::ValuesIn(kSchemes),
                         [](const auto& tested) { return std::string(name(tested.param)); });

// ---- order ----

TEST_P(Dashpots, ConvergeWithTheSchemesOrder) {
  Swing swing{1e7, 0.0, 0.002};
  swing.c = tests::dashpot(swing.k, swing.mass(), 0.5);
  const double horizon = 2.0 / std::sqrt(swing.k / swing.mass());
  const Approach exact = tests::oscillator({swing.k, swing.c}, swing.mass(), swing.load(), swing.start(), horizon);
  std::vector<double> steps, errors;
  for (int n = 50; n <= 400; n *= 2) {
    const auto stepper = swing.stepper(GetParam(), horizon / n);
    stepper->advance(n);
    steps.push_back(horizon / n);
    errors.push_back(std::abs(tests::approach(stepper->state()).overlap - exact.overlap));
  }
  // The next term of the error is smaller by w h (1 + damping ratio) <= 0.06: it may bend the slope by about as much.
  EXPECT_NEAR(tests::fitted_order(steps, errors), GetParam() == Dashpot::relaxed ? 2.0 : 1.0, 0.08);
  // The error constant of order 1, times w h = 0.005; of order 2, its square.
  EXPECT_LT(errors.back(), 0.002 * (GetParam() == Dashpot::relaxed ? 2.5e-5 : 5e-3));
}

TEST(RelaxedDashpots, AreTheExplicitOnesWhileStepsAreShort) {
  // h lambda of a pair of balls between twelve contacts each: 24 h c / m = 0.09 and 12 h c_wall / m = 0.43: below 3/4.
  const State start = tests::tray(6, 2, 3);
  StepperSetup setup = setup_of(Dashpot::relaxed, Materials{}, 1e-5), plain = setup;
  plain.stepping.dashpot = Dashpot::explicit_;
  const auto relaxed = make_uniform_stepper(start, setup), other = make_uniform_stepper(start, plain);
  relaxed->advance(300);
  other->advance(300);
  double difference = 0.0;
  const State a = relaxed->state(), b = other->state();
  for (std::size_t i = 0; i < a.size(); ++i) difference = std::max(difference, (a.position[i] - b.position[i]).norm());
  // Positions are rounded by 1e-16 m in each of 300 steps, velocities by as much; contacts pass it on some ten times.
  EXPECT_LT(difference, 1e-11);
}

TEST_P(Dashpots, CreepAsStatedUnderAStiffDashpot) {
  // h c / m = 1.8e3: the rate follows the force at once, the overlap goes to its rest with c / k = 0.1 s.
  const Swing swing{1e9, 1e8, 0.005};
  const double h = 1e-4, horizon = 0.05;
  const auto stepper = swing.stepper(GetParam(), h);
  stepper->advance(std::lround(horizon / h));
  const double left = (tests::approach(stepper->state()).overlap - Swing::kRest) / swing.swing;
  // But for m k / c2 = 6e-6 the slow one of the two exponentials is all there is.
  const double exact = std::exp(-swing.k / swing.c * horizon);
  if (GetParam() == Dashpot::solve) {
    EXPECT_NEAR(left, exact, 1e-3);  // order 1 in h k / c = 1e-3
  } else if (GetParam() == Dashpot::pairwise) {
    // Slowed down twice, by 1 + z / 2 each time: it creeps more slowly by 4 / z. Order 1 in 4 / z = 2e-2.
    const double z = h * swing.c / swing.mass();
    EXPECT_NEAR(left, std::exp(-4.0 / z * swing.k / swing.c * horizon), 2e-2 * (1.0 - exact));
  } else {
    // It swings on the spring in series, with an overlap between rest and start.
    EXPECT_GT(left, -1.0);
    EXPECT_LT(left, 1.0);
  }
}

TEST(SplitDashpots, FollowTheSchemesRecurrence) {
  // The schemes as they are defined, on one number: half a drift, a kick whose dashpot is implicit, half a drift.
  for (const Dashpot scheme : {Dashpot::pairwise, Dashpot::solve}) {
    for (const double c : {1e4, 1e8}) {
      const Swing swing{1e7, c, 0.002};
      const double h = 1e-4, m = swing.mass(), z = h * c / m;
      const auto stepper = swing.stepper(scheme, h);
      const double damping = scheme == Dashpot::solve ? 1.0 + z : (1.0 + 0.5 * z) * (1.0 + 0.5 * z);
      double d = swing.start().overlap, u = 0.0;
      for (int n = 0; n < 100; ++n) {
        stepper->advance(1);
        d += 0.5 * h * u;
        u = (u + h * (swing.load() - swing.k * d) / m) / damping;
        d += 0.5 * h * u;
      }
      // The solve's tolerance, 1e-12 of some m/s, and the rounding of positions, 1e-16 m, in each of 100 steps.
      EXPECT_NEAR(tests::approach(stepper->state()).overlap, d, 1e-13);
      EXPECT_NEAR(tests::approach(stepper->state()).rate, u, 1e-9);
    }
  }
}

// ---- stability ----

/// By how much a swing has grown after many steps, for kappa = h2 k / m and z = h c / m.
double growth(Dashpot scheme, double kappa, double z) {
  constexpr double kStep = 1e-4, kFirst = 1e-9;  // s, m
  Swing swing{0.0, 0.0, kFirst};
  swing.k = kappa * swing.mass() / (kStep * kStep);
  swing.c = z * swing.mass() / kStep;
  const auto stepper = swing.stepper(scheme, kStep);
  double largest = 0.0;
  for (int k = 0; k < 2000; ++k) {
    stepper->advance(1);
    largest = std::max(largest, std::abs(tests::approach(stepper->state()).overlap - Swing::kRest));
    if (largest > 1e3 * kFirst) break;
  }
  return largest / kFirst;
}

TEST_P(Dashpots, AreStableUpToTheLimitAndNotBeyond) {
  for (const double z : {0.1, 0.6, 1.0, 10.0, 1e3}) {
    // Of one contact with a fixed ball lambda is c / m, so that d = max(1, 1/2 + 2/3 z).
    const double d = std::max(1.0, 0.5 + 2.0 / 3.0 * z);
    const double limit = GetParam() == Dashpot::relaxed    ? 4.0 * (1.0 - z / (2.0 * d - 1.0))
                         : GetParam() == Dashpot::pairwise ? 2.0 + 2.0 * (1.0 + 0.5 * z) * (1.0 + 0.5 * z)
                                                           : 2.0 + 2.0 * (1.0 + z);
    // Below it a swing may beat, by 1 / (1 - kappa / limit) at most. Beyond it grows by some per cent per step.
    EXPECT_LT(growth(GetParam(), 0.95 * limit, z), 100.0) << z;
    EXPECT_GT(growth(GetParam(), 1.05 * limit, z), 1e3) << z;
  }
}

/// Pressed balls in a row between two fixed ones, at rest but for tiny velocities along the row.
State chain(int balls) {
  State state;
  const double d = 2.0 * kRadius - Swing::kRest;
  tests::Random random(7);
  state.add(0, Kind::wall, Vec3::Zero(), Vec3::Zero(), kRadius);
  for (int k = 1; k <= balls; ++k)
    state.add(k, Kind::content, Vec3(0.0, 0.0, d * k), Vec3(0.0, 0.0, random.between(-1e-5, 1e-5)), kRadius);
  state.add(balls + 1, Kind::wall, Vec3(0.0, 0.0, d * (balls + 1)), Vec3::Zero(), kRadius);
  return state;
}

/// Whether the chain's kinetic energy stays within 1e4 of what it began with.
bool is_stable(Dashpot scheme, const Materials& materials, double step) {
  const auto stepper = make_uniform_stepper(chain(8), setup_of(scheme, materials, step));
  const double first = stepper->kinetic_energy();
  for (int k = 0; k < 200; ++k) {
    stepper->advance(10);
    if (stepper->kinetic_energy() > 1e4 * first) return false;
  }
  return true;
}

TEST_P(Dashpots, LimitOfAChainIsThatOfItsSpectrum) {
  // All contacts alike: modes of M^-1 K, and C = (c / k) K in each.
  Materials materials;
  const double m = materials.mass(kRadius), k = 1e7;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(8, 8);
  for (int i = 0; i < 8; ++i) {
    matrix(i, i) = 2.0 * k / m;
    if (i > 0) matrix(i, i - 1) = matrix(i - 1, i) = -k / m;
  }
  const double stiffest = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix).eigenvalues()[7];
  materials.tension = true;
  for (const double c : {0.0, 2e4, 1e6, 1e9}) {
    materials.ball = materials.wall = {k, c};
    Stepping stepping;
    stepping.dashpot = GetParam();
    const StepBounds bounds = critical_steps(chain(8), materials, false, stepping);
    EXPECT_TRUE(is_stable(GetParam(), materials, bounds.smallest)) << c;
    // The springs' own limit, which pairwise and solve never fall below: without dashpots it is theirs, 2 per cent either way.
    const double springs = 2.0 / std::sqrt(stiffest);
    if (GetParam() == Dashpot::relaxed) {
      EXPECT_LT(bounds.smallest, springs);
      EXPECT_TRUE(c > 0.0 || !is_stable(GetParam(), materials, 1.02 * springs));
      continue;
    }
    EXPECT_TRUE(is_stable(GetParam(), materials, 0.98 * springs)) << c;
    EXPECT_TRUE(c > 0.0 || !is_stable(GetParam(), materials, 1.02 * springs));
    if (GetParam() != Dashpot::solve || c == 0.0 || c > 1e6) continue;
    // h2 w2 = 4 + 2 h w2 c / k in the stiffest mode.
    const double z = stiffest * c / k, limit = (z + std::sqrt(z * z + 4.0 * stiffest)) / stiffest;
    EXPECT_TRUE(is_stable(GetParam(), materials, 0.98 * limit)) << c;
    EXPECT_FALSE(is_stable(GetParam(), materials, 1.02 * limit)) << c;
  }
}

// ---- impacts with printed dampers ----

TEST_P(Dashpots, StopAnImpactOrLetItBounceAsStated) {
  for (const double step : {1e-4, 1e-5}) {
    const Materials materials = printed();
    const State start = tests::two_balls(materials, kRadius, kRadius, 0.3 * step, 1.0);
    const auto stepper = make_uniform_stepper(start, setup_of(GetParam(), materials, step));
    stepper->advance(100);
    const Approach end = tests::approach(stepper->state());
    if (GetParam() == Dashpot::relaxed) {
      // h lambda is far above 1: z = h lambda, and the pair of f and u turns by half a circle at 0.8 per step.
      EXPECT_LT(end.rate, 0.0) << step;
      EXPECT_GT(end.rate, -1.0) << step;
    } else {
      // What is left of 1 m/s after one step: m_eff / (h c) at most.
      EXPECT_NEAR(end.rate, 0.0, 1.01 * 0.5 * materials.mass(kRadius) / (step * materials.ball.c)) << step;
      EXPECT_GT(end.overlap, 0.0) << step;
      EXPECT_LT(end.overlap, step) << step;  // the touch falls into half a step
    }
  }
}

TEST_P(Dashpots, LetPartingBallsGo) {
  const Materials materials = printed();
  const State start = tests::two_balls(materials, kRadius, kRadius, -2e-4, -1.0);
  const auto stepper = make_uniform_stepper(start, setup_of(GetParam(), materials, 1e-4));
  stepper->advance(10);
  // The spring's push, 2000 N for two steps at most, over half a mass, is all that a clamped contact may give.
  EXPECT_NEAR(tests::approach(stepper->state()).rate, -1.0, 2e-4 * 2000.0 / (0.5 * materials.mass(kRadius)));
}

// ---- packings ----

/// Balls fallen onto a tray, with printed dampers.
StepperSetup tray_setup(Dashpot scheme, double step = 1e-4) {
  StepperSetup setup = setup_of(scheme, printed(), step);
  setup.gravity = Vec3(0.0, 0.0, -9.81);
  return setup;
}

TEST_P(Dashpots, KeepMomentumAndTakeEnergyAtThePapersStep) {
  const State start = tests::tray(6, 3, 1);
  const auto stepper = make_uniform_stepper(start, tray_setup(GetParam()));
  const Energies first = stepper->energies();
  Energies now = first;
  for (int k = 0; k < 100; ++k) {
    const double before = now.total();
    stepper->advance(100);
    now = stepper->energies();
    // Every part of the step takes energy, but the springs' swing: w h = 0.4 at the wall, 4 % of some elastic energy.
    EXPECT_TRUE(GetParam() == Dashpot::relaxed || now.total() < before + 1e-3 * first.kinetic) << k;
  }
  // Rounding of velocities, 1e-16 in each of 10,000 steps at random.
  EXPECT_LT(momentum_residual(first, now, stepper->ledger()), 1e-13);
  // The paper's dampers leave no bounce, but frictionless balls go on swinging in their hollows for a while; relaxed ones bounce.
  const double lost = first.total() - now.total();
  EXPECT_GT(lost, 0.0);
  EXPECT_TRUE(GetParam() == Dashpot::relaxed || now.kinetic < 0.1 * lost) << now.kinetic << " of " << lost;
}

TEST_P(Dashpots, BookTheWorkOfEveryContact) {
  // Ordinary dampers. The ledger closes with the scheme's order in the smooth part of the motion, impacts with order 1.
  double residual[2];
  for (const int refined : {0, 1}) {
    StepperSetup setup = setup_of(GetParam(), Materials{}, refined != 0 ? 1e-5 : 4e-5);
    const auto stepper = make_uniform_stepper(tests::tray(6, 2, 1), setup);
    const Energies first = stepper->energies();
    stepper->advance(refined != 0 ? 8000 : 2000);
    residual[refined] = energy_residual(first, stepper->energies(), stepper->ledger());
  }
  EXPECT_LT(residual[0], 2e-2);  // w h = 0.17 at the wall, and half its square
  EXPECT_LT(residual[1], 0.5 * residual[0]);
}

TEST_P(Dashpots, GiveTheSameBitsWithAnyListAndThreads) {
  const State start = tests::tray(6, 2, 5);
  StepperSetup setup = tray_setup(GetParam()), other = setup;
  other.threads = 2;
  other.skin = 0.001;
  const auto one = make_uniform_stepper(start, setup), two = make_uniform_stepper(start, other);
  one->advance(1500);
  two->advance(1500);
  const State a = one->state(), b = two->state();
  EXPECT_TRUE(tests::same_bits(a.position, b.position));
  EXPECT_TRUE(tests::same_bits(a.velocity, b.velocity));
  EXPECT_EQ(a.dashpot_force, b.dashpot_force);
  EXPECT_EQ(one->ledger().dissipated, two->ledger().dissipated);
  EXPECT_NE(one->costs().list_builds, two->costs().list_builds);
}

TEST_P(Dashpots, GoOnBitwiseFromAFile) {
  const tests::Scratch scratch;
  StepperSetup setup = tray_setup(GetParam());
  setup.first_impact = true;
  const State start = tests::tray(6, 2, 5);
  const auto whole = make_uniform_stepper(start, setup);
  whole->advance(1200);
  auto stepper = make_uniform_stepper(start, setup);
  for (const int steps : {137, 400, 1, 662}) {
    stepper->advance(steps);
    write_state(scratch / "state.h5", stepper->state());
    StepperSetup next = setup;
    next.ledger = stepper->ledger();
    next.costs = stepper->costs();
    next.steps_done = stepper->steps_done();
    const State stored = read_state(scratch / "state.h5");
    stepper = make_uniform_stepper(stored, next);
  }
  const State a = whole->state(), b = stepper->state();
  EXPECT_TRUE(tests::same_bits(a.position, b.position));
  EXPECT_TRUE(tests::same_bits(a.velocity, b.velocity));
  EXPECT_FALSE(a.dashpot_force.empty());
  EXPECT_EQ(a.dashpot_force, b.dashpot_force);
  EXPECT_EQ(whole->ledger().dissipated, stepper->ledger().dissipated);
  EXPECT_EQ(whole->ledger().first_impact, stepper->ledger().first_impact);
  EXPECT_GT(whole->ledger().first_impact, 0.0);
}

TEST_P(Dashpots, ReportTheForcesThatAct) {
  // A ball at rest: whatever its dashpot, the contacts carry its weight. 1e8 times the rounding of rates would be 1e-8 N.
  const Swing swing{1e9, 1e7, 0.0};
  const auto stepper = swing.stepper(GetParam(), 1e-4);
  stepper->advance(100);
  const std::vector<Contact> contacts = stepper->contacts();
  ASSERT_EQ(contacts.size(), 1U);
  // Overlaps are rounded by 1e-16 m, 1e9 N/m; the load is 1e7 N.
  EXPECT_NEAR(contacts[0].force.norm(), swing.load(), 1e-6 * swing.load());
}

TEST_P(Dashpots, CountAndDropWhatLeaves) {
  State start = tests::tray(6, 2, 5);
  StepperSetup setup = tray_setup(GetParam());
  setup.domain.outlet_z = 0.5;  // above the lower layer: those go in the first steps, and others after them
  const auto stepper = make_uniform_stepper(start, setup);
  const Energies first = stepper->energies();
  stepper->advance(3000);
  EXPECT_GT(stepper->ledger().discharged, 16);
  EXPECT_EQ(stepper->state().count(Kind::content) + static_cast<std::size_t>(stepper->ledger().discharged),
            start.count(Kind::content));
  EXPECT_LT(momentum_residual(first, stepper->energies(), stepper->ledger()), 1e-13);  // rounding
}

// ---- what is refused ----

TEST_P(Dashpots, RefuseWhatDoesNotGoWithThem) {
  const State state = tests::tray(5, 1, 1);
  const auto refusal = [&](auto change) {
    StepperSetup setup = setup_of(GetParam(), Materials{}, 1e-4);
    change(setup);
    return tests::message_of<InputError>([&] { (void)make_uniform_stepper(state, setup); });
  };
  EXPECT_NE(refusal([](StepperSetup& s) { s.stepping.events = true; }).find("events = false"), std::string::npos);
  EXPECT_NE(refusal([](StepperSetup& s) { s.materials.cohesion = 10.0; }).find("cohesion"), std::string::npos);
  for (const Integrator integrator : {Integrator::lagged, Integrator::pece})
    EXPECT_NE(refusal([&](StepperSetup& s) { s.stepping.integrator = integrator; }).find("use \"predicted\""), std::string::npos);
}

TEST_P(Dashpots, SayWhereTheNumbersFail) {
  // A wall contact stepped at three times its springs' limit, hit at speed.
  const Materials materials;
  const double step = 3.0 * critical_step_of_pair({materials.wall.k, 0.0}, 1.0 / materials.mass(kRadius), Integrator::predicted);
  const State start = tests::two_balls(materials, kRadius, kRadius, 0.01, 75.0, Kind::wall);
  const auto stepper = make_uniform_stepper(start, setup_of(GetParam(), materials, step));
  const std::string text = tests::message_of<NumericsError>([&] { stepper->advance(1000); });
  EXPECT_NE(text.find("ball 0"), std::string::npos) << text;
  EXPECT_NE(text.find("smaller step"), std::string::npos) << text;
}

}  // namespace
}  // namespace grainclock::core
