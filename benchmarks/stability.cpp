#include "benchmarks/stability.hpp"

#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/stepper.hpp"
#include "multirate/stepper.hpp"
#include "silo/filling.hpp"
#include "silo/phases.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::Materials;
using core::PairLaw;
using core::State;
using core::Vec3;

constexpr double kRadius = 0.22;   // m, the mean of Table 1
constexpr double kGravity = 9.81;  // m/s2
constexpr int kChainBalls = 12;
constexpr double kKick = 1e-5;   // displacement over the smallest overlap
constexpr double kFaded = 1e-4;  // a perturbation that has shrunk to this part is followed no further

PairLaw damped(double stiffness, double effective_mass, double damping_ratio) {
  return {stiffness, 2.0 * damping_ratio * std::sqrt(stiffness * effective_mass)};
}

/// Materials whose contacts of balls of this radius have this damping ratio.
Materials materials_of(double k_ball, double k_wall, double damping_ratio, double radius = kRadius) {
  Materials materials;
  const double mass = materials.mass(radius);
  materials.ball = damped(k_ball, 0.5 * mass, damping_ratio);
  materials.wall = damped(k_wall, mass, damping_ratio);
  materials.tension = true;
  return materials;
}

core::StepperSetup setup_of(const PressedSystem& system, core::Integrator integrator, double step) {
  core::StepperSetup setup;
  setup.gravity = system.gravity;
  setup.materials = system.materials;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.integrator = integrator;
  setup.stepping.events = false;
  setup.stepping.step = step;
  return setup;
}

std::vector<std::size_t> content_of(const State& state) {
  std::vector<std::size_t> content;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] == Kind::content) content.push_back(i);
  }
  return content;
}

Eigen::ArrayXd radii_of(const State& state) {
  const std::vector<std::size_t> content = content_of(state);
  Eigen::ArrayXd radii(static_cast<Eigen::Index>(content.size()));
  for (std::size_t a = 0; a < content.size(); ++a) radii[static_cast<Eigen::Index>(a)] = state.radius[content[a]];
  return radii;
}

/// Calls work(a, j, overlap, normal) for every touching pair: a counts the content, j all balls; the normal points at a.
/// Pairs among content come once.
template <class Work>
void for_each_contact(const State& state, Work work) {
  const std::vector<std::size_t> content = content_of(state);
  for (std::size_t a = 0; a < content.size(); ++a) {
    const std::size_t i = content[a];
    for (std::size_t j = 0; j < state.size(); ++j) {
      if (state.kind[j] == Kind::content && j <= i) continue;
      const Vec3 between = state.position[i] - state.position[j];
      const double overlap = state.radius[i] + state.radius[j] - between.norm();
      if (overlap > 0.0) work(a, j, overlap, between.normalized());
    }
  }
}

double smallest_overlap(const State& state) {
  double smallest = std::numeric_limits<double>::infinity();
  for_each_contact(state,
                   [&](std::size_t, std::size_t, double overlap, const Vec3&) { smallest = std::min(smallest, overlap); });
  return smallest;
}

/// Square roots of the masses along each direction of motion.
Eigen::VectorXd root_mass(const PressedSystem& system) {
  const std::vector<std::size_t> content = content_of(system.state);
  Eigen::VectorXd out(static_cast<Eigen::Index>(content.size()) * system.axes);
  for (std::size_t a = 0; a < content.size(); ++a) {
    out.segment(static_cast<Eigen::Index>(a) * system.axes, system.axes)
        .setConstant(std::sqrt(system.materials.mass(system.state.radius[content[a]])));
  }
  return out;
}

/// The content's vectors along the directions of motion, one after the other.
Eigen::VectorXd flat(const State& state, const std::vector<Vec3>& values, int axes) {
  const std::vector<std::size_t> content = content_of(state);
  Eigen::VectorXd out(static_cast<Eigen::Index>(content.size()) * axes);
  for (std::size_t a = 0; a < content.size(); ++a) {
    out.segment(static_cast<Eigen::Index>(a) * axes, axes) = values[content[a]].head(axes);
  }
  return out;
}

