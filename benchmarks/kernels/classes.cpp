// What selective steps cost beyond contacts and motion: the schedule, the parts of a renewal of classes, and whole
// coarse steps with and without one. The stepper tells from outside whether a coarse step ended with a renewal
// (it is checkpointable then) and whether that made a new pair list.
#include "multirate/classes.hpp"
#include "benchmarks/kernels/subjects.hpp"
#include "benchmarks/kernels/timing.hpp"
#include "multirate/limiter.hpp"
#include "multirate/schedule.hpp"
#include "multirate/stepper.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>

namespace grainclock::kernel_benchmarks {

namespace {

using multirate::Level;

constexpr double kCoarsest = 3.2e-4;  // s
constexpr double kTolerance = 1e-4;
constexpr int kLevels = 8;
constexpr Level kCoarsestLevel = kLevels - 1;
constexpr int kLimiter = 2;
constexpr int kSteps = 60;  // coarse steps that are looked at: a whole number of any usual interval between renewals

/// The walk through one coarse step with nothing to do.
void schedule(benchmark::State& run) {
  time_items(
      run, "step", 1, [] {},
      [] {
        const auto visit = [](const multirate::Action& action) { benchmark::DoNotOptimize(action.tick); };
        multirate::run_schedule(0, kCoarsestLevel, visit);
      });
}

/// One ball in a hundred at the finest level among coarse ones.
void limiter(benchmark::State& run, const Scene& scene) {
  const core::PairList& pairs = scene.pairs(false);
  std::vector<Level> level;
  multirate::PairsByBall by_ball;
  by_ball.begin(pairs, scene.balls.content_count());
  const auto restore = [&] {
    level.assign(scene.balls.rows.size(), kCoarsestLevel);
    for (std::size_t i = 0; i < scene.balls.content_count(); i += 100) level[i] = 0;
  };
  time_items(run, "ball", scene.balls.content_count(), restore, [&] {
    const std::size_t demotions = multirate::limit_levels(level, by_ball, kLimiter, [](std::uint32_t) { return true; });
    benchmark::DoNotOptimize(demotions);
  });
}

/// Strides over eight decades, as touching balls' are.
void shared_reach(benchmark::State& run, std::size_t balls) {
  std::mt19937 bits(1);
  std::vector<double> strides4(balls);
  for (double& stride4 : strides4) stride4 = std::pow(10.0, -8.0 * static_cast<double>(bits()) * 0x1p-32);
  time_items(
      run, "ball", balls, [] {},
      [&] {
        const double reach4 = multirate::shared_reach4(strides4, balls, multirate::kImpactError, kTolerance);
        benchmark::DoNotOptimize(reach4);
      });
}

/// The stability of balls with the scene's own contacts at the coarsest step.
void stability(benchmark::State& run, const Scene& scene) {
  const core::PairList& pairs = scene.pairs(false);
  const double inertia = *std::max_element(scene.balls.inverse_mass.begin(), scene.balls.inverse_mass.end());
  std::vector<multirate::ContactMatrix> matrix(scene.balls.content_count());
  for (std::size_t p = 0; p < pairs.count; ++p) {
    const core::Vec3 n = (position(scene.balls.rows[pairs.i[p]]) - position(scene.balls.rows[pairs.j[p]])).normalized();
    const auto nn = multirate::NormalMatrix::of(n.x(), n.y(), n.z(), 2.0 / multirate::kMatrixUnit);
    matrix[pairs.i[p]].ball += nn;
    matrix[pairs.j[p]].ball += nn;
  }
  const multirate::StepWeights weights(kCoarsest, scene.law(false).law, scene.law(true).law, inertia);
  time_items(
      run, "ball", matrix.size(), [] {},
      [&] {
        std::size_t stable = 0;
        for (const multirate::ContactMatrix& m : matrix) stable += multirate::is_stable(m, weights);
        benchmark::DoNotOptimize(stable);
      });
}

std::unique_ptr<core::Stepper> selective_stepper(const Start& start) {
  core::StepperSetup setup;
  setup.stepping.step = kCoarsest;
  setup.stepping.tolerance = kTolerance;
  setup.stepping.levels = kLevels;
  setup.stepping.limiter = kLimiter;
  setup.outlet_open = start.open;
  return multirate::make_multirate_stepper(start.state, setup);
}

/// How a coarse step ended.
enum class End { plain, renewed, relisted };

/// Takes a coarse step: how it ended and its seconds.
std::pair<End, double> coarse_step(core::Stepper& stepper) {
  const std::uint64_t lists = stepper.costs().list_builds;
  const double elapsed = seconds([&] { stepper.advance(1); });
  const bool relisted = stepper.costs().list_builds > lists;
  return {relisted ? End::relisted : stepper.is_checkpointable() ? End::renewed : End::plain, elapsed};
}

/// The mean of those among the first coarse steps that end as wanted, or of all; `share` tells how many do.
void coarse_steps(benchmark::State& run, const Start& start, std::optional<End> wanted) {
  const auto stepper = selective_stepper(start);
  int count = 0;
  for (auto turn : run) {
    (void)turn;
    double sum = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      const auto [end, elapsed] = coarse_step(*stepper);
      if (wanted && end != *wanted) continue;
      sum += elapsed;
      ++count;
    }
    if (count == 0) {
      run.SkipWithError("no coarse step ended so");
      return;
    }
    run.SetIterationTime(sum / count);
  }
  tell_per_item(run, "ball", start.state.count(core::Kind::content));
  run.counters["share"] = static_cast<double>(count) / kSteps;
}

}  // namespace

void add_classes(const Start& start) {
  const auto scene = std::make_shared<const Scene>(start, core::Materials{}, kLevels);
  add("schedule/empty", schedule);
  add("limiter/sparse", [=](benchmark::State& run) { limiter(run, *scene); });
  add("shared_reach/all", [=](benchmark::State& run) { shared_reach(run, scene->balls.content_count()); });
  add("stability/all", [=](benchmark::State& run) { stability(run, *scene); });
  const auto add_steps = [&](const char* name, std::optional<End> wanted) {
    add(name, [&start, wanted](benchmark::State& run) { coarse_steps(run, start, wanted); })->Iterations(1);
  };
  add_steps("coarse_step/plain", End::plain);
  add_steps("coarse_step/renewed", End::renewed);
  add_steps("coarse_step/relisted", End::relisted);
  add_steps("coarse_step/mean", {});
}

}  // namespace grainclock::kernel_benchmarks
