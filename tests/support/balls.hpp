// Small states and setups that tests begin with.
#pragma once

#include "core/events.hpp"
#include "core/stepper.hpp"

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

namespace grainclock::tests {

using core::Vec3;

/// A direction without zero components, of length 1.
inline Vec3 oblique() { return Vec3(1.0, 2.0, -2.0) / 3.0; }

/// Uniform stepping without gravity, domain or threads; events as the integrator allows.
inline core::StepperSetup weightless(const core::Materials& materials, double step,
                                     core::Integrator integrator = core::Integrator::predicted) {
  core::StepperSetup setup;
  setup.gravity = Vec3::Zero();
  setup.materials = materials;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.integrator = integrator;
  setup.stepping.events = integrator == core::Integrator::predicted;
  setup.stepping.step = step;
  return setup;
}

/// Ball 0 flies along oblique() at `speed` towards ball 1 (content, or wall at rest), `gap` [m] away.
/// A content pair's centre of mass is at rest.
inline core::State two_balls(const core::Materials& materials, double r0, double r1, double gap, double speed,
                             core::Kind other = core::Kind::content) {
  const double m0 = materials.mass(r0), m1 = materials.mass(r1);
  const bool free = other == core::Kind::content;
  core::State state;
  state.add(0, core::Kind::content, Vec3(0.1, -0.2, 0.3), (free ? speed * m1 / (m0 + m1) : speed) * oblique(), r0);
  state.add(1, other, Vec3(0.1, -0.2, 0.3) + (r0 + r1 + gap) * oblique(),
            free ? Vec3(-speed * m0 / (m0 + m1) * oblique()) : Vec3(0.0, 0.0, 0.0), r1);
  return state;
}

/// Mass that two_balls() move with [kg].
inline double effective_mass(const core::Materials& materials, double r0, double r1, core::Kind other) {
  const double m0 = materials.mass(r0), m1 = materials.mass(r1);
  return other == core::Kind::content ? m0 * m1 / (m0 + m1) : m0;
}

/// Overlap and rate of balls number a and b of a state.
inline core::Approach approach(const core::State& state, std::size_t a = 0, std::size_t b = 1) {
  const Vec3 x = state.position[a] - state.position[b], v = state.velocity[a] - state.velocity[b];
  return {state.radius[a] + state.radius[b] - x.norm(), -x.dot(v) / x.norm()};
}

/// Uniform numbers, the same everywhere.
class Random {
 public:
  explicit Random(std::uint32_t seed) : bits_(seed) {}
  double between(double low, double high) { return low + (high - low) * (static_cast<double>(bits_()) * 0x1p-32); }
  Vec3 in_cube(double half) { return {between(-half, half), between(-half, half), between(-half, half)}; }
  Vec3 direction() {
    for (;;) {
      const Vec3 x = in_cube(1.0);
      if (x.squaredNorm() < 1.0 && x.squaredNorm() > 1e-4) return x.normalized();
    }
  }
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(between(0.0, n)); }

 private:
  std::mt19937 bits_;
};

/// A tray of fixed balls, `side` x `side` on a square lattice of one diameter in z = 0 with a rim of two layers,
/// and `layers` layers of loosely hung content above it. Ids: content first.
inline core::State tray(int side, int layers, std::uint32_t seed, double spread = 0.005) {
  Random random(seed);
  const double r = 0.22, d = 2.0 * r;
  core::State state;
  core::BallId id = 0;
  for (int k = 0; k < layers; ++k)
    for (int i = 1; i + 1 < side; ++i)
      for (int j = 1; j + 1 < side; ++j)
        state.add(id++, core::Kind::content,
                  Vec3(d * i + 0.22 * (k % 2), d * j + 0.22 * (k % 2), d + 0.46 * k) + random.in_cube(0.2 * spread),
                  random.in_cube(0.5), r + random.between(-spread, spread));
  for (int i = 0; i <= side; ++i)
    for (int j = 0; j <= side; ++j) {
      state.add(id++, core::Kind::wall, {d * i, d * j, 0.0}, Vec3::Zero(), r);
      const bool rim = i == 0 || j == 0 || i == side || j == side;
      for (int k = 1; rim && k <= layers + 1; ++k) state.add(id++, core::Kind::wall, {d * i, d * j, d * k}, Vec3::Zero(), r);
    }
  return state;
}

/// Whether two arrays hold the same bits.
template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

}  // namespace grainclock::tests