void add_flat(const State& state, std::vector<Vec3>& values, const Eigen::VectorXd& change, int axes) {
  const std::vector<std::size_t> content = content_of(state);
  for (std::size_t a = 0; a < content.size(); ++a) {
    values[content[a]].head(axes) += change.segment(static_cast<Eigen::Index>(a) * axes, axes);
  }
}

/// The system and a copy of it with every mode moved by the same small displacement, and with the velocity that it swings
/// through its rest with. Either alone might be just what some step kills at once.
class Twins {
 public:
  Twins(const PressedSystem& system, core::Integrator integrator, double step)
      : axes_(system.axes), root_mass_(root_mass(system)), spring_(linearised(system).spring) {
    const core::StepperSetup setup = setup_of(system, integrator, step);
    const Modes all = modes({spring_, {}});
    const double displacement = kKick * smallest_overlap(system.state) * root_mass_.mean();
    const Eigen::VectorXd frequency = all.square_frequency.cwiseMax(0.0).cwiseSqrt();
    const double per_mode = displacement / std::sqrt(static_cast<double>(frequency.size()));
    const Eigen::VectorXd move = all.shape * Eigen::VectorXd::Constant(frequency.size(), per_mode);
    const Eigen::VectorXd kick = all.shape * frequency * per_mode;
    State kicked = system.state;
    add_flat(kicked, kicked.position, move.cwiseQuotient(root_mass_), axes_);
    add_flat(kicked, kicked.velocity, kick.cwiseQuotient(root_mass_), axes_);
    calm_ = core::make_uniform_stepper(system.state, setup);
    kicked_ = core::make_uniform_stepper(kicked, setup);
  }

  void advance(int steps) {
    calm_->advance(steps);
    kicked_->advance(steps);
  }

  /// sqrt(kinetic + elastic energy) of their difference.
  double difference() const {
    const State calm = calm_->state(), kicked = kicked_->state();
    const auto scaled = [&](const std::vector<Vec3>& a, const std::vector<Vec3>& b) -> Eigen::VectorXd {
      return (flat(kicked, a, axes_) - flat(calm, b, axes_)).cwiseProduct(root_mass_);
    };
    const Eigen::VectorXd x = scaled(kicked.position, calm.position), v = scaled(kicked.velocity, calm.velocity);
    return std::sqrt(0.5 * (v.squaredNorm() + x.dot(spring_ * x)));
  }

 private:
  int axes_;
  Eigen::VectorXd root_mass_;
  Eigen::MatrixXd spring_;
  std::unique_ptr<core::Stepper> calm_, kicked_;
};

/// Steps a packing under its weight, with Table 1's materials.
core::StepperSetup settling_setup(const State& state) {
  core::StepperSetup setup;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = false;
  const Materials& materials = setup.materials;
  // A ball between several wall balls stays stable too.
  setup.stepping.step = 0.3 * core::critical_step_of_pair(materials.wall, 1.0 / materials.mass(radii_of(state).minCoeff()),
                                                          setup.stepping.integrator);
  return setup;
}

/// Levels of the content.
std::vector<int> levels(const State& state) {
  std::vector<int> out;
  for (const std::size_t i : content_of(state)) out.push_back(state.level[i]);
  return out;
}

bool is_pinned(int ball) { return ball < 3 || ball >= kChainBalls - 3; }

}  // namespace

std::string_view name(SystemKind kind) {
  switch (kind) {
    case SystemKind::pair:
      return "pair";
    case SystemKind::wall:
      return "wall";
    case SystemKind::chain:
      return "chain";
    case SystemKind::packing:
      return "packing";
  }
  return "?";
}

