// Where balls are expected between two renewals of classes: on straight lines, give or take a margin. Pairs that cannot
// touch on these are skipped, and pairs out of reach have no say in their balls' steps.
//
// A ball that leaves its line need not end all that. It goes on along another, unless that lets a skipped pair touch, brings
// another pair within reach, or takes the ball farther than the list looked ahead for it. None of this depends on which
// skipped pairs happen to be listed: neither restarts nor other skins change a bit.
#pragma once

#include "core/balls.hpp"
#include "core/neighbours.hpp"
#include "multirate/pair_book.hpp"
#include "multirate/pairs_by_ball.hpp"

#include <vector>

namespace grainclock::multirate {

/// Listed pairs of one kind, as last recorded and classified.
struct ClassedPairs {
  const core::PairList& pairs;
  const PairsByBall& by_ball;
  const PairBook& book;
  bool fixed;
  double reach;  // m, largest gap at which a pair interacts
};

class StraightPaths {
 public:
  /// `advance`: domain and coarsest step. `interval` [s] is the time between regular renewals, `length_scale` [m] the mean
  /// diameter.
  StraightPaths(const core::Kernels& kernels, const core::AdvanceParameters& advance, double interval, double length_scale,
                int threads);

  /// How long ahead of a renewal lists look [s].
  static double look_ahead(double interval) { return 1.1 * kAccelerating * interval; }

  /// At a renewal: all balls' lines from now on. Tells whether the list of these skins is worn: a pair that the renewal should
  /// see by its gap and speed could be missing.
  bool begin(const core::Balls& balls, const std::vector<core::SkinReference>& skins);
  /// By row: how far a ball may stray from its line [m].
  const std::vector<double>& margin() const { return margin_; }
  /// By row: the square of a ball's speed when its line began [m2/s2].
  const std::vector<double>& speed2() const { return speed2_; }
  /// All balls against their lines, `seconds` after the renewal and a coarsest step later, and against the domain.
  core::AdvanceReport watch(const core::Balls& balls, double seconds) const;
  /// Gives balls that are off their lines new ones until the next regular renewal. Tells whether all may have them; if
  /// not, classes are to be renewed at once.
  bool redirect_strays(const core::Balls& balls, const ClassedPairs (&kinds)[2], double seconds);

 private:
  double margin_of(const core::BallRow& row) const;
  void find_strays(const core::Balls& balls, double seconds);
  bool redirect(std::uint32_t row, const core::BallRow& ball, double seconds);
  bool keep_their_classes(const core::Balls& balls, const ClassedPairs& kind, double seconds) const;
  bool keeps_its_class(const core::Balls& balls, const ClassedPairs& kind, std::size_t pair, double seconds) const;

  const core::Kernels& kernels_;
  core::AdvanceParameters advance_;
  double interval_, length_scale_;
  int threads_;
  std::vector<core::StraightPath> lines_;
  std::vector<double> margin_;         // m
  std::vector<double> speed2_;         // m2/s2
  std::vector<std::uint32_t> strays_;  // rows
};

}  // namespace grainclock::multirate
