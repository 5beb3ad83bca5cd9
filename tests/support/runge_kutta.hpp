// An integration that shares nothing with the steppers but the contact law as a scalar function:
// classical Runge-Kutta, every pair tested. For few balls.
#pragma once

#include "core/contact_law.hpp"
#include "core/scene.hpp"

#include <vector>

namespace grainclock::tests {

/// Accelerations of all balls (zero for fixed ones) from every touching or cohering pair.
inline std::vector<core::Vec3> accelerations(const core::State& state, const core::Materials& materials,
                                             const core::Vec3& gravity) {
  using core::Kind;
  const std::size_t n = state.size();
  std::vector<core::Vec3> a(n, core::Vec3::Zero());
  for (std::size_t i = 0; i < n; ++i) {
    if (state.kind[i] != Kind::content) continue;
    a[i] += gravity;
    for (std::size_t j = 0; j < n; ++j) {
      if (j == i) continue;
      const core::PairLaw& pair = materials.pair(state.kind[j]);
      const core::ContactLaw law{pair.k, pair.c, materials.cohesion / pair.k, materials.tension};
      const core::Vec3 x = state.position[i] - state.position[j];
      const core::Vec3 normal = x.normalized();
      const double overlap = state.radius[i] + state.radius[j] - x.norm();
      const double rate = -normal.dot(state.velocity[i] - state.velocity[j]);
      a[i] += core::contact_force(law, overlap, rate) / materials.mass(state.radius[i]) * normal;
    }
  }
  return a;
}

/// `state` after `seconds`, in `steps` steps of the classical scheme of order 4.
inline core::State runge_kutta(core::State state, const core::Materials& materials, const core::Vec3& gravity,
                               double seconds, int steps) {
  const double h = seconds / steps;
  const std::size_t n = state.size();
  struct Slope {
    std::vector<core::Vec3> v, a;
  };
  const auto slope = [&](const core::State& s) { return Slope{s.velocity, accelerations(s, materials, gravity)}; };
  const auto moved = [&](const Slope& k, double t) {
    core::State s = state;
    for (std::size_t i = 0; i < n; ++i) {
      s.position[i] += t * k.v[i];
      s.velocity[i] += t * k.a[i];
    }
    return s;
  };
  for (int step = 0; step < steps; ++step) {
    const Slope k1 = slope(state), k2 = slope(moved(k1, 0.5 * h)), k3 = slope(moved(k2, 0.5 * h)), k4 = slope(moved(k3, h));
    for (std::size_t i = 0; i < n; ++i) {
      state.position[i] += h / 6.0 * (k1.v[i] + 2.0 * k2.v[i] + 2.0 * k3.v[i] + k4.v[i]);
      state.velocity[i] += h / 6.0 * (k1.a[i] + 2.0 * k2.a[i] + 2.0 * k3.a[i] + k4.a[i]);
    }
  }
  return state;
}

}  // namespace grainclock::tests
