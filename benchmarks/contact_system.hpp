// The equations of motion as SUNDIALS sees them.
#pragma once

#include "benchmarks/watched_pairs.hpp"

#include <nvector/nvector_serial.h>

#include <exception>
#include <optional>
#include <string>

namespace grainclock::benchmarks {

/// Unknowns: displacements u [m], then velocities v [m/s] of the content in order of id, with x = x0 + u.
/// Relative tolerances then mean displacements, not distances from an arbitrary origin.
class ContactSystem {
 public:
  ContactSystem(const core::State& start, const core::Materials& materials, const core::Vec3& gravity, bool outlet_open,
                int threads);
  /// From now on pairs keep their branches; `ahead` and `tolerance`: see WatchedPairs.
  void watch(const core::State& start, const core::Materials& materials, bool outlet_open, double ahead,
             const Rounding& tolerance);

  double mean_diameter() const { return mean_diameter_; }  // m, of the content
  std::size_t unknowns() const { return 2 * origin_.size(); }
  /// The start's unknowns; and a state's content from unknowns.
  void write_start(N_Vector y) const;
  void read_into(core::State& state, N_Vector y) const;

  /// Slope of the unknowns, as SUNDIALS wants it: 0, or 1 if a shorter step may help. `moves`: whether the part includes
  /// du/dt = v.
  int slope(core::Part part, bool moves, N_Vector y, N_Vector out);
  /// The part's Jacobian times `direction` by a difference quotient from slope(y), `at_y`; `scratch` is overwritten.
  int jacobian_times(core::Part part, bool moves, N_Vector direction, N_Vector out, N_Vector y, N_Vector at_y,
                     N_Vector scratch);

  /// Where the balls are.
  const Motion& motion_at(N_Vector y);
  std::optional<WatchedPairs>& watched() { return watched_; }
  std::uint64_t contact_evaluations() const;
  /// Throws what a call from C code could not let through.
  void rethrow() const;
  /// Why the last slope() wanted a shorter step; empty if it did not.
  const std::string& complaint() const { return complaint_; }

 private:
  core::ForceField field_;
  std::optional<WatchedPairs> watched_;
  std::vector<std::size_t> rows_;       // of the content in the state
  std::vector<double> origin_;          // m, x0
  std::vector<double> start_velocity_;  // m/s
  Motion motion_;                       // scratch; the fixed balls in it stay
  double mean_diameter_;                // m
  double length_, speed_;               // m, m/s: steps of difference quotients
  std::exception_ptr failure_;
  std::string complaint_;
};

}  // namespace grainclock::benchmarks
