#include "benchmarks/branch_changes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::benchmarks {

using core::Approach;
using core::ContactLaw;

namespace {

/// Share of the path's bend by which a Hermite path may be wrong. Steps are shorter than any contact's time scale,
/// where the cubic is right to a few percent.
constexpr double kPathError = 0.1;

bool may_be_clamped(const ContactLaw& law) { return !law.tension && law.c > 0.0; }

/// Lowest value of the exit function strictly inside the step on the cubic Hermite path; infinity if it has no minimum there.
double lowest_inside(const Exit& exit, const Approach& start, const Approach& end, double h) {
  // d(s) = d0 + s p1 + s^2 p2 + s^3 p3 over s in (0, 1), r = d'(s) / h.
  const double rise = end.overlap - start.overlap, r0 = h * start.rate, r1 = h * end.rate;
  const double p1 = r0, p2 = 3.0 * rise - 2.0 * r0 - r1, p3 = r0 + r1 - 2.0 * rise;
  const double a = exit.overlap_weight, b = exit.rate_weight / h;
  const auto value = [&](double s) {
    return a * (start.overlap + s * (p1 + s * (p2 + s * p3))) + b * (p1 + s * (2.0 * p2 + 3.0 * s * p3)) + exit.offset;
  };
  // The function's derivative: q0 + q1 s + q2 s^2.
  const double q0 = a * p1 + 2.0 * b * p2, q1 = 2.0 * a * p2 + 6.0 * b * p3, q2 = 3.0 * a * p3;
  double lowest = std::numeric_limits<double>::infinity();
  const auto look_at = [&](double s) {
    if (s > 0.0 && s < 1.0) lowest = std::min(lowest, value(s));
  };
  const double square = q1 * q1 - 4.0 * q2 * q0;
  if (square < 0.0) return lowest;
  const double q = -0.5 * (q1 + std::copysign(std::sqrt(square), q1));  // both roots without cancellation
  if (q2 != 0.0) look_at(q / q2);
  if (q != 0.0) look_at(q0 / q);
  return lowest;
}

}  // namespace

Branch branch_of(const ContactLaw& law, const Approach& at) {
  if (at.overlap > 0.0) {
    return may_be_clamped(law) && law.k * at.overlap + law.c * at.rate < 0.0 ? Branch::clamped : Branch::pressed;
  }
  if (law.reach <= 0.0 || at.overlap < -law.reach) return Branch::apart;
  return at.rate < 0.0 ? Branch::parting : Branch::nearing;
}

double branch_force(const ContactLaw& law, Branch branch, const Approach& at) {
  switch (branch) {
    case Branch::pressed: return law.k * at.overlap + law.c * at.rate;
    case Branch::parting: return law.k * at.overlap;
    default: return 0.0;
  }
}

double branch_spring(const ContactLaw& law, Branch branch, const Approach& at) {
  const bool pulls_or_pushes = branch == Branch::pressed || branch == Branch::clamped || branch == Branch::parting;
  return pulls_or_pushes ? law.k * at.overlap : 0.0;
}

Exits exits_of(const ContactLaw& law, Branch branch) {
  const bool coheres = law.reach > 0.0;
  const double slope = law.c / law.k;
  const Exit touched{-1.0, 0.0, 0.0, Branch::pressed, ChangeKind::touched};
  const Exit lost{1.0, 0.0, 0.0, coheres ? Branch::parting : Branch::apart, ChangeKind::lost};
  switch (branch) {
    case Branch::apart:
      if (!coheres) return {{touched, {}}, 1};
      return {{{-1.0, 0.0, -law.reach, Branch::nearing, ChangeKind::into_reach}, {}}, 1};
    case Branch::nearing:
      return {{touched, {0.0, 1.0, 0.0, Branch::parting, ChangeKind::parting}}, 2};
    case Branch::parting:
      return {{{0.0, -1.0, 0.0, Branch::nearing, ChangeKind::nearing},
               {1.0, 0.0, law.reach, Branch::apart, ChangeKind::out_of_reach}}, 2};
    case Branch::pressed:
      if (!may_be_clamped(law)) return {{lost, {}}, 1};
      return {{{1.0, slope, 0.0, Branch::clamped, ChangeKind::clamped}, {}}, 1};
    default:
      return {{{-1.0, -slope, 0.0, Branch::pressed, ChangeKind::unclamped}, lost}, 2};
  }
}

double Rounding::of(const Exit& exit) const {
  return std::abs(exit.overlap_weight) * overlap + std::abs(exit.rate_weight) * rate;
}

Passage passage(const Exit& exit, const Approach& start, const Approach& end, double h, double rounding) {
  const double first = exit.value(start), last = exit.value(end);
  if (std::min(first, last) < -rounding) return Passage::through;
  // How far the path may fall below its ends; see lowest_inside.
  const double turn = std::abs((end.overlap - start.overlap) / h - 0.5 * (start.rate + end.rate));
  const double bend = 0.15 * h * (std::abs(start.rate) + std::abs(end.rate)) * std::abs(exit.overlap_weight) +
                      1.5 * turn * std::abs(exit.rate_weight);
  if (std::min(first, last) > 2.0 * bend) return Passage::none;
  return lowest_inside(exit, start, end, h) < kPathError * bend - rounding ? Passage::grazing : Passage::none;
}

}  // namespace grainclock::benchmarks
