#include "silo/arches.hpp"

#include "core/check.hpp"
#include "silo/contact_graph.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace grainclock::silo {
namespace {

using core::BallId;
using core::Kind;
using core::State;

constexpr double kRounding = 1e-9;  // of unit vectors: what counts as upright, or as one plane

Eigen::Vector2d level(const Vec3& v) { return v.head<2>(); }
double cross(const Vec3& a, const Vec3& b) { return a[0] * b[1] - a[1] * b[0]; }

// ------------------------------------------------------------ supports

/// One contact upright over or under the centre; only from below can it push up, as Best asks for.
bool holds(const Vec3& a) { return level(a).norm() <= kRounding; }

/// Two contacts opposite each other, the line between them below the centre.
bool holds(const Vec3& a, const Vec3& b) {
  const double la = level(a).norm(), lb = level(b).norm();
  if (la <= kRounding || lb <= kRounding || level(a).dot(level(b)) >= 0.0) return false;
  return std::abs(cross(a, b)) <= kRounding && lb * a[2] + la * b[2] < -kRounding;
}

/// The weights with which the horizontal parts of three directions cancel have one sign, and with them the heights add up
/// to less than 0.
bool holds(const Vec3& a, const Vec3& b, const Vec3& c) {
  Vec3 weight(cross(b, c), cross(c, a), cross(a, b));
  if (weight.sum() < 0.0) weight = -weight;
  return weight.minCoeff() > kRounding && weight.dot(Vec3(a[2], b[2], c[2])) < -kRounding;
}

/// Keeps the best set of supports of one ball.
class Best {
 public:
  Best(const State& state, Choice choice) : state_(state), choice_(choice) {}

  void offer(std::initializer_list<const Touch*> set) {
    double upward = 0.0, height = 0.0;
    for (const Touch* touch : set) {
      upward -= touch->push * touch->towards[2];
      height += state_.position[touch->other][2] / static_cast<double>(set.size());
    }
    const double merit = choice_ == Choice::strongest ? upward : -height;
    if (upward <= 0.0 || (support.n > 0 && merit <= merit_)) return;
    merit_ = merit;
    support = {{}, 0, upward};
    for (const Touch* touch : set) support.by[static_cast<std::size_t>(support.n++)] = state_.id[touch->other];
  }

  Support support;

