// The level of every ball, and of the contacts that it takes part in, from what its listed pairs ask of it (classes.hpp).
#pragma once

#include "core/balls.hpp"
#include "core/neighbours.hpp"
#include "core/stepper.hpp"
#include "multirate/ball_steps.hpp"
#include "multirate/limiter.hpp"
#include "multirate/pair_book.hpp"
#include "multirate/pairs_by_ball.hpp"

#include <cmath>
#include <vector>

namespace grainclock::multirate {

/// Circular frequency of two undamped balls of this diameter in contact [1/s].
double omega(const core::Materials& materials, double diameter);

/// The last evaluation of all listed pairs, at the end of everyone's step.
struct Recorded {
  const core::PairList& ball_pairs;
  const core::PairList& fixed_pairs;
  const PairsByBall& by_ball;         // pairs among balls
  PairBook* books;                    // of the pairs among balls and with fixed balls; levels: see AddNeeds
  const std::vector<double>& margin;  // m, how far each ball may stray from its straight path
  const std::vector<double>& speed2;  // m2/s2, squares of balls' speeds
};

/// Where contacts have the finer level of their two balls, a ball's step is for all its contacts together. Where they have
/// levels of their own (`levels_below` coarser than those of their balls at most, 0: none), the step for contacts among
/// balls and the one for those with fixed balls are chosen apart.
class LevelChoice {
 public:
  /// `interval` [s] is the time between renewals, `length_scale` [m] the mean diameter.
  LevelChoice(const Ladder& ladder, const core::StepperSetup& setup, const core::ContactLaw& ball_law,
              const core::ContactLaw& fixed_law, double length_scale, double interval, Level levels_below);

  void follow_order(const core::Balls& balls);
  /// Chooses `steps.level`, keeps what it was in `steps.before`, and marks pairs that cannot touch before the next renewal.
  void choose(const Recorded& recorded, BallSteps& steps);
  /// A contact with (or without) fixed balls has the finer of these levels of its balls.
  const std::vector<Level>& for_contacts(bool fixed, const BallSteps& steps) const;
  /// The longest step [s] with which all balls together would keep the tolerance, by the last choice; infinite if nothing moves.
  double common_step() const { return std::sqrt(std::sqrt(common_step4_)); }
  /// Whether even with all balls at level 0 the tolerance was not to be had, at some time.
  bool ran_out() const { return ran_out_; }

 private:
  /// Which contacts a level is for.
  enum class Kinds { all, ball, fixed };

  void find_needs(const Recorded& recorded, const BallSteps& steps);
  void choose_for(Kinds kinds, const Recorded& recorded, const BallSteps& steps, std::vector<Level>& level);
  void share_error(double error_factor, const std::vector<double>& urgency4, double sum4, const std::vector<Level>& before,
                   std::vector<Level>& level);
  double mean_square_speed(const std::vector<double>& speed2) const;
  NeedParameters need_parameters(bool fixed) const;
  /// Calls work(begin, end) for shares of the content, by threads.
  template <class Work>
  void share_balls(Work work) const;

  Ladder ladder_;
  core::StepperSetup setup_;
  double length_scale_, interval_;
  Level levels_below_;
  int threads_;
  core::ContactLaw laws_[2];  // among balls, with fixed balls
  const NeedKernels& need_kernels_;
  std::vector<std::vector<Need>> needs_;  // per thread, of pairs among balls; clear between renewals
  std::vector<double> smooth4_, impact4_;  // 1/s4, what a ball's smooth pairs and its impacts ask, see classes.hpp
  std::vector<double> strides4_;           // see shared_reach4()
  // What balls could take but for hysteresis: errors are shared by it, for a restart knows levels only after the limiter.
  std::vector<Level> able_;
  std::vector<Level> among_balls_, with_fixed_;  // only of contacts with levels of their own
  double speed2_ = 0.0;                          // m2/s2, see mean_square_speed()
  double largest_inverse_mass_ = 0.0;
  double common_step4_ = 0.0;  // s4
  bool ran_out_ = false;
};

}  // namespace grainclock::multirate
