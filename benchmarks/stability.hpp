// Where steps stop being stable, measured on the steppers themselves: systems whose contacts are all pressed, so that
// small motions are linear, their matrices, and the growth of small perturbations.
#pragma once

#include "benchmarks/amplification.hpp"
#include "core/state.hpp"

#include <string_view>
#include <vector>

namespace grainclock::benchmarks {

enum class SystemKind { pair, wall, chain, packing };
std::string_view name(SystemKind kind);

/// Balls in equilibrium, every contact of interest pressed; dashpots may pull (tension), nothing clamps.
struct PressedSystem {
  core::State state;
  core::Materials materials;
  core::Vec3 gravity = core::Vec3::Zero();  // m/s2
  int axes = 1;                             // along which balls move: x alone, or all three
};

// Every contact has the damping ratio c / (2 sqrt(k m_eff)) asked for, m_eff that of mean balls. Modes of several contacts
// have others: the largest of a chain of equal balls is sqrt(2) times damped as much.

/// Two unequal balls between two walls a thousand times softer.
PressedSystem pressed_pair(double damping_ratio);
/// A ball that its weight presses on a wall ball.
PressedSystem pressed_wall(double damping_ratio);
/// 12 balls of Table 1's radii in a row between two wall balls, all contacts equally stiff.
PressedSystem pressed_chain(double damping_ratio);
/// A settled packing with Table 1's stiffnesses.
PressedSystem pressed_packing(double damping_ratio, core::State settled);

/// A small silo (32 balls), filled and settled.
core::State small_packing();
/// Lets a packing come to rest under its weight, plug closed: kinetic energy per ball below 1e-16 m g r.
/// Throws NumericsError where it does not within a fixed time, naming `source`.
core::State settled(core::State state, std::string_view source);

/// Springs and dashpots of all touching contacts, along the system's axes; balls in order of id. The turning of pressed
/// contacts is left out: it is smaller by the overlap over the diameter, 1e-3 at most here.
LinearSystem linearised(const PressedSystem& system);

/// How a small perturbation of all modes goes on; in the beginning the highest one has most of the energy.
struct Growth {
  double total = 0.0;     // size at the end over size at the beginning
  double per_step = 0.0;  // mean over the last half of the run
};
/// A run ends early when the perturbation has grown this much; it begins small enough to keep contacts pressed.
constexpr double kGrown = 1e4;
/// The difference of two runs of at most `steps` uniform steps, in sqrt(kinetic + elastic energy).
Growth measured_growth(const PressedSystem& system, core::Integrator integrator, double step, int steps);

/// The largest step [s] at which the perturbation does not grow by kGrown within `steps`, by bisection to 0.2 %. Beyond
/// the limit by a part e it grows by 1 + 1.3 e or more per step: 2000 steps find the limit up to 0.6 % too high.
double measured_limit(const PressedSystem& system, core::Integrator integrator, int steps);

/// A chain of 12 equal balls between walls, for selective steps: balls 1 to 3 and 10 to 12 are pinned from above and below
/// by wall balls so stiff that they need steps of exactly `step` / `ratio`, which changes nothing along the chain.
/// `step_ratio`: coarse step over the undamped limit sqrt(m / k) of the balls in the middle.
struct LevelledChain {
  PressedSystem system;
  int ratio = 1;      // a power of two
  double step = 0.0;  // s, the coarse one
};
LevelledChain levelled_chain(int ratio, double step_ratio, double damping_ratio);
/// Rates of growth below this many sqrt(k / m) are rounding.
constexpr double kRateResolution = 1e-7;
/// Growth [1/s] of the fastest growing motion along the chain under selective steps (accumulate), from the matrix of
/// one interval between renewals of classes, itself measured motion by motion.
/// Throws NumericsError if the levels are not as wanted.
double multirate_growth_rate(const LevelledChain& chain);

}  // namespace grainclock::benchmarks