 private:
  const State& state_;
  Choice choice_;
  double merit_ = 0.0;
};

Support support_of(const State& state, std::span<const Touch> touches, Choice choice) {
  std::vector<const Touch*> push;
  for (const Touch& touch : touches)
    if (touch.push > 0.0) push.push_back(&touch);
  Best best(state, choice);
  for (std::size_t a = 0; a < push.size(); ++a) {
    if (holds(push[a]->towards)) best.offer({push[a]});
    for (std::size_t b = a + 1; b < push.size(); ++b) {
      if (holds(push[a]->towards, push[b]->towards)) best.offer({push[a], push[b]});
      for (std::size_t c = b + 1; c < push.size(); ++c)
        if (holds(push[a]->towards, push[b]->towards, push[c]->towards)) best.offer({push[a], push[b], push[c]});
    }
  }
  return best.support;
}

// ------------------------------------------------------------- bridges

/// Pairs of places of balls that support each other.
Links mutual_bonds(const State& state, const std::vector<Support>& support) {
  Links bonds;
  for (std::size_t ball = 0; ball < support.size(); ++ball)
    for (const BallId by : support[ball].balls()) {
      const std::size_t other = place_of(state, by);
      if (ball < other && support[other].includes(state.id[ball])) bonds.emplace_back(ball, other);
    }
  return bonds;
}

std::vector<Vec3> centres(const State& state, const std::vector<std::size_t>& places) {
  std::vector<Vec3> out;
  for (const std::size_t place : places) out.push_back(state.position[place]);
  return out;
}

Vec3 mean_of(const std::vector<Vec3>& points) {
  return std::accumulate(points.begin(), points.end(), Vec3(Vec3::Zero())) / static_cast<double>(points.size());
}

/// Fills gyration and shape.
void add_shape(Bridge& bridge, const std::vector<Vec3>& points, double mean_radius) {
  const Vec3 centre = mean_of(points);
  Eigen::Matrix3d gyration = Eigen::Matrix3d::Zero();
  for (const Vec3& point : points)
    gyration += (point - centre) * (point - centre).transpose() / static_cast<double>(points.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solved(gyration);
  bridge.gyration = solved.eigenvalues().cwiseMax(0.0);  // rounding can leave -1e-17
  constexpr double kFlat = 0.5;                          // mean radii
  const double flat = kFlat * kFlat * mean_radius * mean_radius;
  const bool is_straight = bridge.gyration[1] <= flat;  // then its plane is not determined, and a steep one will do
  const bool is_steep = std::abs(solved.eigenvectors()(2, 0)) <= std::numbers::sqrt2 / 2.0;
  bridge.shape = is_straight || (bridge.gyration[0] <= flat && is_steep) ? Shape::arch : Shape::dome;
}

/// Fills bases and on_wall.
void add_bases(Bridge& bridge, const State& state, const std::vector<Support>& support, const std::vector<std::size_t>& places) {
  for (const std::size_t place : places)
    for (const BallId by : support[place].balls())
      if (!std::binary_search(bridge.members.begin(), bridge.members.end(), by)) bridge.bases.push_back(by);
  std::sort(bridge.bases.begin(), bridge.bases.end());
  bridge.bases.erase(std::unique(bridge.bases.begin(), bridge.bases.end()), bridge.bases.end());
  bridge.on_wall = std::any_of(bridge.bases.begin(), bridge.bases.end(),
                               [&state](BallId base) { return state.kind[place_of(state, base)] == Kind::wall; });
}

Bridge bridge_of(const State& state, const std::vector<Support>& support, const std::vector<std::size_t>& places,
                 const std::vector<int>& bonds_of) {
  Bridge bridge;
  int most = 0;  // bonds of a member
  double radius = 0.0;
  for (const std::size_t place : places) {
    bridge.members.push_back(state.id[place]);
    most = std::max(most, bonds_of[place]);
    for (const BallId by : support[place].balls())
      if (state.id[place] < by && support[place_of(state, by)].includes(state.id[place])) bridge.bonds.emplace_back(state.id[place], by);
    radius += state.radius[place] / static_cast<double>(places.size());
  }
  std::sort(bridge.bonds.begin(), bridge.bonds.end());
  const bool is_open = bridge.bonds.size() < places.size();
  bridge.topology = most > 2 ? Topology::complex : is_open ? Topology::string : Topology::ring;
  add_bases(bridge, state, support, places);

  std::vector<Vec3> points = centres(state, places);
  const auto is_lower = [](const Vec3& a, const Vec3& b) { return a[2] < b[2]; };
  const auto [lowest, highest] = std::minmax_element(points.begin(), points.end(), is_lower);
  bridge.height = (*highest)[2] - (*lowest)[2];
  add_shape(bridge, points, radius);
  for (Vec3& point : points) point[2] = 0.0;
  bridge.span = widest(points);
  return bridge;
}

// -------------------------------------------------------------- speeds

/// Content by height.
std::vector<std::size_t> content_upward(const State& state) {
  std::vector<std::size_t> places;
  for (std::size_t ball = 0; ball < state.size(); ++ball)
    if (state.kind[ball] == Kind::content) places.push_back(ball);
  const auto is_lower = [&state](std::size_t a, std::size_t b) { return state.position[a][2] < state.position[b][2]; };
  std::sort(places.begin(), places.end(), is_lower);
  return places;
}

/// How much higher a ball is than the horizontally nearest member [m]; 0 if their shadows do not overlap.
double height_over(const State& state, const std::vector<std::size_t>& members, const std::vector<Vec3>& where,
                   std::size_t ball) {
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < where.size(); ++k) {
    const double square = level(where[k] - state.position[ball]).squaredNorm();
    if (square < least) least = square, nearest = k;
  }
  const bool overlaps = std::sqrt(least) < state.radius[ball] + state.radius[members[nearest]];
  return overlaps ? state.position[ball][2] - where[nearest][2] : 0.0;
}

/// A vertical cylinder that holds every shadow that can overlap.
struct Column {
  Eigen::Vector2d axis;       // m
  double radius, low, high;   // m
};

Column column_around(const std::vector<Vec3>& where, double widest_ball, double reach) {
  Column column{level(mean_of(where)), 0.0, where.front()[2], where.front()[2]};
  for (const Vec3& at : where) {
    column.radius = std::max(column.radius, (level(at) - column.axis).norm());
    column.low = std::min(column.low, at[2]);
    column.high = std::max(column.high, at[2]);
  }
  return {column.axis, column.radius + 2.0 * widest_ball, column.low - reach, column.high + reach};
}

}  // namespace

