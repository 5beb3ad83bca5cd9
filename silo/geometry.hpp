// The silo's shape as data, and the fixed balls that make its wall and plug.
//
// A cylinder (round) or shaft (square) above a hopper; outlet plane at z = 0,
// axis x = y = 0. Every horizontal section is a circle or a square, described by
// its half width (radius or apothem), so that one meridian, a line of half
// width against height, describes both shapes.
#pragma once

#include "core/scene.hpp"
#include "core/toml_keys.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace grainclock::silo {

using core::Vec3;

enum class Section { round, square };
/// What lies on the nominal surface: the centres of the wall balls, or their innermost points.
enum class Surface { centres, inner };

/// The keys of a [silo] table; the defaults are the paper's silo read as round.
struct SiloShape {
  Section section = Section::round;    // key shape
  double half_width = 5.0;             // m, key radius, or half of key width (default 8 m)
  double height = 20.0;                // m, of the cylinder or shaft
  double hopper_height = 5.0;          // m, 0: flat bottom
  double half_outlet = 1.0;            // m, half of key outlet (diameter or width)
  std::int64_t balls = 22741;          // of content
  double r_min = 0.215, r_max = 0.225; // m, radii of all balls, uniform between
  Surface surface = Surface::centres;
  double coverage = 0.98;              // circumscribed squares of the wall balls over the area their centres lie on
  double collar = 0.0;                 // m, extra cylinder above the rim while filling
  std::string where = "[silo]";        // file, line and table, for messages

  double mean_radius() const { return 0.5 * (r_min + r_max); }
  double rim() const { return hopper_height + height; }  // m, height of the wall's upper edge
};

/// Reads and checks a [silo] table. Throws InputError with file, line, value and remedy.
SiloShape parse_silo(core::TomlKeys keys);
/// The same from a scene. Throws InputError if it has no [silo].
SiloShape read_silo(const core::Scene& scene);

/// A point of the meridian.
struct MeridianPoint {
  double half_width;  // m
  double z;           // m
};

/// Two straight lines: from the outlet's edge up the hopper, then up the cylinder to the rim.
struct Meridian {
  MeridianPoint outlet, joint, rim;

  double length() const;                       // m
  MeridianPoint at(double along) const;        // `along` from the outlet's edge [m]; beyond the rim it goes straight up
  MeridianPoint outward_normal(double along) const;
};

/// The nominal surface moved outward (inward if negative) by `outward` [m]; the outlet's half width grows by as much.
Meridian meridian(const SiloShape& shape, double outward = 0.0);
/// Surface of the innermost points of mean wall balls, which bounds the content.
Meridian inside_of(const SiloShape& shape);
/// Area of the surface over a meridian [m2].
double area(Section section, const Meridian& line);
/// Volume inside the surface over a meridian between two heights [m3].
double volume_between(Section section, const Meridian& line, double z0, double z1);
/// Distance from a point to the surface [m], positive inside, as if cylinder and hopper went on without end.
double depth_inside(Section section, const Meridian& line, const Vec3& point);

struct FixedBall {
  Vec3 at;        // m
  double radius;  // m
};

/// How the wall compares with the paper's: 3,821 balls, their circumscribed squares 2 % less than the wall's area.
struct WallReport {
  std::int64_t balls = 0;
  double nominal_area = 0.0;  // m2
  double squares = 0.0;       // m2, sum of (2 r)^2
  double share() const { return squares / nominal_area; }
};
inline constexpr std::int64_t kPaperWallBalls = 3821;
inline constexpr double kPaperShare = 0.98;
/// One line of text: the report beside the paper's figures.
std::string describe(const WallReport& report);

struct Walls {
  std::vector<FixedBall> wall;    // ring by ring from the outlet's edge to the rim
  std::vector<FixedBall> plug;    // closes the outlet inside the lowest ring
  std::vector<FixedBall> collar;  // only while filling
  WallReport report;              // of `wall`
};

/// Rings of slightly overlapping balls with random radii; no hole lets the smallest ball through.
/// Throws InputError if the coverage leaves such holes.
Walls build_walls(const SiloShape& shape, std::uint64_t seed);

}  // namespace grainclock::silo
