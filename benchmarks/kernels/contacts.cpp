// Evaluation of contacts, per listed pair: the sweeps of uniform and selective steps and the records of renewals.
#include "benchmarks/kernels/subjects.hpp"
#include "benchmarks/kernels/timing.hpp"

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

/// Room for the event candidates of a sweep.
class CandidateRoom {
 public:
  explicit CandidateRoom(std::size_t pairs) : pair_(pairs + core::kLanes) {}
  /// None yet.
  Candidates empty() { return {pair_.data()}; }

 private:
  std::vector<std::uint32_t> pair_;
};

void sweep(benchmark::State& run, const Kernels& kernel, const Scene& scene, bool fixed, bool events) {
  const PairSpan pairs = scene.pairs(fixed).span();
  std::vector<core::IntVec> sums(scene.balls.rows.size());
  CandidateRoom room(pairs.n);
  const auto clear = [&] { std::fill(sums.begin(), sums.end(), core::IntVec{}); };
  time_items(run, "pair", scene.pairs(fixed).count, clear, [&] {
    SweepTotals totals;
    Candidates found = room.empty();
    kernel.sweep(scene.balls.rows.data(), pairs, scene.law(fixed), sums.data(), totals, events ? &found : nullptr);
    benchmark::DoNotOptimize(totals);
  });
}

void sweep_weighted(benchmark::State& run, const Kernels& kernel, const Scene& scene, bool events) {
  const PairSpan pairs = scene.pairs(false).span();
  std::vector<core::WeightedSum> sums(scene.balls.rows.size());
  CandidateRoom room(pairs.n);
  const auto clear = [&] { std::fill(sums.begin(), sums.end(), core::WeightedSum{}); };
  time_items(run, "pair", scene.pairs(false).count, clear, [&] {
    SweepTotals totals;
    Candidates found = room.empty();
    kernel.sweep_weighted(scene.balls.rows.data(), pairs, scene.law(false), kShift, sums.data(), totals,
                          events ? &found : nullptr);
    benchmark::DoNotOptimize(totals);
  });
}

/// What Kernels::record writes.
struct Book {
  std::vector<double> overlap, rate, speed, nx, ny, nz;
  std::vector<core::IntVec> force;
  std::vector<std::int64_t> magnitude, power, turned;
  std::vector<std::uint8_t> shift;

  explicit Book(std::size_t n) : shift(n, kShift) {
    for (auto* v : {&overlap, &rate, &speed, &nx, &ny, &nz}) v->resize(n);
    force.resize(n);
    for (auto* v : {&magnitude, &power, &turned}) v->resize(n);
  }
  core::PairRecords records() {
    return {overlap.data(), rate.data(),      speed.data(), {nx.data(), ny.data(), nz.data()},
            force.data(),   magnitude.data(), power.data(), turned.data()};
  }
};

void record_into(Book& book, const Kernels& kernel, const Scene& scene, Candidates& found) {
  SweepTotals totals;
  kernel.record(scene.balls.rows.data(), scene.pairs(false).span(), scene.law(false), book.records(), totals, &found);
  benchmark::DoNotOptimize(totals);
}

void record(benchmark::State& run, const Kernels& kernel, const Scene& scene) {
  Book book(scene.pairs(false).span().n);
  CandidateRoom room(scene.pairs(false).span().n);
  time_items(
      run, "pair", scene.pairs(false).count, [] {},
      [&] {
        Candidates found = room.empty();
        record_into(book, kernel, scene, found);
      });
}

void sum_recorded(benchmark::State& run, const Kernels& kernel, const Scene& scene) {
  const core::PairList& pairs = scene.pairs(false);
  Book book(pairs.span().n);
  CandidateRoom room(pairs.span().n);
  Candidates found = room.empty();
  record_into(book, kernel, scene, found);
  std::vector<core::WeightedSum> sums(scene.balls.rows.size());
  const auto clear = [&] { std::fill(sums.begin(), sums.end(), core::WeightedSum{}); };
  time_items(run, "pair", pairs.count, clear, [&] {
    kernel.sum_recorded(pairs.span(), book.force.data(), book.shift.data(), true, sums.data(), 0, pairs.count);
  });
}

void total_recorded(benchmark::State& run, const Kernels& kernel, const Scene& scene) {
  const core::PairList& pairs = scene.pairs(false);
  Book book(pairs.span().n);
  CandidateRoom room(pairs.span().n);
  Candidates found = room.empty();
  record_into(book, kernel, scene, found);
  time_items(
      run, "pair", pairs.count, [] {},
      [&] {
        SweepTotals totals;
        kernel.total_recorded(book.records(), book.shift.data(), false, totals, 0, pairs.count);
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
    add_one("record/events", [](auto& run, auto& k, auto& s) { record(run, k, s); });
    add_one("sum_recorded/all", [](auto& run, auto& k, auto& s) { sum_recorded(run, k, s); });
    add_one("total_recorded/all", [](auto& run, auto& k, auto& s) { total_recorded(run, k, s); });
  }
}

}  // namespace grainclock::kernel_benchmarks
