// What happens where balls of different steps touch: the interface strategies, side by side.
//
// The stepper evaluates every contact at its own level, in turn with its level's ticks, and adds up each ball's force units
// F and impulses 2^level F. A strategy says how balls move meanwhile and what they make of the sums. Each strategy is a
// file of its own, whose head states its linear and angular momentum, energy, order and stability; interface.cpp lists them.
#pragma once

#include "core/scene.hpp"
#include "multirate/ball_steps.hpp"
#include "multirate/batches.hpp"

#include <memory>

namespace grainclock::multirate {

class InterfaceStrategy {
 public:
  virtual ~InterfaceStrategy() = default;

  /// By how many levels a contact may be coarser than its balls. Above 0, contacts among balls and those with fixed balls
  /// have levels apart (LevelChoice).
  virtual Level levels_below() const { return 0; }
  /// Rows begin or go on, from one tick at which they take part to the next, `seconds` later.
  virtual void drift(core::BallRow* rows, BallSteps& steps, core::RowSpan which, double seconds) const = 0;
  /// After the evaluations of a tick, for rows that take part in it. Clears their sums. Velocities are then those at this
  /// tick (of balls whose steps end), and if `p.drift` is above 0, the rows go on at once.
  /// Where all steps end, paths and the rows' bounds hold the acceleration: classes are chosen from them.
  virtual void kick(core::BallRow* rows, BallSteps& steps, const SummedRows& which, const core::KickParameters& p) = 0;
  /// Rows [begin, end) at a renewal, where all have new levels. If `is_new`, balances know nothing of any contact; else they
  /// are what the last kick left. For each contact whose level changes, its balls' balances then
  /// get the change of 2^level F (from 0 if it had no level).
  virtual void open(BallSteps& steps, bool is_new, std::uint32_t begin, std::uint32_t end) const = 0;
  /// After all that, when contacts have their levels. `rows` are those of the last evaluation.
  virtual void begin(const BallSteps& /*steps*/, const core::BallRow* /*rows*/, const Batches& /*batches*/) {}
  /// Before the contacts of a level are evaluated; those of finer ones have been.
  virtual void before_evaluation(const BallSteps& /*steps*/, Level /*level*/) {}
};

/// What strategies work with.
struct InterfaceSetup {
  const core::Kernels& kernels;
  core::Vec3 gravity;      // m/s2
  double unit;             // N, of force sums
  double half_tick;        // s
  core::SweepLaw laws[2];  // of contacts among balls and with fixed balls
};

/// The strategy of stepping.interface. Throws InputError where other keys do not go with it.
std::unique_ptr<InterfaceStrategy> make_interface(const core::Stepping& stepping, const InterfaceSetup& setup);

/// The damping ratio of a contact below which pairs of steps may resonate with it and heat the balls: where the tests of the
/// strategy see growth end (two springs over all phases, chains).
double least_damping_ratio(core::Interface interface);

// Each in the file of its name.
std::unique_ptr<InterfaceStrategy> make_accumulate(const InterfaceSetup& setup);
std::unique_ptr<InterfaceStrategy> make_frozen(const InterfaceSetup& setup);
std::unique_ptr<InterfaceStrategy> make_impulse(const InterfaceSetup& setup);
std::unique_ptr<InterfaceStrategy> make_extrapolate(const InterfaceSetup& setup);

}  // namespace grainclock::multirate
