// Event-corrected quadrature: what a step's end points misjudge when a contact changes branch within it.
//
// The trapezoid rule sees the force at both ends of a step only. Where a contact opens, closes, is
// clamped, or opens and closes in between, the law is integrated along the cubic
// Hermite path of the overlap, split at the branch changes; the pieces are polynomials of degree
// four at most, so Gauss points integrate them exactly.
#pragma once

#include "core/balls.hpp"
#include "core/contact_law.hpp"
#include "core/force_scale.hpp"

#include <span>

namespace grainclock::core {

/// Overlap [m] and rate [m/s] of a pair at one time.
struct Approach {
  double overlap, rate;
};

/// What a step's quadrature misses, per pair; along the normal, positive pushing apart.
struct EventCorrection {
  bool is_event = false;      // the law changed branch within the step
  double impulse = 0.0;       // N s, beyond h (F0 + F1) / 2
  double displacement = 0.0;  // N s2, beyond h2 F0 / 2: the displacement integral
  double dissipated = 0.0;    // J, beyond h (P0 + P1) / 2
};

/// Integrates the law over one step of length `h` [s] between the two end points.
EventCorrection event_correction(const ContactLaw& law, const Approach& start, const Approach& end, double h);

/// Corrections of one evaluation, in integer units, ready to be added in any order.
class EventBook {
 public:
  /// `half_tick` [s]: impulses are counted in force units times half ticks.
  EventBook(const ForceScale& scale, double half_tick);

  struct Entry {
    std::uint32_t i, j;             // rows
    std::int64_t impulse[3];        // force units * half ticks, on i
    std::int64_t displacement[3];   // force units * half ticks squared, on i
    std::int64_t damping[3];        // force units, on i, at the end of the step: what of the force is not the spring's
    std::int64_t dissipated;        // total units * half ticks
    std::int64_t magnitude;         // total units * half ticks
    bool both;                      // j is content
  };

  void clear() { entries_.clear(); }
  /// Examines candidate pairs `which` of `pairs` at the end of their steps. `step_of(pair)` is the pair's step [s], 0 to
  /// pass it over; `acceleration(row)` is that of the row's present path [m/s2].
  template <class StepOf, class Acceleration>
  void examine(std::span<const BallRow> rows, PairSpan pairs, std::span<const std::uint32_t> which, const SweepLaw& law,
               StepOf step_of, Acceleration acceleration) {
    for (const std::uint32_t p : which) {
      const double h = step_of(p);
      if (h <= 0.0) continue;
      const std::uint32_t i = pairs.i[p], j = pairs.j[p];
      examine_pair(rows[i], rows[j], i, j, acceleration(i), law.both ? acceleration(j) : Vec3(0.0, 0.0, 0.0), law, h);
    }
  }
  const std::vector<Entry>& entries() const { return entries_; }
  /// Takes over the entries of another book of the same units.
  void take(EventBook& other) {
    entries_.insert(entries_.end(), other.entries_.begin(), other.entries_.end());
    other.clear();
  }

  double impulse_unit() const { return scale_.unit * half_tick_; }                    // N s
  double displacement_unit() const { return scale_.unit * half_tick_ * half_tick_; }  // N s2
  double energy_unit() const { return scale_.total * half_tick_; }                    // J

 private:
  void examine_pair(const BallRow& a, const BallRow& b, std::uint32_t i, std::uint32_t j, const Vec3& a_i,
                    const Vec3& a_j, const SweepLaw& law, double h);

  ForceScale scale_;
  double half_tick_;
  std::vector<Entry> entries_;
};

/// Sums of position corrections and damping forces per ball, in order of row; units as in EventBook::Entry.
struct Shift {
  std::uint32_t row;
  std::int64_t displacement[3];
  std::int64_t damping[3];
};
/// Adds up the entries of each ball.
std::vector<Shift> shifts(const std::vector<EventBook::Entry>& entries);

}  // namespace grainclock::core
