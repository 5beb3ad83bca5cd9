#include "core/state.hpp"

#include "core/check.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>

namespace grainclock::core {

std::string_view name(Kind kind) {
  switch (kind) {
    case Kind::content: return "content";
    case Kind::wall: return "wall";
    case Kind::plug: return "plug";
  }
  return "?";
}

std::size_t State::count(Kind wanted) const {
  return static_cast<std::size_t>(std::count(kind.begin(), kind.end(), wanted));
}

void State::add(BallId ball, Kind its_kind, const Vec3& at, const Vec3& v, double r) {
  id.push_back(ball);
  kind.push_back(its_kind);
  position.push_back(at);
  velocity.push_back(v);
  radius.push_back(r);
}

namespace {

template <class Vector>
void require_length(const Vector& values, std::size_t wanted, bool optional, std::string_view what, std::string_view source) {
  GC_REQUIRE(values.size() == wanted || (optional && values.empty()),
             "{}: {} values of {} for {} balls: give one per ball", source, values.size(), what, wanted);
}

void require_bounded(const Vec3& value, std::string_view what, std::string_view unit, BallId ball, std::string_view source) {
  GC_REQUIRE(value.allFinite(), "{}: ball {} has {} ({}, {}, {}) {}: must be finite", source, ball, what, value[0], value[1], value[2],
             unit);
  GC_REQUIRE(value.cwiseAbs().maxCoeff() <= kLargestSize, "{}: ball {} has {} ({}, {}, {}) {}: must be at most {:g} {} in size; is it in SI units?",
             source, ball, what, value[0], value[1], value[2], unit, kLargestSize, unit);
}

}  // namespace

void require_room(double balls, std::string_view where) {
  constexpr double kBytesPerBall = 500.0;  // of uniform steps, benchmarks/scale/run.sh
  constexpr double kGib = 1024.0 * 1024.0 * 1024.0;
  const double wanted = balls * kBytesPerBall / kGib;
  const double there = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGE_SIZE)) / kGib;
  GC_REQUIRE(wanted <= there, "{}: {:.3g} balls would take {:.3g} GiB of memory, and this machine has {:.3g}; take fewer balls", where,
             balls, wanted, there);
}

void validate(const State& state, std::string_view source) {
  const std::size_t n = state.size();
  require_length(state.kind, n, false, "kind", source);
  require_length(state.position, n, false, "position", source);
  require_length(state.velocity, n, false, "velocity", source);
  require_length(state.radius, n, false, "radius", source);
  require_length(state.evaluated_position, n, true, "evaluated_position", source);
  require_length(state.evaluated_velocity, n, true, "evaluated_velocity", source);
  require_length(state.level, n, true, "level", source);
  require_length(state.impacted, n, true, "impacted", source);
  const std::size_t remembered = state.dashpot_force.size();
  GC_REQUIRE(state.dashpot_i.size() == remembered && state.dashpot_j.size() == remembered,
             "{}: {} and {} balls for {} values of dashpot_force: give one of each per pair", source, state.dashpot_i.size(),
             state.dashpot_j.size(), remembered);
  GC_REQUIRE(std::abs(state.time) <= kLargestTime, "{}: time is {} s: must be finite, and at most {:g} s", source, state.time,
             kLargestTime);
  GC_REQUIRE(state.length_scale >= 0.0 && state.length_scale <= kLargestSize, "{}: length_scale is {} m: must be from 0 to {:g} m",
             source, state.length_scale, kLargestSize);

  for (std::size_t i = 0; i < n; ++i) {
    const BallId ball = state.id[i];
    const Vec3& x = state.position[i];
    const Vec3& v = state.velocity[i];
    GC_REQUIRE(i == 0 || state.id[i - 1] != ball, "{}: ball {} appears twice: give each ball an id of its own", source, ball);
    GC_REQUIRE(i == 0 || state.id[i - 1] < ball, "{}: ball {} follows ball {}: sort the balls by id", source, ball,
               state.id[i - 1]);
    GC_REQUIRE(state.kind[i] <= Kind::plug, "{}: ball {} has kind number {}: use 0 content, 1 wall or 2 plug", source, ball,
               static_cast<int>(state.kind[i]));
    GC_REQUIRE(ball >= 0 && ball <= kLargestId, "{}: ball {}: ids must be from 0 to {}", source, ball, kLargestId);
    require_bounded(x, "position", "m", ball, source);
    require_bounded(v, "velocity", "m/s", ball, source);
    GC_REQUIRE(std::isfinite(state.radius[i]) && state.radius[i] > 0.0, "{}: ball {} has radius {} m: must be above 0", source,
               ball, state.radius[i]);
    GC_REQUIRE(state.radius[i] >= kSmallestRadius && state.radius[i] <= kLargestSize,
               "{}: ball {} has radius {} m: must be from {:g} to {:g} m; is it in SI units?", source, ball, state.radius[i],
               kSmallestRadius, kLargestSize);
    GC_REQUIRE(state.kind[i] == Kind::content || v.isZero(0.0),
               "{}: {} ball {} has velocity ({}, {}, {}) m/s: fixed balls must be at rest", source, name(state.kind[i]), ball,
               v[0], v[1], v[2]);
    if (!state.evaluated_position.empty()) require_bounded(state.evaluated_position[i], "evaluated_position", "m", ball, source);
    if (!state.evaluated_velocity.empty()) require_bounded(state.evaluated_velocity[i], "evaluated_velocity", "m/s", ball, source);
  }
  for (std::size_t k = 0; k < remembered; ++k) {
    const BallId i = state.dashpot_i[k], j = state.dashpot_j[k];
    GC_REQUIRE(std::isfinite(state.dashpot_force[k]), "{}: dashpot_force of balls {} and {} is {}: must be finite", source, i, j,
               state.dashpot_force[k]);
  }
}

}  // namespace grainclock::core
