// What files, builders and steppers exchange: the balls of a scene at one time.
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <string_view>
#include <vector>

namespace grainclock::core {

using Vec3 = Eigen::Vector3d;
using BallId = std::int64_t;

/// Content moves; wall and plug balls never do. The plug is there while the outlet is closed.
enum class Kind : std::uint8_t { content = 0, wall = 1, plug = 2 };
std::string_view name(Kind kind);

/// Balls in increasing order of id, every kind together; SI units.
/// All vectors have the same length, except the optional ones, which may be empty, and the remembered pairs.
struct State {
  double time = 0.0;                 // s
  double length_scale = 0.0;         // m, mean diameter of the content when the run began; 0: not known
  std::vector<BallId> id;            // unique, increasing
  std::vector<Kind> kind;
  std::vector<Vec3> position;        // m
  std::vector<Vec3> velocity;        // m/s, zero for fixed balls
  std::vector<double> radius;        // m

  // Optional, for a bitwise restart: where the last forces were evaluated
  // (predicted velocities differ from corrected ones), the ball's level, and
  // whether it has had its first impact.
  std::vector<Vec3> evaluated_position;  // m
  std::vector<Vec3> evaluated_velocity;  // m/s
  std::vector<std::uint8_t> level;
  std::vector<std::uint8_t> impacted;
  // Pairs of balls whose dashpots remember their last force (stepping.dashpot other than explicit).
  std::vector<BallId> dashpot_i, dashpot_j;  // i is content
  std::vector<double> dashpot_force;         // N

  std::size_t size() const { return id.size(); }
  std::size_t count(Kind wanted) const;
  void add(BallId ball, Kind its_kind, const Vec3& at, const Vec3& v, double r);
};

// What a state may hold: far beyond any silo in SI units, and near enough that everything computed of it stays finite.
inline constexpr BallId kLargestId = (BallId{1} << 53) - 1;  // doubles hold it, and it can be counted from 1 too
inline constexpr double kLargestSize = 1e9;                  // m, of coordinates and radii; m/s, of velocities
inline constexpr double kSmallestRadius = 1e-9;              // m
inline constexpr double kLargestTime = 1e15;                 // s

/// Throws InputError, beginning with `where`, unless a run with so many balls can have a place in this machine's memory.
void require_room(double balls, std::string_view where);

/// Throws InputError (naming `source` and the ball) unless ids are unique and
/// increasing, numbers finite and within the bounds above, radii positive, and fixed balls at rest.
void validate(const State& state, std::string_view source);

}  // namespace grainclock::core
