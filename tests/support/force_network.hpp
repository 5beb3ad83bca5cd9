// Balls and the forces between them laid down by hand, for measures that look at contacts.
#pragma once

#include "core/stepper.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <random>
#include <vector>

namespace grainclock::tests {

/// A state with contacts; ids count from 0 in the order of adding.
struct ForceNetwork {
  core::State state;
  std::vector<core::Contact> contacts;

  core::BallId add(core::Kind kind, const core::Vec3& at, double r, const core::Vec3& v = core::Vec3::Zero()) {
    const auto ball = static_cast<core::BallId>(state.size());
    state.add(ball, kind, at, v, r);
    return ball;
  }
  /// Lets a content ball i and a ball j push each other apart with this force [N] (pull if negative).
  void push(core::BallId i, core::BallId j, double force) {
    const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
    const core::Vec3 away = (state.position[a] - state.position[b]).normalized();
    contacts.push_back({i, j, state.kind[b], 1e-4, 0.0, force * away});
  }
  /// Adds a fixed ball of the same radius that touches ball i and pushes it in this direction.
  core::BallId hold(core::Kind kind, core::BallId i, const core::Vec3& direction, double force) {
    const auto a = static_cast<std::size_t>(i);
    const core::BallId j = add(kind, state.position[a] - 2.0 * state.radius[a] * direction.normalized(), state.radius[a]);
    push(i, j, force);
    return j;
  }
  /// Sum of the contact forces on a ball [N].
  core::Vec3 force_on(core::BallId ball) const {
    core::Vec3 sum = core::Vec3::Zero();
    for (const core::Contact& c : contacts) {
      if (c.i == ball) sum += c.force;
      if (c.j == ball) sum -= c.force;
    }
    return sum;
  }
};

/// Balls at random places of a box, neighbours pushing (one in ten: pulling) with random forces. Nothing is in
/// equilibrium, and no two numbers are equal.
inline ForceNetwork random_network(unsigned seed) {
  constexpr int kContent = 150, kWall = 60;
  constexpr double kRadius = 0.2, kReach = 0.45, kBox = 2.0;  // m
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> place(0.0, kBox), force(-100.0, 900.0), radius(0.8 * kRadius, kRadius);
  ForceNetwork net;
  for (int k = 0; k < kContent + kWall; ++k)
    net.add(k < kContent ? core::Kind::content : core::Kind::wall, {place(engine), place(engine), place(engine)}, radius(engine));
  for (core::BallId i = 0; i < kContent; ++i)
    for (core::BallId j = i + 1; j < kContent + kWall; ++j)
      if ((net.state.position[static_cast<std::size_t>(i)] - net.state.position[static_cast<std::size_t>(j)]).norm() < kReach)
        net.push(i, j, force(engine));
  return net;
}

/// The same turned about the z axis [rad].
inline ForceNetwork turned(ForceNetwork net, double angle) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, core::Vec3::UnitZ()).toRotationMatrix();
  for (core::Vec3& x : net.state.position) x = turn * x;
  for (core::Contact& c : net.contacts) c.force = turn * c.force;
  return net;
}

/// The same with ball k named new_id[k], the contacts in another order. new_id: a permutation that keeps content before
/// the rest, as contacts name content first.
inline ForceNetwork renumbered(const ForceNetwork& net, const std::vector<core::BallId>& new_id) {
  ForceNetwork out;
  std::vector<std::size_t> old(new_id.size());
  for (std::size_t k = 0; k < new_id.size(); ++k) old[static_cast<std::size_t>(new_id[k])] = k;
  for (const std::size_t k : old) out.add(net.state.kind[k], net.state.position[k], net.state.radius[k], net.state.velocity[k]);
  for (core::Contact c : net.contacts) {
    c.i = new_id[static_cast<std::size_t>(c.i)];
    c.j = new_id[static_cast<std::size_t>(c.j)];
    if (c.other == core::Kind::content && c.i > c.j) {
      std::swap(c.i, c.j);
      c.force = -c.force;
    }
    out.contacts.push_back(c);
  }
  std::reverse(out.contacts.begin(), out.contacts.end());
  return out;
}

/// New names for the balls: content reversed within itself, and so the rest.
inline std::vector<core::BallId> reversed_names(const core::State& state) {
  const auto content = static_cast<core::BallId>(state.count(core::Kind::content)), all = static_cast<core::BallId>(state.size());
  std::vector<core::BallId> names;
  for (core::BallId k = 0; k < all; ++k) names.push_back(k < content ? content - 1 - k : all - 1 - (k - content));
  return names;
}

/// Balls by their new names, increasing.
inline std::vector<core::BallId> renamed(std::vector<core::BallId> balls, const std::vector<core::BallId>& new_id) {
  for (core::BallId& ball : balls) ball = new_id[static_cast<std::size_t>(ball)];
  std::sort(balls.begin(), balls.end());
  return balls;
}

/// Names of the groups that links join, found by handing the smallest name on until nothing changes.
inline std::vector<std::size_t> spread_names(std::size_t n, const std::vector<std::pair<std::size_t, std::size_t>>& links) {
  std::vector<std::size_t> name(n);
  for (std::size_t k = 0; k < n; ++k) name[k] = k;
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& [a, b] : links) {
      if (name[a] == name[b]) continue;
      name[a] = name[b] = std::min(name[a], name[b]);
      changed = true;
    }
  }
  return name;
}

/// The groups of at least `least` by their smallest members.
inline std::vector<std::vector<core::BallId>> groups(const std::vector<std::size_t>& name, std::size_t least) {
  std::vector<std::vector<core::BallId>> all(name.size()), out;
  for (std::size_t k = 0; k < name.size(); ++k) all[name[k]].push_back(static_cast<core::BallId>(k));
  for (const auto& group : all)
    if (group.size() >= least) out.push_back(group);
  return out;
}

}  // namespace grainclock::tests
