// Ball-steps per second of the uniform stepper on a state: `uniform_speed STATE [STEP] [THREADS]`.
// The plug is in place; steps are plain (predicted, no event correction). Prints five rates and their median.
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "core/stepper.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>

using namespace grainclock;

int main(int count, char** arguments) try {
  if (count < 2) {
    std::fputs("usage: uniform_speed STATE [STEP in s, default 8e-5] [THREADS, default 1]\n", stderr);
    return static_cast<int>(core::ExitCode::bad_input);
  }
  core::State state = core::read_state(arguments[1]);
  core::StepperSetup setup;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = false;
  setup.stepping.step = count > 2 ? std::strtod(arguments[2], nullptr) : 8e-5;
  setup.threads = count > 3 ? std::atoi(arguments[3]) : 1;
  const auto stepper = core::make_uniform_stepper(state, setup);
  stepper->advance(100);  // warm caches

  constexpr int kRepeats = 5;
  constexpr std::int64_t kSteps = 1000;
  std::vector<double> rates;
  for (int k = 0; k < kRepeats; ++k) {
    const std::uint64_t before = stepper->costs().ball_updates;
    const auto begin = std::chrono::steady_clock::now();
    stepper->advance(kSteps);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    rates.push_back(static_cast<double>(stepper->costs().ball_updates - before) / elapsed.count());
    std::printf("%.1f million ball-steps/s\n", 1e-6 * rates.back());
  }
  std::sort(rates.begin(), rates.end());
  std::printf("median %.1f million ball-steps/s with %.0f listed pairs\n", 1e-6 * rates[kRepeats / 2],
              stepper->level_statistics().listed);
  return 0;
} catch (const core::Error& error) {
  std::fprintf(stderr, "uniform_speed: %s\n", error.what());
  return static_cast<int>(error.code());
}
