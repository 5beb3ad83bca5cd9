#include "benchmarks/scale/settle.hpp"

#include "core/force_scale.hpp"
#include "core/neighbours.hpp"
#include "core/stepper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

namespace grainclock::scale {

namespace {

// A move is this share of force over stiffness and what is carried on of the last move (heavy ball). The largest
// eigenvalue of a contact network is about 12 k: shares up to 2 (1 + momentum) / 12 converge.
constexpr double kShare = 0.2, kMomentum = 0.92;
constexpr double kFarthest = 0.02;     // m, in one round
constexpr double kSkin = 0.06;         // m, of the pair list

struct Stage {
  double wall_share;  // of the scene's wall stiffness
  double step;        // s
  int steps;
};
// Walls become stiff by stages: an overlap that carried a weight on a soft wall would be a blow on a stiff one.
// All stages but the last end with the balls stopped.
constexpr Stage kStages[] = {{0.03, 2e-4, 50}, {0.1, 2e-4, 50}, {0.3, 1.5e-4, 50}, {1.0, 8e-5, 50}, {1.0, 8e-5, 200}};
constexpr double kBallDamper = 3e4, kWallDamper = 9e4;  // N s/m, as in filling

core::StepperSetup setup_for(const core::Materials& materials, double gravity, double step, int threads) {
  core::StepperSetup setup;
  setup.gravity = {0.0, 0.0, -gravity};
  setup.materials = materials;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = false;
  setup.stepping.step = step;
  setup.threads = threads;
  return setup;
}

}  // namespace

void push_apart(core::State& state, const core::Materials& materials, double gravity, int rounds, int threads) {
  core::Balls balls(state, materials, true);
  for (core::BallRow& row : balls.rows) row.vx = row.vy = row.vz = 0.0;
  core::NeighbourList list(0.0, core::SkinRule{kSkin, 0.0, 0.0}, threads);
  core::Materials soft = materials;
  soft.wall = soft.ball;
  // Overlaps may be as deep as the balls: the limit only sets the unit of the sums.
  const core::ForceScale scale =
      core::force_scale(soft, gravity, balls.mean_diameter, 1, balls.content_count(), soft.ball.k * balls.mean_diameter);
  const core::SweepLaw ball_law = core::sweep_law(soft, false, scale, 0.0), fixed_law = core::sweep_law(soft, true, scale, 0.0);

  const std::uint32_t n = balls.content_count();
  std::vector<core::IntVec> sums(n + std::size_t{1});
  std::vector<std::array<float, 3>> move(n);  // m, of the last round
  bool worn = true;
  for (int round = 0; round < rounds; ++round) {
    if (worn) core::reorder_like(move, list.build(balls), balls.spare);
    core::SweepTotals totals;
    core::kernels().sweep(balls.rows.data(), list.ball_pairs().span(), ball_law, sums.data(), totals, nullptr);
    core::kernels().sweep(balls.rows.data(), list.fixed_pairs().span(), fixed_law, sums.data(), totals, nullptr);
    worn = false;
    const double share = kShare / soft.ball.k;  // m/N
    for (std::uint32_t i = 0; i < n; ++i) {
      core::BallRow& row = balls.rows[i];
      const core::IntVec& sum = sums[i];
      core::Vec3 force(static_cast<double>(sum.v[0]), static_cast<double>(sum.v[1]), static_cast<double>(sum.v[2]));
      force *= scale.unit;
      force.z() -= gravity / balls.inverse_mass[i];
      core::Vec3 by = kMomentum * Eigen::Map<const Eigen::Vector3f>(move[i].data()).cast<double>() + share * force;
      by *= std::min(1.0, kFarthest / std::max(kFarthest, by.norm()));
      Eigen::Map<Eigen::Vector3f>(move[i].data()) = by.cast<float>();
      row.x += by.x();
      row.y += by.y();
      row.z += by.z();
      const core::SkinReference& skin = list.skins()[i];
      worn = worn || (core::position(row) - core::Vec3(skin.x, skin.y, skin.z)).squaredNorm() > skin.skin2;
      sums[i] = {};
    }
    sums.back() = {};
  }

  for (std::uint32_t i = 0; i < n; ++i) {
    const auto at = std::lower_bound(state.id.begin(), state.id.end(), balls.id[i]) - state.id.begin();
    state.position[static_cast<std::size_t>(at)] = core::position(balls.rows[i]);
  }
}

core::State settle(const core::State& state, const core::Materials& materials, double gravity, int threads) {
  core::State now = state;
  for (const Stage& stage : kStages) {
    core::Materials strong = materials;
    strong.wall.k *= stage.wall_share;
    strong.ball.c = std::max(strong.ball.c, kBallDamper);
    strong.wall.c = std::max(stage.wall_share < 1.0 ? 0.0 : strong.wall.c, kWallDamper);
    const auto stepper = core::make_uniform_stepper(now, setup_for(strong, gravity, stage.step, threads));
    stepper->advance(stage.steps);
    now = stepper->state();
    if (&stage != std::end(kStages) - 1) std::fill(now.velocity.begin(), now.velocity.end(), core::Vec3::Zero());
    now.evaluated_position.clear();
    now.evaluated_velocity.clear();
    now.level.clear();
    now.impacted.clear();
  }
  now.time = 0.0;
  return now;
}

Load load_of(const core::State& state, const core::Materials& materials, double gravity, int threads) {
  const auto stepper = core::make_uniform_stepper(state, setup_for(materials, gravity, 1e-5, threads));
  Load load;
  const auto balls = static_cast<double>(state.count(core::Kind::content));
  const std::vector<core::Contact> contacts = stepper->contacts();
  for (const core::Contact& c : contacts) load.mean_overlap += c.overlap / static_cast<double>(contacts.size());
  load.contacts_per_ball = static_cast<double>(contacts.size()) / balls;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] == core::Kind::content)
      load.kinetic_per_ball += 0.5 * materials.mass(state.radius[i]) * state.velocity[i].squaredNorm() / balls;
  }
  return load;
}

std::string describe(const Load& load) {
  return fmt::format("{:.3f} contacts a ball, mean overlap {:.3g} m, kinetic energy {:.3g} J a ball", load.contacts_per_ball,
                     load.mean_overlap, load.kinetic_per_ball);
}

}  // namespace grainclock::scale
