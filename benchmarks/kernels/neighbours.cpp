// Pair lists, per ball: building one for balls that are sorted already, as they are when a list has worn out.
#include "benchmarks/kernels/subjects.hpp"
#include "benchmarks/kernels/timing.hpp"

#include <fmt/format.h>

#include <memory>

namespace grainclock::kernel_benchmarks {

namespace {

constexpr std::size_t kMany = 200000;  // balls, at least

void build(benchmark::State& run, const core::Balls& of, int threads) {
  core::Balls balls = of;
  core::NeighbourList list(0.0, core::SkinRule::for_diameter(balls.mean_diameter), threads);
  list.build(balls);
  time_items(
      run, "ball", balls.content_count(), [] {}, [&] { list.build(balls); });
  run.counters["pairs"] = static_cast<double>(list.ball_pairs().count + list.fixed_pairs().count);
}

}  // namespace

void add_neighbours(const Start& start) {
  const std::size_t few = start.state.count(core::Kind::content);
  const int copies = static_cast<int>((kMany + few - 1) / few);
  for (const int times : {1, copies}) {
    const auto balls = std::make_shared<const core::Balls>(side_by_side(start.state, times), core::Materials{}, !start.open);
    for (const int threads : {1, 2}) {
      add(fmt::format("neighbours/{}_balls_{}_thread{}", balls->content_count(), threads, threads == 1 ? "" : "s"),
          [=](benchmark::State& run) { build(run, *balls, threads); });
    }
  }
}

}  // namespace grainclock::kernel_benchmarks