PressedSystem pressed_pair(double damping_ratio) {
  constexpr double k = 1e7, softer = 1e-3, r0 = 0.2, r1 = 0.25, overlap = 1e-5, wall_overlap = overlap / softer;
  PressedSystem pair;
  pair.materials = materials_of(k, softer * k, damping_ratio);
  const double m0 = pair.materials.mass(r0), m1 = pair.materials.mass(r1);
  pair.materials.ball = damped(k, m0 * m1 / (m0 + m1), damping_ratio);
  const double x1 = r0 + r1 - overlap;
  pair.state.add(0, Kind::content, Vec3::Zero(), Vec3::Zero(), r0);
  pair.state.add(1, Kind::content, Vec3(x1, 0.0, 0.0), Vec3::Zero(), r1);
  pair.state.add(2, Kind::wall, Vec3(wall_overlap - 2.0 * r0, 0.0, 0.0), Vec3::Zero(), r0);
  pair.state.add(3, Kind::wall, Vec3(x1 + 2.0 * r1 - wall_overlap, 0.0, 0.0), Vec3::Zero(), r1);
  return pair;
}

PressedSystem pressed_wall(double damping_ratio) {
  constexpr double k = 1e9, overlap = 1e-5;
  PressedSystem wall;
  wall.materials = materials_of(1e7, k, damping_ratio);
  wall.gravity.x() = -k * overlap / wall.materials.mass(kRadius);
  wall.state.add(0, Kind::content, Vec3(2.0 * kRadius - overlap, 0.0, 0.0), Vec3::Zero(), kRadius);
  wall.state.add(1, Kind::wall, Vec3::Zero(), Vec3::Zero(), kRadius);
  return wall;
}

PressedSystem pressed_chain(double damping_ratio) {
  constexpr double k = 1e7, overlap = 1e-4;
  PressedSystem chain;
  chain.materials = materials_of(k, k, damping_ratio);
  double end = 0.0, golden = 0.0;  // m, where the last ball ends; golden: evenly spread numbers in [0, 1)
  for (int i = 0; i < kChainBalls; ++i) {
    golden = std::fmod(golden + 0.618, 1.0);
    const double r = 0.215 + 0.01 * golden;
    chain.state.add(i, Kind::content, Vec3(end - overlap + r, 0.0, 0.0), Vec3::Zero(), r);
    end += 2.0 * r - overlap;
  }
  chain.state.add(kChainBalls, Kind::wall, Vec3(-kRadius, 0.0, 0.0), Vec3::Zero(), kRadius);
  chain.state.add(kChainBalls + 1, Kind::wall, Vec3(end - overlap + kRadius, 0.0, 0.0), Vec3::Zero(), kRadius);
  return chain;
}

PressedSystem pressed_packing(double damping_ratio, State settled) {
  PressedSystem packing;
  packing.materials = materials_of(1e7, 1e9, damping_ratio, radii_of(settled).mean());
  packing.state = std::move(settled);
  packing.gravity.z() = -kGravity;
  packing.axes = 3;
  return packing;
}

State small_packing() {
  constexpr std::uint64_t kSeed = 4;  // of the first eight the one that comes to rest soonest
  silo::SiloShape shape;
  shape.half_width = 0.75;
  shape.height = 1.8;
  shape.hopper_height = 0.4;
  shape.half_outlet = 0.4;
  shape.balls = 32;
  shape.surface = silo::Surface::inner;
  shape.collar = 4.0;
  silo::Silo silo = silo::build_silo(shape, kSeed);
  core::StepperSetup setup = settling_setup(silo.state);
  setup.first_impact = true;
  const auto filling = core::make_uniform_stepper(silo.state, setup);
  filling->advance(20000);
  State filled = silo::fresh(filling->state());
  silo::remove_collar(filled, silo.first_collar);
  return settled(std::move(filled), "the small packing");
}

State settled(State state, std::string_view source) {
  constexpr int kSteps = 600000, kLook = 1000;
  for (Vec3& v : state.velocity) v.setZero();
  const core::StepperSetup setup = settling_setup(state);
  const double r = radii_of(state).mean();
  const double at_rest = 1e-16 * setup.materials.mass(r) * kGravity * r * static_cast<double>(state.count(Kind::content));
  const auto stepper = core::make_uniform_stepper(state, setup);
  for (int done = 0; done < kSteps; done += kLook) {
    stepper->advance(kLook);
    if (stepper->energies().kinetic >= at_rest) continue;
    State out = silo::fresh(stepper->state());
    for (Vec3& v : out.velocity) v.setZero();
    return out;
  }
  throw core::NumericsError(fmt::format(
      "{}: still moving after {:.3g} s under its weight with the outlet closed (kinetic energy {:.3g} J, at rest below "
      "{:.3g} J); give a packing whose balls all rest on others or on the wall",
      source, kSteps * *setup.stepping.step, stepper->energies().kinetic, at_rest));
}

