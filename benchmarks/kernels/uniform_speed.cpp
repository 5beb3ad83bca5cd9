// Ball-steps per second of the uniform stepper on a state: `uniform_speed STATE [options]`.
// Prints the rate of each repeat and their median.
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "core/stepper.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

using namespace grainclock;

namespace {

constexpr std::int64_t kWarmUp = 100;  // steps

struct Options {
  std::string state;
  std::string kernels = core::kernels().name;
  double step = 8e-5;  // s
  int threads = 1;
  int repeats = 5;
  std::int64_t steps = 1000;  // per repeat
  bool open = false;
  bool events = false;
};

/// Work and time of one repeat.
struct Measured {
  double ball_updates = 0.0, contact_evaluations = 0.0;
  double seconds = 0.0;
  double rate() const { return ball_updates / seconds; }             // ball-steps/s
  double per_pair() const { return seconds / contact_evaluations; }  // s
};

std::vector<std::string> kernel_names() {
  std::vector<std::string> names;
  for (const core::Kernels* set : core::runnable_kernels()) names.emplace_back(set->name);
  return names;
}

/// The set of this name, which is one of kernel_names().
const core::Kernels* kernel_set(const std::string& name) {
  const auto sets = core::runnable_kernels();
  return *std::find_if(sets.begin(), sets.end(), [&](const core::Kernels* set) { return set->name == name; });
}

void add_options(CLI::App& app, Options& o) {
  app.add_option("STATE", o.state, "State of balls, .h5 or .csv")->required();
  app.add_option("--step", o.step, "Step [s]")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--threads", o.threads, "Threads")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--steps", o.steps, "Steps per repeat")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--repeats", o.repeats, "Repeats")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--kernels", o.kernels, "Instruction set of the hot loops")
      ->check(CLI::IsMember(kernel_names()))
      ->capture_default_str();
  app.add_flag("--open", o.open, "Leave the outlet's plug out; what passes it goes on falling");
  app.add_flag("--events", o.events, "Correct steps in which a contact changes branch");
}

std::unique_ptr<core::Stepper> make_stepper(const Options& o) {
  core::StepperSetup setup;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = o.events;
  setup.stepping.step = o.step;
  setup.outlet_open = o.open;
  setup.threads = o.threads;
  setup.kernels = kernel_set(o.kernels);
  return core::make_uniform_stepper(core::read_state(o.state), setup);
}

Measured measure(core::Stepper& stepper, std::int64_t steps) {
  const core::Costs before = stepper.costs();
  const auto begin = std::chrono::steady_clock::now();
  stepper.advance(steps);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  const core::Costs after = stepper.costs();
  return {static_cast<double>(after.ball_updates - before.ball_updates),
          static_cast<double>(after.contact_evaluations - before.contact_evaluations), elapsed.count()};
}

void run(const Options& o) {
  const auto stepper = make_stepper(o);
  stepper->advance(kWarmUp);
  std::vector<Measured> repeats;
  for (int k = 0; k < o.repeats; ++k) {
    repeats.push_back(measure(*stepper, o.steps));
    fmt::print("{:.1f} million ball-steps/s\n", 1e-6 * repeats.back().rate());
    std::fflush(stdout);
  }
  const auto middle = repeats.begin() + (o.repeats - 1) / 2;
  std::nth_element(repeats.begin(), middle, repeats.end(),
                   [](const Measured& a, const Measured& b) { return a.rate() < b.rate(); });
  fmt::print(
      "median {:.1f} million ball-steps/s, {:.2f} ns per listed pair, {:.2f} listed pairs per ball; {} kernels, {} "
      "thread{}\n",
      1e-6 * middle->rate(), 1e9 * middle->per_pair(), middle->contact_evaluations / middle->ball_updates, o.kernels,
      o.threads, o.threads == 1 ? "" : "s");
}

}  // namespace

int main(int count, char** arguments) {
  Options options;
  CLI::App app("Ball-steps per second of the uniform stepper. SI units.", "uniform_speed");
  add_options(app, options);
  try {
    app.parse(count, arguments);
    run(options);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(core::ExitCode::bad_input);
  } catch (const core::Error& error) {
    fmt::print(stderr, "uniform_speed: {}\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
