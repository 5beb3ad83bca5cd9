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

/// The cubic Hermite path of the overlap between the two ends of a step of h [s]: d0 + s p1 + s^2 p2 + s^3 p3, s in (0, 1).
struct Path {
  double d0, p1, p2, p3;  // m
  double h;               // s
  double turn;            // m/s, by how much the mean rate differs from the mean of the rates at the ends

  /// Rounding of overlaps must not look like a turn, which it would in very short steps.
  Path(const Approach& start, const Approach& end, double step, const Rounding& rounding)
      : d0(start.overlap), p1(step * start.rate), h(step) {
    const double mean = 0.5 * (start.rate + end.rate), raw = (end.overlap - start.overlap) / step - mean;
    turn = std::copysign(std::max(0.0, std::abs(raw) - 2.0 * rounding.overlap / step - rounding.rate), raw);
    const double rise = step * (mean + turn), r1 = step * end.rate;
    p2 = 3.0 * rise - 2.0 * p1 - r1;
    p3 = p1 + r1 - 2.0 * rise;
  }

  /// Lowest value of the exit function strictly inside the step; infinity if it has no minimum there.
  double lowest(const Exit& exit) const {
    const double a = exit.overlap_weight, b = exit.rate_weight / h;
    double out = std::numeric_limits<double>::infinity();
    const auto look_at = [&](double s) {
      if (!(s > 0.0 && s < 1.0)) return;
      const double d = d0 + s * (p1 + s * (p2 + s * p3)), slope = p1 + s * (2.0 * p2 + 3.0 * s * p3);
      out = std::min(out, a * d + b * slope + exit.offset);
    };
    // Where the function's derivative q0 + q1 s + q2 s^2 is zero; both roots without cancellation.
    const double q0 = a * p1 + 2.0 * b * p2, q1 = 2.0 * a * p2 + 6.0 * b * p3, q2 = 3.0 * a * p3;
    const double square = q1 * q1 - 4.0 * q2 * q0;
    if (square < 0.0) return out;
    const double q = -0.5 * (q1 + std::copysign(std::sqrt(square), q1));
    if (q2 != 0.0) look_at(q / q2);
    if (q != 0.0) look_at(q0 / q);
    return out;
  }
};

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
    case Branch::pressed:
      return law.k * at.overlap + law.c * at.rate;
    case Branch::parting:
      return law.k * at.overlap;
    default:
      return 0.0;
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
               {1.0, 0.0, law.reach, Branch::apart, ChangeKind::out_of_reach}},
              2};
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

Passage passage(const Exit& exit, const Approach& start, const Approach& end, double h, const Rounding& rounding) {
  const double nearest = std::min(exit.value(start), exit.value(end)), unit = rounding.of(exit);
  if (nearest < -unit) return Passage::through;
  // How far the path may fall below its ends.
  const Path path(start, end, h, rounding);
  const double bend = 0.15 * h * (std::abs(start.rate) + std::abs(end.rate)) * std::abs(exit.overlap_weight) +
                      1.5 * std::abs(path.turn * exit.rate_weight);
  if (bend <= unit || nearest > 2.0 * bend) return Passage::none;
  return path.lowest(exit) < kPathError * bend - unit ? Passage::grazing : Passage::none;
}

}  // namespace grainclock::benchmarks
