#include "multirate/level_choice.hpp"

#include "core/order_free_sum.hpp"
#include "core/share_work.hpp"

#include <array>
#include <cmath>
#include <limits>

namespace grainclock::multirate {

namespace {

using core::PairList;

constexpr std::uint32_t kRowsAtOnce = 128;  // rows whose needs from fixed balls are found together
// Speeds below these shares of sqrt(g d) and of omega d need not be resolved relative to themselves.
constexpr double kQuiet = 0.05, kStill = 1e-6;

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
      need_kernels_(need_kernels_on(*setup.kernels)),
      needs_(static_cast<std::size_t>(threads_)) {}

template <class Work>
void LevelChoice::share_balls(Work work) const {
  core::share_range(smooth4_.size(), threads_, [&](int /*t*/, std::size_t begin, std::size_t end) {
    work(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
  });
}

void LevelChoice::follow_order(const core::Balls& balls) {
  const std::size_t n = balls.content_count();
  smooth4_.resize(n);
  impact4_.resize(n);
  for (std::vector<Need>& needs : needs_) needs.assign(n, Need{});
  largest_inverse_mass_ = 0.0;
  for (const double inverse : balls.inverse_mass) largest_inverse_mass_ = std::max(largest_inverse_mass_, inverse);
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
  limit_levels(level, recorded.by_ball, setup_.stepping.limiter,
               [&](std::uint32_t p) { return recorded.books[0].level[p] != kSkipped; });
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
  speed2_ = mean_square_speed(recorded.speed2);
  PairBook& book = recorded.books[false];
  core::share_range(recorded.ball_pairs.count, threads_, [&](int t, std::size_t begin, std::size_t end) {
    need_kernels_.add(recorded.ball_pairs.span(), book.records(0), steps.paths.data(), recorded.margin.data(),
                      need_parameters(false), book.level.data(), needs_[static_cast<std::size_t>(t)].data(), 0, begin, end);
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
  std::vector<Need*> of_balls;  // by thread
  if (kinds != Kinds::fixed) {
    for (std::vector<Need>& part : needs_) of_balls.push_back(part.data());
  }
  level.resize(smooth4_.size());
  share_balls([&](std::uint32_t begin, std::uint32_t end) {
    // The pairs with fixed balls are few and in order of their balls: a few rows at a time, in the cache.
    const auto first_of = [&](std::uint32_t row) {
      const auto its = pairs.i.begin();
      return static_cast<std::size_t>(std::lower_bound(its, its + static_cast<std::ptrdiff_t>(pairs.count), row) - its);
    };
    std::array<Need, kRowsAtOnce> of_fixed{};
    std::vector<Need*> of_these = of_balls;
    for (std::uint32_t row = begin; row < end; row += kRowsAtOnce) {
      const std::uint32_t n = std::min(kRowsAtOnce, end - row);
      if (kinds != Kinds::ball) {
        need_kernels_.add(pairs.span(), book.records(0), steps.paths.data(), recorded.margin.data(), with_fixed,
                          book.level.data(), of_fixed.data(), row, first_of(row), first_of(row + n));
      }
      for (std::size_t t = 0; t < of_balls.size(); ++t) of_these[t] = of_balls[t] + row;
      need_kernels_.take(of_these.data(), static_cast<int>(of_these.size()), kinds == Kinds::ball ? nullptr : of_fixed.data(), n,
                         weights.data(), ladder_.coarsest(), smooth4_.data() + row, impact4_.data() + row, level.data() + row);
    }
  });
  able_ = level;
  double smooth_sum4 = 0.0, impact_sum4 = 0.0;  // 1/s4; together, for either waits for its own last sum
  for (std::size_t row = 0; row < smooth4_.size(); ++row) {
    smooth_sum4 += smooth4_[row];
    impact_sum4 += impact4_[row];
  }
  share_error(kSmoothError, smooth4_, smooth_sum4, steps.before, level);
  share_error(kImpactError, impact4_, impact_sum4, steps.before, level);
}

/// Makes balls finer until the expected error from these urgencies, whose sum is `sum4`, is the tolerance.
void LevelChoice::share_error(double error_factor, const std::vector<double>& urgency4, double sum4,
                              const std::vector<Level>& before, std::vector<Level>& level) {
  const std::size_t n = urgency4.size();
  std::array<double, kMostLevels> step4;
  for (Level l = 0; l <= ladder_.coarsest(); ++l) step4[l] = fourth(ladder_.step(l));
  strides4_.resize(n);
  std::size_t count = 0;
  for (std::size_t row = 0; row < n; ++row) {
    const double stride4 = step4[able_[row]] * urgency4[row];
    strides4_[count] = stride4;
    count += stride4 > 0.0 ? 1 : 0;
  }
  strides4_.resize(count);
  if (sum4 > 0.0) common_step4_ = std::min(common_step4_, affordable4(n, error_factor, setup_.stepping.tolerance) / sum4);
  ran_out_ = ran_out_ || fourth(ladder_.tick()) > common_step4_;
  const double reach4 = shared_reach4(strides4_, n, error_factor, setup_.stepping.tolerance);
  const Level coarsest = ladder_.coarsest();
  const double spared4 = fourth(kHysteresis * ladder_.step(coarsest));  // s4
  share_balls([&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t row = begin; row < end; ++row) {
      if (urgency4[row] * spared4 <= reach4) continue;  // could be coarsest, with room to spare
      const double longest = std::sqrt(std::sqrt(reach4 / urgency4[row]));  // s
      // Contacts' own levels do not depend on what they were, for a restart does not know it: no hysteresis.
      const Level now = levels_below_ > 0 ? coarsest : before[row], within = ladder_.level_of(longest);
      able_[row] = std::min(able_[row], within);
      // Coarser than now only with room to spare.
      level[row] = std::min({level[row], within, std::max(now, ladder_.level_of(longest / kHysteresis))});
    }
  });
}

/// Mean square of the content's speeds [m2/s2], not below what counts as quiet or still.
double LevelChoice::mean_square_speed(const std::vector<double>& speed2) const {
  const auto n = static_cast<std::uint32_t>(speed2.size());
  const auto square = [&](std::uint32_t row) { return speed2[row]; };
  const double quiet = kQuiet * kQuiet * setup_.gravity.norm() * length_scale_;
  const double still = kStill * omega(setup_.materials, length_scale_) * length_scale_;
  // The sum stands last: what is not finite (then the step fails) counts as nothing.
  return std::max({quiet, still * still, core::order_free_sum(n, square) / std::max(1.0, static_cast<double>(n))});
}

}  // namespace grainclock::multirate