bool Support::includes(BallId ball) const {
  return std::find(by.begin(), by.begin() + n, ball) != by.begin() + n;
}

std::vector<Support> supports(const State& state, const std::vector<core::Contact>& contacts, Choice choice) {
  const ContactGraph graph(state, contacts);
  std::vector<Support> out(state.size());
  for (std::size_t ball = 0; ball < state.size(); ++ball)
    if (state.kind[ball] == Kind::content) out[ball] = support_of(state, graph.of(ball), choice);
  return out;
}

std::vector<Bridge> bridges(const State& state, const std::vector<Support>& support) {
  GC_REQUIRE(support.size() == state.size(), "{} supports for {} balls: pass what supports() gave for this state", support.size(),
             state.size());
  const Links bonds = mutual_bonds(state, support);
  std::vector<int> bonds_of(state.size(), 0);
  for (const auto& [a, b] : bonds) ++bonds_of[a], ++bonds_of[b];
  std::vector<Bridge> out;
  for (const auto& places : connected_sets(state.size(), bonds)) out.push_back(bridge_of(state, support, places, bonds_of));
  return out;
}

std::vector<std::int64_t> count_by_size(const std::vector<Bridge>& all) {
  std::vector<std::int64_t> counts;
  for (const Bridge& bridge : all) {
    counts.resize(std::max(counts.size(), bridge.members.size() + 1), 0);
    ++counts[bridge.members.size()];
  }
  return counts;
}

std::vector<Sides> speeds_beside(const State& state, const std::vector<Bridge>& all, double reach, double turn) {
  const std::vector<std::size_t> upward = content_upward(state);
  const double widest_ball = state.size() == 0 ? 0.0 : *std::max_element(state.radius.begin(), state.radius.end());
  const Eigen::AngleAxisd rotation(turn, Vec3::UnitZ());
  std::vector<Sides> out;
  for (const Bridge& bridge : all) {
    Sides sides;
    std::vector<std::size_t> members;
    std::vector<Vec3> where;
    for (const BallId ball : bridge.members) {
      members.push_back(place_of(state, ball));
      where.push_back(turn == 0.0 ? state.position[members.back()] : rotation * state.position[members.back()]);
      sides.speed_within += state.velocity[members.back()].norm() / static_cast<double>(bridge.members.size());
    }
    const Column column = column_around(where, widest_ball, reach);
    const auto first = std::lower_bound(upward.begin(), upward.end(), column.low,
                                        [&state](std::size_t ball, double z) { return state.position[ball][2] < z; });
    for (auto at = first; at != upward.end() && state.position[*at][2] <= column.high; ++at) {
      if ((level(state.position[*at]) - column.axis).norm() > column.radius) continue;
      const double over = height_over(state, members, where, *at);
      if (std::abs(over) <= state.radius[*at] || std::abs(over) > reach) continue;
      ++(over > 0.0 ? sides.above : sides.below);
      (over > 0.0 ? sides.speed_above : sides.speed_below) += state.velocity[*at].norm();
    }
    if (sides.above > 0) sides.speed_above /= static_cast<double>(sides.above);
    if (sides.below > 0) sides.speed_below /= static_cast<double>(sides.below);
    out.push_back(sides);
  }
  return out;
}

}  // namespace grainclock::silo
