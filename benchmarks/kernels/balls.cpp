// Motion of balls, per ball: the halves of a uniform step, and drift, kick and watch of selective steps.
#include "benchmarks/kernels/subjects.hpp"
#include "benchmarks/kernels/timing.hpp"

#include <limits>
#include <memory>
#include <numeric>

namespace grainclock::kernel_benchmarks {

namespace {

using core::Advance;
using core::AdvanceParameters;
using core::Kernels;

constexpr int kLevels = 8;
constexpr std::uint8_t kLevel = kLevels - 1;

AdvanceParameters parameters(const Scene& scene) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  AdvanceParameters p{};
  p.gravity[2] = -kGravity;
  p.unit = scene.scale.unit;
  p.step = kStep;
  for (int k = 0; k < 3; ++k) {
    p.lower[k] = -kInfinity;
    p.upper[k] = kInfinity;
  }
  return p;
}

/// Forces on the content as a sweep leaves them.
std::vector<core::IntVec> force_sums(const Scene& scene) {
  std::vector<core::IntVec> sums(scene.balls.rows.size());
  core::SweepTotals totals;
  for (const bool fixed : {false, true}) {
    core::kernels().sweep(scene.balls.rows.data(), scene.pairs(fixed).span(), scene.law(fixed), sums.data(), totals,
                          nullptr);
  }
  return sums;
}

using AdvanceKernel = decltype(Kernels::advance_predicted);

void advance(benchmark::State& run, AdvanceKernel kernel, const Scene& scene, Advance what) {
  const std::vector<core::IntVec> forces = force_sums(scene);
  const AdvanceParameters p = parameters(scene);
  std::vector<core::BallRow> rows;
  std::vector<core::IntVec> sums, opening;
  const auto restore = [&] {
    rows.assign(scene.balls.rows.begin(), scene.balls.rows.end());
    sums = forces;
    opening = forces;
  };
  const std::size_t n = scene.balls.content_count();
  time_items(run, "ball", n, restore, [&] {
    const core::AdvanceReport report = kernel(what, rows.data(), sums.data(), sums.size(), 1, opening.data(),
                                              scene.balls.inverse_mass.data(), scene.list.skins().data(), p, 0, n);
    benchmark::DoNotOptimize(report);
  });
}

/// All rows in their order, and the paths they are on.
struct Paths {
  std::vector<std::uint32_t> rows;
  std::vector<core::Path> paths;

  explicit Paths(const Scene& scene) : rows(scene.balls.content_count()), paths(rows.size()) {
    std::iota(rows.begin(), rows.end(), 0U);
    for (const std::uint32_t row : rows) paths[row] = {0.0, 0.0, -kGravity, scene.balls.inverse_mass[row]};
  }
  core::RowSpan span() const { return {rows.data(), rows.size()}; }
};

void drift(benchmark::State& run, const Kernels& kernel, const Scene& scene) {
  const Paths on(scene);
  std::vector<core::BallRow> rows;
  const auto restore = [&] { rows.assign(scene.balls.rows.begin(), scene.balls.rows.end()); };
  time_items(run, "ball", on.rows.size(), restore, [&] { kernel.drift(rows.data(), on.paths.data(), on.span(), kStep); });
}

/// `ends`: whether the balls' own steps end, or only their balance grows; `drift` [s]: by which they go on at once.
void kick(benchmark::State& run, const Kernels& kernel, const Scene& scene, bool ends, double drift) {
  Paths on(scene);
  const std::vector<core::IntVec> forces = force_sums(scene);
  const std::vector<std::uint8_t> level(on.rows.size(), kLevel);
  std::vector<core::WeightedSum> sums(forces.size());
  std::vector<core::IntVec> balance, opening(on.rows.size());
  std::vector<core::BallRow> rows;
  const auto restore = [&] {
    rows.assign(scene.balls.rows.begin(), scene.balls.rows.end());
    balance.assign(on.rows.size(), core::IntVec{});
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = {forces[i], forces[i]};
  };
  const core::KickParameters p{{0.0, 0.0, -kGravity}, scene.scale.unit, kStep, ends ? kLevel : kLevel - 1, drift};
  time_items(run, "ball", on.rows.size(), restore, [&] {
    kernel.kick(rows.data(), on.paths.data(), balance.data(), opening.data(), level.data(), sums.data(), sums.size(), 1, on.span(), p);
  });
}

void watch(benchmark::State& run, const Kernels& kernel, const Scene& scene) {
  const std::size_t n = scene.balls.content_count();
  std::vector<core::StraightPath> expected;
  for (std::size_t i = 0; i < n; ++i) {
    const core::BallRow& r = scene.balls.rows[i];
    expected.push_back({r.x, r.y, r.z, 1e-3, r.vx, r.vy, r.vz, 0.0});
  }
  const AdvanceParameters p = parameters(scene);
  time_items(
      run, "ball", n, [] {},
      [&] {
        const core::AdvanceReport report = kernel.watch(scene.balls.rows.data(), expected.data(), kStep, p, 0, n);
        benchmark::DoNotOptimize(report);
      });
}

}  // namespace

void add_balls(const Start& start) {
  const auto scene = std::make_shared<const Scene>(start, core::Materials{}, kLevels);
  for (const Kernels* kernel : core::runnable_kernels()) {
    const auto add_one = [&](const std::string& name, auto body) {
      add(name + "/" + kernel->name, [=](benchmark::State& run) { body(run, *kernel, *scene); });
    };
    add_one("advance/open", [](auto& run, auto& k, auto& s) { advance(run, k.advance_predicted, s, Advance::open); });
    add_one("advance/close", [](auto& run, auto& k, auto& s) { advance(run, k.advance_predicted, s, Advance::close); });
    add_one("advance/both",
            [](auto& run, auto& k, auto& s) { advance(run, k.advance_predicted, s, Advance::close_and_open); });
    add_one("advance/lagged",
            [](auto& run, auto& k, auto& s) { advance(run, k.advance_lagged, s, Advance::close_and_open); });
    add_one("drift/all", [](auto& run, auto& k, auto& s) { drift(run, k, s); });
    add_one("kick/end", [](auto& run, auto& k, auto& s) { kick(run, k, s, true, 0.0); });
    add_one("kick/end_and_drift", [](auto& run, auto& k, auto& s) { kick(run, k, s, true, kStep); });
    add_one("kick/within", [](auto& run, auto& k, auto& s) { kick(run, k, s, false, 0.0); });
    add_one("watch/all", [](auto& run, auto& k, auto& s) { watch(run, k, s); });
  }
}

}  // namespace grainclock::kernel_benchmarks
