// What a run needs from any stepper, uniform or multi-rate.
#pragma once

#include "core/kernels.hpp"
#include "core/ledger.hpp"
#include "core/scene.hpp"
#include "core/state.hpp"

#include <memory>
#include <string>
#include <vector>

namespace grainclock::core {

/// An overlap beyond this share of the sum of two radii is a failure of the numerics, or a state that cannot be stepped.
inline constexpr double kLargestOverlap = 0.25;

/// One touching (or cohering) pair at a synchronised time.
struct Contact {
  BallId i, j;        // i is content
  Kind other;         // kind of j
  double overlap;     // m
  double rate;        // m/s, d(overlap)/dt
  Vec3 force;         // N, on i
};

/// What the content does to a fixed ball.
struct FixedForce {
  BallId id;
  Vec3 force;  // N, on the fixed ball
};

/// Work done so far.
struct Costs {
  std::uint64_t contact_evaluations = 0;  // every pair distance computed in force sweeps and classification
  std::uint64_t ball_updates = 0;         // every advance of a ball by a step of its own
  std::uint64_t list_builds = 0;
  std::uint64_t events = 0;               // event corrections applied
  std::uint64_t missed_contacts = 0;      // pairs that touched while skipped
};

/// Counts per level, averaged over the run (before its first step: as classified); level 0 is the finest.
struct LevelStatistics {
  std::vector<double> step;       // s
  std::vector<double> balls;      // mean number of balls stepped at this level
  std::vector<double> contacts;   // mean number of contacts evaluated at this level
  double listed = 0.0;            // pairs in the list now: what a uniform step evaluates
  double renewals = 0.0;          // evaluations of all listed pairs per coarsest step, for classes and after new lists
  int renew_every = 0;            // coarsest steps between regular renewals of classes; 0 without classes
  double common_step = 0.0;       // s, what all balls together could take at the tolerance, by the last classes; may be infinite
  bool ran_out = false;           // even with all balls at level 0 the tolerance was not to be had, at some time
};

/// A content system between synchronised times. All calls see and leave a synchronised state.
class Stepper {
 public:
  virtual ~Stepper() = default;

  /// Advances by n coarsest steps. Throws NumericsError (blow-up, overlap beyond the limit, lost ball).
  virtual void advance(std::int64_t n) = 0;
  /// The coarsest step [s].
  virtual double step() const = 0;
  /// Steps taken since construction (or the tick given to it).
  virtual std::int64_t steps_done() const = 0;
  /// Whether a checkpoint taken now continues bitwise; uniform stepping: always.
  virtual bool is_checkpointable() const = 0;

  /// Every ball that is still there, by id; with the optional restart members filled.
  virtual State state() const = 0;
  virtual std::vector<Contact> contacts() const = 0;
  virtual Energies energies() const = 0;
  /// Kinetic energy [J], as in energies() but for rounding: without a look at contacts, for frequent checks.
  virtual double kinetic_energy() const = 0;
  /// Momentum of the content [kg m/s], likewise.
  virtual Vec3 momentum() const = 0;
  /// Sum of the contact forces on each fixed ball that is there (a plug while the outlet is closed), by id: those of
  /// contacts() but for rounding, without a look at pairs of content.
  virtual std::vector<FixedForce> fixed_forces() const = 0;
  virtual const Ledger& ledger() const = 0;
  virtual Costs costs() const = 0;
  virtual LevelStatistics level_statistics() const = 0;
};

/// What a stepper is made from.
struct StepperSetup {
  Vec3 gravity{0.0, 0.0, -9.81};
  Materials materials;
  Domain domain;
  Stepping stepping;          // step is set
  bool outlet_open = false;   // plug balls are ignored while true
  bool first_impact = false;
  int threads = 1;
  double force_limit = 0.0;   // N, beyond it the numerics failed; 0: from the scene (see force_scale.hpp)
  Ledger ledger;              // totals to continue from
  Costs costs;                // likewise
  std::int64_t steps_done = 0;    // restart: step count since the phase's start
  double skin = 0.0;          // m, floor of the per-ball skin to begin with; 0: the default. Never changes results
  const Kernels* kernels = &core::kernels();  // any of runnable_kernels() gives the same bits; tests break theirs on purpose
};

/// The uniform stepper (core), any integrator. State may hold any kinds of balls.
std::unique_ptr<Stepper> make_uniform_stepper(const State& state, const StepperSetup& setup);

}  // namespace grainclock::core