LinearSystem linearised(const PressedSystem& system) {
  const State& state = system.state;
  const Eigen::VectorXd root = root_mass(system);
  const Eigen::Index n = root.size(), axes = system.axes;
  LinearSystem out{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n)};
  std::vector<Eigen::Index> number(state.size(), -1);
  Eigen::Index count = 0;
  for (const std::size_t i : content_of(state)) number[i] = count++;
  for_each_contact(state, [&](std::size_t a, std::size_t j, double, const Vec3& normal) {
    // Along this one direction of all the balls' motions the contact is pressed.
    Eigen::VectorXd along = Eigen::VectorXd::Zero(n);
    const auto add = [&](Eigen::Index ball, double sign) {
      along.segment(ball * axes, axes) = sign / root[ball * axes] * normal.head(axes);
    };
    add(static_cast<Eigen::Index>(a), 1.0);
    if (number[j] >= 0) add(number[j], -1.0);
    const PairLaw& law = system.materials.pair(state.kind[j]);
    out.spring += law.k * along * along.transpose();
    out.dashpot += law.c * along * along.transpose();
  });
  return out;
}

Growth measured_growth(const PressedSystem& system, core::Integrator integrator, double step, int steps) {
  Twins twins(system, integrator, step);
  struct Look {
    int at;
    double size;
  };
  std::vector<Look> looks{{0, twins.difference()}};
  const auto total = [&] { return looks.back().size / looks.front().size; };
  // Where h c = 2 m a lagged swing that grows comes through rest, for one look.
  const auto has_faded = [&] {
    const double limit = kFaded * looks.front().size;
    return looks.size() > 1 && looks.back().size < limit && (looks.end() - 2)->size < limit;
  };
  while (looks.back().at < steps && total() < kGrown && !has_faded()) {
    const int now = looks.back().at, next = std::min(steps, now + std::max(1, now / 8));
    twins.advance(next - now);
    looks.push_back({next, twins.difference()});
  }
  const Look& last = looks.back();
  const auto middle = std::find_if(looks.begin(), looks.end(), [&](const Look& look) { return 2 * look.at >= last.at; });
  const Look& from = middle->at < last.at ? *middle : looks.front();
  return {total(), std::pow(last.size / from.size, 1.0 / (last.at - from.at))};
}

double measured_limit(const PressedSystem& system, core::Integrator integrator, int steps) {
  double stable = 0.0, unstable = 1.1 * undamped_critical_step(linearised(system));
  while (unstable - stable > 2e-3 * unstable) {
    const double middle = 0.5 * (stable + unstable);
    (measured_growth(system, integrator, middle, steps).total >= kGrown ? unstable : stable) = middle;
  }
  return 0.5 * (stable + unstable);
}

LevelledChain levelled_chain(int ratio, double step_ratio, double damping_ratio) {
  constexpr double k = 1e7, overlap = 4e-3;
  const double mass = Materials{}.mass(kRadius);
  LevelledChain chain;
  chain.ratio = ratio;
  chain.step = step_ratio * std::sqrt(mass / k);
  // Two pins need 2 k_pin h2 <= 4 m, up to 1.5 times the fine step: half of the next coarser one is not enough for them.
  const double fine = 1.5 * chain.step / ratio, k_pin = 2.0 * mass / (fine * fine);
  const double pin_overlap = overlap * k / k_pin;
  PressedSystem& system = chain.system;
  system.materials = materials_of(k, k_pin, damping_ratio);
  const double spacing = 2.0 * kRadius - overlap, middle = 0.5 * (kChainBalls - 1);
  for (int i = 0; i < kChainBalls; ++i) {
    system.state.add(i, Kind::content, Vec3((i - middle) * spacing, 0.0, 0.0), Vec3::Zero(), kRadius);
  }
  core::BallId id = kChainBalls;
  for (const double side : {-1.0, 1.0}) {
    const double x = side * (middle * spacing + 2.0 * kRadius - pin_overlap);
    system.state.add(id++, Kind::wall, Vec3(x, 0.0, 0.0), Vec3::Zero(), kRadius);
    if (ratio == 1) continue;
    for (int i = 0; i < kChainBalls; ++i) {
      // Hardly pressed, so that they push the ball along the chain by next to nothing when it moves.
      const Vec3 off(0.0, 0.0, side * (2.0 * kRadius - 0.1 * pin_overlap));
      if (is_pinned(i)) system.state.add(id++, Kind::wall, system.state.position[i] + off, Vec3::Zero(), kRadius);
    }
  }
  return chain;
}

