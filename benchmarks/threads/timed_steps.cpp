// Seconds for a stretch of simulated time in flow, and the checksum of the state at its end: `timed_steps STATE --method M --threads N`.
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cmath>

using namespace grainclock;

namespace {

constexpr double kOutlet = -0.5;       // m, below it the balls of Table 1's scenes are removed
constexpr double kUniformStep = 8e-5;  // s, of Table 1's scenes

}  // namespace

int main(int count, char** arguments) try {
  std::string path, method = "multirate";
  int threads = 1;
  double seconds = 0.064, tolerance = 1e-4;
  CLI::App app("Seconds on the clock for a stretch of flow, with the outlet open.", "timed_steps");
  app.add_option("STATE", path, "state file")->required()->check(CLI::ExistingFile);
  app.add_option("--method", method, "uniform (plain, 8e-5 s) or multirate")->check(CLI::IsMember({"uniform", "multirate"}));
  app.add_option("--tolerance", tolerance, "of multirate")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--threads", threads)->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--seconds", seconds, "simulated [s]")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, count, arguments);

  const core::State state = core::read_state(path);
  core::StepperSetup setup;
  setup.outlet_open = true;
  setup.domain.outlet_z = kOutlet;
  setup.threads = threads;
  setup.stepping.method = method == "uniform" ? core::Method::uniform : core::Method::multirate;
  setup.stepping.events = method != "uniform";
  setup.stepping.tolerance = tolerance;
  setup.stepping.step = method == "uniform" ? kUniformStep : multirate::default_step(state, setup);
  const auto stepper = multirate::make_stepper(state, setup);
  const std::int64_t steps = std::llround(std::ceil(seconds / stepper->step()));
  stepper->advance(steps / 10);  // warm caches, and the other threads awake
  const core::Costs before = stepper->costs();
  const auto begin = std::chrono::steady_clock::now();
  stepper->advance(steps);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  const core::Costs after = stepper->costs();
  std::printf("%.6f %llu %llu %016llx\n", elapsed.count(),
              static_cast<unsigned long long>(after.contact_evaluations - before.contact_evaluations),
              static_cast<unsigned long long>(after.ball_updates - before.ball_updates),
              static_cast<unsigned long long>(core::checksum(stepper->state())));
  return 0;
} catch (const core::Error& error) {
  std::fprintf(stderr, "timed_steps: %s\n", error.what());
  return static_cast<int>(error.code());
}
