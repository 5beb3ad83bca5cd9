// Speed and memory of a stepper on states of many sizes, as CSV on standard output.
//
//   scale_measure memory STATE --method M         what a stepper needs, and how long it takes to be there
//   scale_measure speed STATE... --method M       timings, the states and thread counts taken in turn
//   scale_measure load STATE...                    what makes the states the same load
//   scale_measure limits                          counts of operations and bytes, rates of the processor
#include "benchmarks/scale/limits.hpp"
#include "benchmarks/scale/resident.hpp"
#include "benchmarks/scale/settle.hpp"
#include "core/check.hpp"
#include "core/neighbours.hpp"
#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

using namespace grainclock;

namespace {

constexpr double kGravity = 9.81;         // m/s2
constexpr double kUniformStep = 8e-5;     // s, of the filled silo's scene
constexpr std::int64_t kMultirateSteps = 6;  // at least so many coarse steps at a time: from one renewal of classes to the next
// Work of one timing: enough for half a second, small enough for five rounds over all sizes.
constexpr double kUniformWork = 40e6, kMultirateWork = 3e6;  // balls times steps

struct Options {
  std::vector<std::string> states;
  std::vector<int> threads{1};
  std::string method = "uniform";
  int repeats = 5;
  bool is_uniform() const { return method == "uniform"; }
};

class Clock {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

std::unique_ptr<core::Stepper> make_stepper(const core::State& state, const Options& options, int threads) {
  core::StepperSetup setup;  // Table 1, the outlet closed
  setup.threads = threads;
  setup.stepping.method = options.is_uniform() ? core::Method::uniform : core::Method::multirate;
  setup.stepping.events = !options.is_uniform();  // plain uniform steps: what the speed of the core is quoted for
  setup.stepping.step = options.is_uniform() ? kUniformStep : multirate::default_step(state, setup);
  return multirate::make_stepper(state, setup);
}

std::int64_t steps_for(std::size_t balls, const Options& options) {
  const double work = options.is_uniform() ? kUniformWork : kMultirateWork;
  const auto steps = static_cast<std::int64_t>(work / static_cast<double>(balls));
  return std::max<std::int64_t>(options.is_uniform() ? 10 : kMultirateSteps, steps);
}

/// Seconds to list all pairs anew, on balls in the order of the file and on balls sorted by the first list.
struct ListTimes {
  double first, again;
};
ListTimes time_list(const core::State& state, int threads) {
  core::Balls balls(state, core::Materials{}, true);
  core::NeighbourList list(0.0, core::SkinRule::for_diameter(balls.mean_diameter), threads);
  ListTimes times{};
  for (double* seconds : {&times.first, &times.again}) {
    const Clock clock;
    list.build(balls);
    *seconds = clock.seconds();
  }
  return times;
}

void measure_memory(const Options& options) {
  const int threads = options.threads.front();
  const std::size_t empty = scale::resident_now();
  const Clock reading;
  auto state = std::make_unique<core::State>(core::read_state(options.states.front()));
  const double read_s = reading.seconds();
  const std::size_t balls = state->count(core::Kind::content), fixed = state->size() - balls;
  const std::size_t peak_reading = scale::resident_peak();
  scale::forget_peak();
  const std::size_t with_state = scale::resident_now();

  const Clock making;
  const auto stepper = make_stepper(*state, options, threads);
  const double make_s = making.seconds();
  stepper->advance(1);
  const std::size_t peak_making = scale::resident_peak();
  state.reset();
  scale::forget_peak();
  const std::size_t held = scale::resident_now();
  stepper->advance(kMultirateSteps);
  const std::size_t peak_stepping = scale::resident_peak();

  const auto per_ball = [&](std::size_t bytes, std::size_t less) {
    return static_cast<double>(bytes - std::min(bytes, less)) / static_cast<double>(balls);
  };
  const ListTimes list = time_list(core::read_state(options.states.front()), threads);
  fmt::print("balls,fixed,method,threads,read_s,make_s,list_s,list_again_s,state_bytes,reading_bytes,making_bytes,held_bytes,"
             "stepping_bytes,process_bytes\n");
  fmt::print("{},{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.1f},{:.1f},{:.1f},{:.1f},{:.1f},{:.1f}\n", balls, fixed, options.method,
             threads, read_s, make_s, list.first, list.again, per_ball(with_state, empty), per_ball(peak_reading, empty),
             per_ball(peak_making, with_state), per_ball(held, empty), per_ball(peak_stepping, empty),
             per_ball(std::max({peak_reading, peak_making, peak_stepping}), empty));
}

/// A stepper under measurement.
struct Subject {
  std::size_t balls;
  int threads;
  std::unique_ptr<core::Stepper> stepper;
};

void time_once(Subject& subject, const Options& options, int repeat) {
  const std::int64_t steps = steps_for(subject.balls, options);
  subject.stepper->advance(std::max<std::int64_t>(2, steps / 10));  // caches hold another's data
  const core::Costs before = subject.stepper->costs();
  const Clock clock;
  subject.stepper->advance(steps);
  const double seconds = clock.seconds();
  const core::Costs after = subject.stepper->costs();
  fmt::print("{},{},{},{},{},{:.6g},{:.6f},{},{},{},{:.0f}\n", repeat, subject.balls, options.method, subject.threads, steps,
             subject.stepper->step(), seconds, after.ball_updates - before.ball_updates,
             after.contact_evaluations - before.contact_evaluations, after.list_builds - before.list_builds,
             subject.stepper->level_statistics().listed);
  std::fflush(stdout);
}

void measure_speed(const Options& options) {
  std::vector<Subject> subjects;
  for (const std::string& path : options.states) {
    const core::State state = core::read_state(path);
    for (const int threads : options.threads)
      subjects.push_back({state.count(core::Kind::content), threads, make_stepper(state, options, threads)});
  }
  fmt::print("repeat,balls,method,threads,steps,step,seconds,ball_updates,contact_evaluations,list_builds,listed\n");
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    for (Subject& subject : subjects) time_once(subject, options, repeat);
  }
}

void measure_load(const Options& options) {
  fmt::print("balls,contacts_per_ball,mean_overlap,kinetic_per_ball\n");
  for (const std::string& path : options.states) {
    const core::State state = core::read_state(path);
    const scale::Load load = scale::load_of(state, core::Materials{}, kGravity, 1);
    fmt::print("{},{:.4f},{:.4g},{:.4g}\n", state.count(core::Kind::content), load.contacts_per_ball, load.mean_overlap,
               load.kinetic_per_ball);
  }
}

void print_limits(const Options& options) {
  const scale::Counts counts = scale::uniform_counts();
  fmt::print("threads,operation_rate,operations_per_ball,operations_per_pair,bytes_per_ball,bytes_per_pair\n");
  for (const int threads : options.threads) {
    fmt::print("{},{:.4g},{},{},{},{}\n", threads, scale::operation_rate(threads), counts.operations_per_ball,
               counts.operations_per_pair, counts.bytes_per_ball, counts.bytes_per_pair);
  }
}

}  // namespace

