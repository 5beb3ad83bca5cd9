#include "benchmarks/kernels/scene.hpp"

#include "core/snapshot.hpp"
#include "core/stepper.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace grainclock::kernel_benchmarks {

namespace {

using core::Kind;
using core::Vec3;

constexpr double kSmallest = 0.215, kLargest = 0.225;  // m, radii
constexpr double kMean = 0.5 * (kSmallest + kLargest);
constexpr double kFraction = 0.59;         // of the room between the walls that balls fill at first
constexpr double kWidth = 10.0;            // m, of the box
constexpr int kRounds = 250, kPushes = 5;  // lists made, and pushes with each
constexpr double kPush = 0.3;              // of an overlap, so that a ball between several does not jump to and fro
constexpr std::int64_t kSettling = 300;    // steps

/// Uniform in [low, high), the same with every library.
double between(std::mt19937& bits, double low, double high) {
  return low + (high - low) * (static_cast<double>(bits()) * 0x1p-32);
}

/// Floor and four walls, one mean ball beside the other, centres on the surface.
void add_box(core::State& state, double height) {
  const int across = static_cast<int>(std::lround(kWidth / (2.0 * kMean))),
            up = static_cast<int>(height / (2.0 * kMean)) + 4;
  const double pitch = kWidth / across;
  for (int k = 0; k <= up; ++k) {
    for (int i = 0; i <= across; ++i) {
      for (int j = 0; j <= across; ++j) {
        const bool rim = i == 0 || j == 0 || i == across || j == across;
        if (k > 0 && !rim) continue;
        state.add(static_cast<core::BallId>(state.size()), Kind::wall, {pitch * i, pitch * j, pitch * k}, Vec3::Zero(),
                  kMean);
      }
    }
  }
}

/// Moves what overlaps apart, all pairs at once; balls stay in the box.
void push(core::Balls& balls, const core::NeighbourList& list, double height) {
  std::vector<Vec3> shift(balls.content_count(), Vec3::Zero());
  for (const core::PairList* pairs : {&list.ball_pairs(), &list.fixed_pairs()}) {
    for (std::size_t p = 0; p < pairs->count; ++p) {
      const std::uint32_t i = pairs->i[p], j = pairs->j[p];
      const Vec3 apart = position(balls.rows[i]) - position(balls.rows[j]);
      const double overlap = balls.rows[i].r + balls.rows[j].r - apart.norm();
      if (overlap <= 0.0) continue;
      const Vec3 move = kPush * overlap * apart.normalized();
      shift[i] += move;
      if (j < balls.content_count()) shift[j] -= move;
    }
  }
  for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
    core::BallRow& row = balls.rows[i];
    row.x = std::clamp(row.x + shift[i].x(), row.r, kWidth - row.r);
    row.y = std::clamp(row.y + shift[i].y(), row.r, kWidth - row.r);
    row.z = std::clamp(row.z + shift[i].z(), row.r, height);
  }
}

}  // namespace

Start load(const std::string& path, bool open) {
  return {path.empty() ? random_packing(20000) : core::read_state(path), open};
}

core::State random_packing(std::size_t count) {
  std::mt19937 bits(1);
  const double ball = 4.0 / 3.0 * std::numbers::pi * kMean * kMean * kMean;
  const double room = kWidth - 2.0 * kMean;  // m, between the walls' balls
  const double height = static_cast<double>(count) * ball / (kFraction * room * room);
  core::State state;
  for (std::size_t b = 0; b < count; ++b) {
    const Vec3 at(between(bits, kLargest, kWidth - kLargest), between(bits, kLargest, kWidth - kLargest),
                  between(bits, kLargest, height));
    state.add(static_cast<core::BallId>(b), Kind::content, at, Vec3::Zero(), between(bits, kSmallest, kLargest));
  }
  add_box(state, height);

  core::Balls balls(state, {}, true);
  core::NeighbourList list(0.0, {.floor = 0.25 * kMean}, 1);
  for (int round = 0; round < kRounds; ++round) {
    list.build(balls);
    for (int k = 0; k < kPushes; ++k) push(balls, list, height);
  }
  for (std::uint32_t row = 0; row < balls.content_count(); ++row) {
    state.position[static_cast<std::size_t>(balls.id[row])] = position(balls.rows[row]);
  }

  core::StepperSetup setup;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = false;
  setup.stepping.step = kStep;
  const auto settling = core::make_uniform_stepper(state, setup);
  settling->advance(kSettling);
  return settling->state();
}

core::State side_by_side(const core::State& state, int copies) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vec3 low = Vec3::Constant(kInfinity), high = -low;
  for (const Vec3& x : state.position) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  const double largest = *std::max_element(state.radius.begin(), state.radius.end());
  const Vec3 pitch = high - low + Vec3::Constant(4.0 * largest);
  const int side = static_cast<int>(std::ceil(std::sqrt(copies)));
  core::State out;
  for (int copy = 0; copy < copies; ++copy) {
    const Vec3 offset(pitch.x() * (copy % side), pitch.y() * (copy / side), 0.0);
    for (std::size_t b = 0; b < state.size(); ++b) {
      out.add(static_cast<core::BallId>(out.size()), state.kind[b], state.position[b] + offset, state.velocity[b],
              state.radius[b]);
    }
  }
  return out;
}

Scene::Scene(const Start& start, const core::Materials& of, int weight_bits)
    : materials(of),
      balls(start.state, of, !start.open),
      list(of.reach(), core::SkinRule::for_diameter(balls.mean_diameter), 1),
      scale(core::force_scale(of, kGravity, balls.mean_diameter, weight_bits, balls.content_count())) {
  list.build(balls);
}

}  // namespace grainclock::kernel_benchmarks
