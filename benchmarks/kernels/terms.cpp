// What the law's terms cost where they are on, and that they cost nothing where they are off:
// `kernel_terms [--state FILE] [--open] [--out FILE.csv]`.
//
// Machines slow down for seconds at a time, so all variants run in turn, round after round; a ratio is formed within
// a round, and the median and the quartiles over the rounds are told.
#include "benchmarks/kernels/scene.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/stepper.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <functional>
#include <iterator>
#include <memory>
#include <vector>

namespace grainclock::core {

extern const Kernels kernels_bare_portable;  // bare_kernels.cpp
#if defined(GRAINCLOCK_X86)
extern const Kernels kernels_bare_avx2;
extern const Kernels kernels_bare_avx512;
#endif

}  // namespace grainclock::core

using namespace grainclock;
using kernel_benchmarks::Scene;
using kernel_benchmarks::Start;

namespace {

constexpr int kSweepRounds = 400, kStepRounds = 60;
constexpr std::int64_t kSteps = 10;  // per round
constexpr double kCohesion = 3e3;    // N

/// Which terms are on.
struct Variant {
  const char* name;
  bool clamp, cohesion, events;
};
constexpr Variant kVariants[] = {
    {"off", false, false, false},   {"clamp", true, false, false},       {"cohesion", false, true, false},
    {"events", false, false, true}, {"clamp+events", true, false, true},  // the default of scenes
    {"all", true, true, true}};
constexpr const Variant& kAll = kVariants[std::size(kVariants) - 1];

core::Materials materials(const Variant& variant) {
  core::Materials m;
  m.tension = !variant.clamp;
  m.cohesion = variant.cohesion ? kCohesion : 0.0;
  return m;
}

/// Something to time, told as a ratio to the first of its group.
struct Contender {
  std::string name;
  std::function<void()> prepare, work;
};
struct Ratio {
  std::string name;
  double low, median, high;  // quartiles
};

double quantile(std::vector<double>& values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double seconds(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Ratios to the first contender, each within a round. A round begins with another contender each time.
std::vector<Ratio> compare(const std::vector<Contender>& contenders, int rounds) {
  const std::size_t n = contenders.size();
  std::vector<std::vector<double>> ratios(n);
  std::vector<double> elapsed(n);
  for (int round = -1; round < rounds; ++round) {  // the first warms up
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t which = (k + static_cast<std::size_t>(round + 1)) % n;
      contenders[which].prepare();
      elapsed[which] = seconds(contenders[which].work);
    }
    for (std::size_t k = 0; round >= 0 && k < n; ++k) ratios[k].push_back(elapsed[k] / elapsed[0]);
  }
  std::vector<Ratio> out;
  for (std::size_t k = 0; k < n; ++k) {
    out.push_back({contenders[k].name, quantile(ratios[k], 0.25), quantile(ratios[k], 0.5), quantile(ratios[k], 0.75)});
  }
  return out;
}

/// The bare sets in the order of runnable_kernels().
std::vector<const core::Kernels*> bare_kernels() {
  return {
    &core::kernels_bare_portable,
#if defined(GRAINCLOCK_X86)
        &core::kernels_bare_avx2, &core::kernels_bare_avx512
#endif
  };
}

/// Buffers of a sweep.
struct SweepRoom {
  std::vector<core::IntVec> sums;
  std::vector<std::uint32_t> candidates;
};

Contender sweep(std::string name, const Scene& scene, const core::Kernels& kernel, const Variant& variant, SweepRoom& room) {
  const core::SweepLaw law = core::sweep_law(materials(variant), false, scene.scale, kernel_benchmarks::kStep);
  const auto clear = [&room] { std::fill(room.sums.begin(), room.sums.end(), core::IntVec{}); };
  return {std::move(name), clear, [&scene, &kernel, &room, law, events = variant.events] {
            core::SweepTotals totals;
            core::Candidates found{room.candidates.data()};
            kernel.sweep(scene.balls.rows.data(), scene.list.ball_pairs().span(), law, room.sums.data(), totals,
                         events ? &found : nullptr);
          }};
}

/// The bare loop computes what the program's does with all terms off, or the comparison means nothing.
void require_same_forces(const std::vector<Contender>& contenders, SweepRoom& room) {
  std::vector<std::vector<core::IntVec>> sums;
  for (const Contender& contender : {contenders[0], contenders[1]}) {
    contender.prepare();
    contender.work();
    sums.push_back(room.sums);
  }
  const auto same = [](const core::IntVec& a, const core::IntVec& b) { return std::equal(a.v, a.v + 4, b.v); };
  GC_REQUIRE(std::equal(sums[0].begin(), sums[0].end(), sums[1].begin(), same),
             "the bare loop gives other forces than the law without terms; bring bare_kernels.cpp up to date");
}

/// Sweeps over the same pairs, per instruction set, against the bare loop.
std::vector<std::pair<std::string, std::vector<Ratio>>> sweep_ratios(const Start& start) {
  const Scene scene(start, materials(kAll), 1);  // listed for all terms
  SweepRoom room{std::vector<core::IntVec>(scene.balls.rows.size()),
                 std::vector<std::uint32_t>(scene.list.ball_pairs().i.size() + core::kLanes)};
  std::vector<std::pair<std::string, std::vector<Ratio>>> out;
  const auto sets = core::runnable_kernels(), bare = bare_kernels();
  for (std::size_t k = 0; k < sets.size(); ++k) {
    std::vector<Contender> contenders{sweep("bare", scene, *bare[k], kVariants[0], room)};
    for (const Variant& variant : kVariants) contenders.push_back(sweep(variant.name, scene, *sets[k], variant, room));
    require_same_forces(contenders, room);
    out.emplace_back(sets[k]->name, compare(contenders, kSweepRounds));
  }
  return out;
}

/// Whole uniform steps, upkeep included, against those with all terms off.
std::vector<Ratio> step_ratios(const Start& start) {
  std::vector<std::unique_ptr<core::Stepper>> steppers;
  std::vector<Contender> contenders;
  for (const Variant& variant : kVariants) {
    core::StepperSetup setup;
    setup.stepping.method = core::Method::uniform;
    setup.stepping.step = kernel_benchmarks::kStep;
    setup.stepping.events = variant.events;
    setup.materials = materials(variant);
    setup.outlet_open = start.open;
    steppers.push_back(core::make_uniform_stepper(start.state, setup));
    contenders.push_back({variant.name, [] {}, [stepper = steppers.back().get()] { stepper->advance(kSteps); }});
  }
  return compare(contenders, kStepRounds);
}

/// Prints a group and adds it to the table.
void tell(const std::string& what, const std::string& set, const std::vector<Ratio>& ratios, std::string& csv) {
  for (const Ratio& ratio : ratios) {
    fmt::print("{:5}  {:8}  {:12}  {:.3f}  ({:.3f} to {:.3f})\n", what, set, ratio.name, ratio.median, ratio.low,
               ratio.high);
    csv += fmt::format("{},{},{},{:.4f},{:.4f},{:.4f}\n", what, set, ratio.name, ratio.median, ratio.low, ratio.high);
  }
  std::fflush(stdout);
}

void run(const std::string& path, bool open, const std::string& out) {
  const Start start = kernel_benchmarks::load(path, open);
  fmt::print(
      "Time of a sweep over the same pairs over that of the bare loop in the same round, and time of a whole uniform step\n"
      "over that with all terms off in the same round: median (quartiles) over {} and {} rounds of all variants in turn.\n",
      kSweepRounds, kStepRounds);
  std::string csv = "what,kernels,terms,median,low,high\n";
  for (const auto& [set, ratios] : sweep_ratios(start)) tell("sweep", set, ratios, csv);
  tell("step", core::kernels().name, step_ratios(start), csv);
  if (!out.empty()) core::write_text(out, csv);
}

}  // namespace

int main(int count, char** arguments) {
  std::string path, out;
  bool open = false;
  CLI::App app("What the contact law's terms cost, on and off.", "kernel_terms");
  app.add_option("--state", path, "Balls, .h5 or .csv; without it a random packing of 20,000");
  app.add_flag("--open", open, "Leave the outlet's plug out");
  app.add_option("--out", out, "Table to write, .csv");
  try {
    app.parse(count, arguments);
    run(path, open, out);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(core::ExitCode::bad_input);
  } catch (const core::Error& error) {
    fmt::print(stderr, "kernel_terms: {}\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