int main(int count, char** arguments) try {
  Options options;
  CLI::App app("Speed and memory of steppers on large silos; CSV on standard output.", "scale_measure");
  app.require_subcommand(1);
  struct Task {
    const char *name, *text;
    void (*run)(const Options&);
    bool has_states;
  };
  const Task tasks[] = {{"memory", "bytes per ball and times to read and make, of one state", measure_memory, true},
                        {"speed", "timings, states and thread counts in turn", measure_speed, true},
                        {"load", "contacts, overlaps and kinetic energy per ball", measure_load, true},
                        {"limits", "counts per ball and pair, and rates of the processor", print_limits, false}};
  for (const Task& task : tasks) {
    CLI::App* sub = app.add_subcommand(task.name, task.text);
    if (task.has_states) sub->add_option("STATE", options.states, "state files (.h5)")->required()->check(CLI::ExistingFile);
    sub->add_option("--method", options.method)->check(CLI::IsMember({"uniform", "multirate"}))->capture_default_str();
    sub->add_option("--threads", options.threads, "one or more")->check(CLI::Range(1, 1024))->capture_default_str();
    sub->add_option("--repeats", options.repeats)->check(CLI::PositiveNumber)->capture_default_str();
    sub->callback([&task, &options] { task.run(options); });
  }
  CLI11_PARSE(app, count, arguments);
  return 0;
} catch (const core::Error& error) {
  fmt::print(stderr, "scale_measure: {}\n", error.what());
  return static_cast<int>(error.code());
}
