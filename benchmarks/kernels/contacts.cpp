// Evaluation of contacts, per listed pair: the sweeps of uniform and selective steps and the records of renewals.
#include "benchmarks/kernels/subjects.hpp"
#include "benchmarks/kernels/timing.hpp"
#include "core/candidate_list.hpp"

#include <algorithm>
#include <memory>

namespace grainclock::kernel_benchmarks {

namespace {

using core::Candidates;
using core::Kernels;
using core::PairSpan;
using core::SweepTotals;

constexpr int kLevels = 8;
constexpr int kShift = 3;  // a level

using SharedScene = std::shared_ptr<const Scene>;

void sweep(benchmark::State& run, const Kernels& kernel, const Scene& scene, bool fixed, bool events) {
  const PairSpan pairs = scene.pairs(fixed).span();
  std::vector<core::IntVec> sums(scene.balls.rows.size());
  core::CandidateList room;
  const auto clear = [&] { std::fill(sums.begin(), sums.end(), core::IntVec{}); };
  time_items(run, "pair", scene.pairs(fixed).count, clear, [&] {
    SweepTotals totals;
    Candidates found = room.room_for(pairs.n);
    kernel.sweep(scene.balls.rows.data(), pairs, scene.law(fixed), sums.data(), totals, events ? &found : nullptr);
    benchmark::DoNotOptimize(totals);
  });
}

void sweep_weighted(benchmark::State& run, const Kernels& kernel, const Scene& scene, bool events) {
  const PairSpan pairs = scene.pairs(false).span();
  std::vector<core::WeightedSum> sums(scene.balls.rows.size());
  core::CandidateList room;
  const auto clear = [&] { std::fill(sums.begin(), sums.end(), core::WeightedSum{}); };
  time_items(run, "pair", scene.pairs(false).count, clear, [&] {
    SweepTotals totals;
    Candidates found = room.room_for(pairs.n);
    kernel.sweep_weighted(scene.balls.rows.data(), pairs, scene.law(false), kShift, sums.data(), totals,
                          events ? &found : nullptr);
    benchmark::DoNotOptimize(totals);
  });
}

/// Evaluates all pairs for a renewal; `summing` as at the end of a step, else as for a new list.
void record(benchmark::State& run, const Kernels& kernel, const Scene& scene, bool summing) {
  const core::PairSpan pairs = scene.pairs(false).span();
  std::vector<float> overlap(pairs.n), rate(pairs.n);
  std::vector<core::PairDirection> direction(pairs.n);
  const std::vector<std::uint8_t> level(pairs.n, kShift);
  std::vector<core::WeightedSum> sums(scene.balls.rows.size());
  core::CandidateList room;
  const auto clear = [&] { std::fill(sums.begin(), sums.end(), core::WeightedSum{}); };
  time_items(run, "pair", scene.pairs(false).count, clear, [&] {
    Candidates found = room.room_for(pairs.n);
    SweepTotals totals;
    kernel.record(scene.balls.rows.data(), pairs, scene.law(false), level.data(),
                  {overlap.data(), rate.data(), direction.data()}, summing ? sums.data() : nullptr, totals, found);
    benchmark::DoNotOptimize(totals);
  });
}

/// Gives all pairs another level.
void reweigh(benchmark::State& run, const Kernels& kernel, const Scene& scene) {
  const core::PairSpan pairs = scene.pairs(false).span();
  const std::vector<std::uint8_t> from(pairs.n, kShift), to(pairs.n, kShift + 1);
  std::vector<core::IntVec> balance(scene.balls.rows.size());
  const auto clear = [&] { std::fill(balance.begin(), balance.end(), core::IntVec{}); };
  time_items(run, "pair", scene.pairs(false).count, clear, [&] {
    SweepTotals totals;
    kernel.reweigh(scene.balls.rows.data(), pairs, scene.law(false), from.data(), to.data(), balance.data(), totals);
    benchmark::DoNotOptimize(totals);
  });
}

}  // namespace

void add_contacts(const Start& start) {
  const auto scene = std::make_shared<const Scene>(start, core::Materials{}, kLevels);
  for (const Kernels* kernel : core::runnable_kernels()) {
    const auto add_one = [&](const std::string& name, auto body) {
      add(name + "/" + kernel->name, [=](benchmark::State& run) { body(run, *kernel, *scene); });
    };
    for (const bool events : {false, true}) {
      const std::string with = events ? "events" : "plain";
      add_one("sweep/" + with, [=](auto& run, auto& k, auto& s) { sweep(run, k, s, false, events); });
      add_one("sweep_fixed/" + with, [=](auto& run, auto& k, auto& s) { sweep(run, k, s, true, events); });
      add_one("sweep_weighted/" + with, [=](auto& run, auto& k, auto& s) { sweep_weighted(run, k, s, events); });
    }
    add_one("record/closing", [](auto& run, auto& k, auto& s) { record(run, k, s, true); });
    add_one("record/new_list", [](auto& run, auto& k, auto& s) { record(run, k, s, false); });
    add_one("reweigh/all", [](auto& run, auto& k, auto& s) { reweigh(run, k, s); });
  }
}

}  // namespace grainclock::kernel_benchmarks
