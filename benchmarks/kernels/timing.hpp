// One way to time: a piece of work by itself, however often the library asks for it, and what it costs per item.
#pragma once

#include <benchmark/benchmark.h>

#include <chrono>
#include <functional>
#include <string>

namespace grainclock::kernel_benchmarks {

/// Seconds that `work` takes.
template <class Work>
double seconds(Work work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  benchmark::ClobberMemory();
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  return elapsed.count();
}

/// The counter `per_<item>` [s] of a benchmark whose iterations each did `items`.
inline void tell_per_item(benchmark::State& run, const std::string& item, std::size_t items) {
  run.counters["per_" + item] = benchmark::Counter(
      static_cast<double>(items), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  run.SetItemsProcessed(run.iterations() * static_cast<std::int64_t>(items));
}

/// Times `work`, which does `items`; `prepare` comes before each and is not timed.
template <class Prepare, class Work>
void time_items(benchmark::State& run, const std::string& item, std::size_t items, Prepare prepare, Work work) {
  for (auto turn : run) {
    (void)turn;
    prepare();
    run.SetIterationTime(seconds(work));
  }
  tell_per_item(run, item, items);
}

/// Registers a benchmark by the clock on the wall, seen by time_items().
inline benchmark::internal::Benchmark* add(const std::string& name, std::function<void(benchmark::State&)> body) {
  return benchmark::RegisterBenchmark(name.c_str(), std::move(body))->UseManualTime()->Unit(benchmark::kMicrosecond);
}

}  // namespace grainclock::kernel_benchmarks