double multirate_growth_rate(const LevelledChain& chain) {
  const PressedSystem& system = chain.system;
  core::StepperSetup setup = setup_of(system, core::Integrator::predicted, chain.step);
  setup.stepping.method = core::Method::multirate;
  setup.stepping.tolerance = 1e6;  // levels from stability alone
  const int finer = static_cast<int>(std::lround(std::log2(chain.ratio)));
  setup.stepping.levels = 1 + finer;
  setup.stepping.limiter = std::max(1, finer);
  std::vector<int> wanted;
  for (int i = 0; i < kChainBalls; ++i) wanted.push_back(is_pinned(i) ? 0 : finer);

  const auto require_levels = [&](const State& state) {
    const std::vector<int> its = levels(state);
    for (std::size_t i = 0; i < its.size(); ++i) {
      if (its[i] == wanted[i]) continue;
      throw core::NumericsError(fmt::format(
          "ball {} of the chain is on level {} instead of {}; use smaller steps or less damping", i, its[i], wanted[i]));
    }
  };

  // A thirtieth of the overlap at the ends: no contact opens.
  const double size = (2.0 * kRadius - (system.state.position[kChainBalls] - system.state.position[0]).norm()) / 30.0;
  // Speeds are classed relative to that of the whole chain, so all motions are added to one in which no ball rests.
  State moving = system.state;
  for (int i = 0; i < kChainBalls; ++i)
    moving.velocity[static_cast<std::size_t>(i)].x() = (i % 2 == 0 ? size : -size) / chain.step;
  moving.evaluated_position = moving.position;
  moving.evaluated_velocity = moving.velocity;

  // Where classes are renewed, positions, velocities and the velocities last seen by the dashpots are all there is.
  int interval = 0;  // coarse steps
  const auto first = multirate::make_stepper(moving, setup);
  do {
    first->advance(1);
    ++interval;
  } while (!first->is_checkpointable());
  const auto after_interval = [&](const State& start) {
    const auto stepper = multirate::make_stepper(start, setup);
    require_levels(stepper->state());
    stepper->advance(interval);
    const State end = stepper->state();
    require_levels(end);
    Eigen::VectorXd out(3 * kChainBalls);
    out << flat(end, end.position, 1), chain.step * flat(end, end.velocity, 1),
        chain.step * flat(end, end.evaluated_velocity, 1);
    return out;
  };
  Eigen::MatrixXd matrix(3 * kChainBalls, 3 * kChainBalls);
  for (int column = 0; column < matrix.cols(); ++column) {
    const auto moved = [&](double by) {
      State start = moving;
      const std::size_t ball = static_cast<std::size_t>(column % kChainBalls);
      const int what = column / kChainBalls;
      if (what == 0) start.position[ball].x() += by;
      if (what == 1) start.velocity[ball].x() += by / chain.step;
      if (what == 2) start.evaluated_velocity[ball].x() += by / chain.step;
      start.evaluated_position = start.position;
      return after_interval(start);
    };
    matrix.col(column) = (moved(size) - moved(-size)) / (2.0 * size);
  }
  return std::log(spectral_radius(matrix)) / (interval * chain.step);
}

}  // namespace grainclock::benchmarks
