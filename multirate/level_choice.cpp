#include "multirate/level_choice.hpp"

#include "core/order_free_sum.hpp"
#include "core/share_work.hpp"

#include <array>
#include <cmath>
#include <limits>

namespace grainclock::multirate {

namespace {

using core::BallRow;
using core::PairList;

constexpr std::uint32_t kRowsAtOnce = 128;  // rows whose needs from fixed balls are found together
// Speeds below these shares of sqrt(g d) and of omega d need not be resolved relative to themselves.
constexpr double kQuiet = 0.05, kStill = 1e-6;

constexpr double fourth(double x) { return (x * x) * (x * x); }

/// 1/s4, of a ball's impacts, eased where other contacts hold it.
double eased_impact4(double impact4, double smooth4) { return smooth4 > 0.0 ? impact4 / fourth(kConfinedReach) : impact4; }

}  // namespace

double omega(const core::Materials& materials, double diameter) {
  return std::sqrt(2.0 * materials.ball.k / materials.mass(0.5 * diameter));
}

LevelChoice::LevelChoice(const Ladder& ladder, const core::StepperSetup& setup, const core::ContactLaw& ball_law,
                         const core::ContactLaw& fixed_law, double length_scale, double interval, Level levels_below)
    : ladder_(ladder),
      setup_(setup),
      length_scale_(length_scale),
      interval_(interval),
      levels_below_(levels_below),
      threads_(std::max(1, setup.threads)),
      laws_{ball_law, fixed_law},
      add_needs_(add_needs_on(*setup.kernels)),
      needs_(static_cast<std::size_t>(threads_)),
      beyond_(static_cast<std::size_t>(threads_)) {}

template <class Work>
void LevelChoice::share_balls(Work work) const {
  core::share_range(urgency_.size(), threads_, [&](int /*t*/, std::size_t begin, std::size_t end) {
    work(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
  });
}

void LevelChoice::follow_order(std::size_t balls) {
  urgency_.resize(balls);
  for (std::vector<Need>& needs : needs_) needs.assign(balls, Need{});
}

const std::vector<Level>& LevelChoice::for_contacts(bool fixed, const BallSteps& steps) const {
  if (levels_below_ == 0) return steps.level;
  return fixed ? with_fixed_ : among_balls_;
}

void LevelChoice::choose(const Recorded& recorded, BallSteps& steps) {
  find_needs(recorded, steps);
  common_step4_ = std::numeric_limits<double>::infinity();
  steps.before.swap(steps.level);
  std::vector<Level>& level = levels_below_ > 0 ? among_balls_ : steps.level;
  choose_for(levels_below_ > 0 ? Kinds::ball : Kinds::all, recorded, steps, level);
  limit_levels(
      level, recorded.ball_pairs.span(), recorded.ball_pairs.count, setup_.stepping.limiter,
      [&](std::size_t p) { return recorded.books[0].level[p] != kSkipped; }, beyond_);
  if (levels_below_ == 0) return;
  choose_for(Kinds::fixed, recorded, steps, with_fixed_);
  steps.level.resize(level.size());
  for (std::size_t row = 0; row < level.size(); ++row) {
    const Level its = std::min(among_balls_[row], with_fixed_[row]);
    steps.level[row] = its;
    for (std::vector<Level>* level_of : {&among_balls_, &with_fixed_})
      (*level_of)[row] = std::min((*level_of)[row], static_cast<Level>(its + levels_below_));
  }
}

NeedParameters LevelChoice::need_parameters(bool fixed) const {
  const core::ContactLaw& its = laws_[fixed];
  return {its.k, its.reach, interval_, kSoon * length_scale_, speed2_, 1.0 / (largest_inverse_mass_ * kMatrixUnit), !fixed};
}

/// Needs of balls from their pairs with each other; marks pairs that cannot touch before the next renewal.
void LevelChoice::find_needs(const Recorded& recorded, const BallSteps& steps) {
  speed2_ = mean_square_speed(recorded.balls);
  largest_inverse_mass_ = 0.0;
  for (const double inverse : recorded.balls.inverse_mass) largest_inverse_mass_ = std::max(largest_inverse_mass_, inverse);
  PairBook& book = recorded.books[false];
  core::share_range(recorded.ball_pairs.count, threads_, [&](int t, std::size_t begin, std::size_t end) {
    add_needs_(recorded.ball_pairs.span(), book.records(0), steps.paths.data(), recorded.margin.data(),
               need_parameters(false), book.level.data(), needs_[static_cast<std::size_t>(t)].data(), 0,
               begin, end);
  });
}

/// Each ball's level from what its pairs need, before the limiter. Uses up the needs of the kinds asked for.
void LevelChoice::choose_for(Kinds kinds, const Recorded& recorded, const BallSteps& steps, std::vector<Level>& level) {
  std::vector<StepWeights> weights;
  for (Level l = 0; l <= ladder_.coarsest(); ++l)
    weights.emplace_back(ladder_.step(l), laws_[0], laws_[1], largest_inverse_mass_);
  const NeedParameters with_fixed = need_parameters(true);
  const PairList& pairs = recorded.fixed_pairs;
  PairBook& book = recorded.books[true];
  level.resize(urgency_.size());
  share_balls([&](std::uint32_t begin, std::uint32_t end) {
    // The pairs with fixed balls are few and in order of their balls: a few rows at a time, in the cache.
    const auto first_of = [&](std::uint32_t row) {
      const auto its = pairs.i.begin();
      return static_cast<std::size_t>(std::lower_bound(its, its + static_cast<std::ptrdiff_t>(pairs.count), row) - its);
    };
    std::array<Need, kRowsAtOnce> of_fixed{};
    for (std::uint32_t row = begin; row < end; ++row) {
      Need& its_fixed = of_fixed[(row - begin) % kRowsAtOnce];
      if (kinds != Kinds::ball && (row - begin) % kRowsAtOnce == 0) {
        add_needs_(pairs.span(), book.records(0), steps.paths.data(), recorded.margin.data(), with_fixed, book.level.data(),
                   of_fixed.data(), row, first_of(row), first_of(std::min(row + kRowsAtOnce, end)));
      }
      ContactMatrix matrix;
      Urgency& urgency = urgency_[row] = {};
      const auto take = [&urgency](Need& need, NormalMatrix& sum) {
        for (int k = 0; k < 6; ++k) sum.entry[k] += need.matrix[k];
        urgency.smooth4 = std::max(urgency.smooth4, need.smooth4);
        urgency.impact4 = std::max(urgency.impact4, need.impact4);
        need = {};
      };
      if (kinds != Kinds::fixed) {
        for (std::vector<Need>& part : needs_) take(part[row], matrix.ball);
      }
      if (kinds != Kinds::ball) take(its_fixed, matrix.fixed);
      urgency.impact4 = eased_impact4(urgency.impact4, urgency.smooth4);
      Level its = ladder_.coarsest();
      while (its > 0 && !is_stable(matrix, weights[its])) --its;
      level[row] = its;
    }
  });
  able_ = level;
  share_error(kSmoothError, &Urgency::smooth4, steps.before, level);
  share_error(kImpactError, &Urgency::impact4, steps.before, level);
}

/// Makes balls finer until the expected error from these urgencies is the tolerance.
void LevelChoice::share_error(double error_factor, double Urgency::*urgency4, const std::vector<Level>& before,
                              std::vector<Level>& level) {
  strides4_.clear();
  double sum4 = 0.0;  // of urgencies, 1/s4
  for (std::size_t row = 0; row < urgency_.size(); ++row) {
    const double its4 = urgency_[row].*urgency4, stride4 = fourth(ladder_.step(able_[row])) * its4;
    if (stride4 > 0.0) strides4_.push_back(stride4);
    sum4 += its4;
  }
  const std::size_t n = urgency_.size();
  if (sum4 > 0.0) common_step4_ = std::min(common_step4_, affordable4(n, error_factor, setup_.stepping.tolerance) / sum4);
  ran_out_ = ran_out_ || fourth(ladder_.tick()) > common_step4_;
  const double reach4 = shared_reach4(strides4_, n, error_factor, setup_.stepping.tolerance);
  share_balls([&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t row = begin; row < end; ++row) {
      // Contacts' own levels do not depend on what they were, for a restart does not know it: no hysteresis.
      const Level now = levels_below_ > 0 ? ladder_.coarsest() : before[row];
      level[row] = std::min(level[row], classed(urgency_[row].*urgency4, reach4, now));
      able_[row] = std::min(able_[row], classed(urgency_[row].*urgency4, reach4, ladder_.coarsest()));
    }
  });
}

/// The coarsest level within the reach, coarser than `now` only with room to spare.
Level LevelChoice::classed(double urgency4, double reach4, Level now) const {
  if (urgency4 * fourth(kHysteresis * ladder_.step(ladder_.coarsest())) <= reach4) return ladder_.coarsest();
  const double longest = std::sqrt(std::sqrt(reach4 / urgency4));  // s
  return std::min(ladder_.level_of(longest), std::max(now, ladder_.level_of(longest / kHysteresis)));
}

/// Mean square of the content's speeds [m2/s2], not below what counts as quiet or still.
double LevelChoice::mean_square_speed(const core::Balls& balls) const {
  const std::uint32_t n = balls.content_count();
  const auto square = [&](std::uint32_t row) {
    const BallRow& r = balls.rows[row];
    return r.vx * r.vx + r.vy * r.vy + r.vz * r.vz;
  };
  const double quiet = kQuiet * kQuiet * setup_.gravity.norm() * length_scale_;
  const double still = kStill * omega(setup_.materials, length_scale_) * length_scale_;
  // The sum stands last: what is not finite (then the step fails) counts as nothing.
  return std::max({quiet, still * still, core::order_free_sum(n, square) / std::max(1.0, static_cast<double>(n))});
}

}  // namespace grainclock::multirate
