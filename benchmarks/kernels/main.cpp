// Google Benchmark over the hot loops: `kernel_benchmarks [--state FILE] [--open] [--benchmark_...]`.
#include "benchmarks/kernels/subjects.hpp"
#include "core/check.hpp"

#include <benchmark/benchmark.h>
#include <CLI/CLI.hpp>

using namespace grainclock;

namespace {

constexpr const char* kUsage =
    "kernel_benchmarks [--state FILE] [--open] [--benchmark_...]\n"
    "  --state FILE   balls, .h5 or .csv; without it a random packing of 20,000\n"
    "  --open         leave the outlet's plug out\n";

void help() {
  fmt::print("{}", kUsage);
  benchmark::PrintDefaultHelp();
}

}  // namespace

int main(int count, char** arguments) {
  benchmark::Initialize(&count, arguments, help);
  std::string path;
  bool open = false;
  CLI::App app("Google Benchmark over the hot loops.", "kernel_benchmarks");
  app.add_option("--state", path, "Balls, .h5 or .csv; without it a random packing of 20,000");
  app.add_flag("--open", open, "Leave the outlet's plug out");
  try {
    app.parse(count, arguments);
    const kernel_benchmarks::Start start = kernel_benchmarks::load(path, open);
    benchmark::AddCustomContext("state", path.empty() ? "random packing" : path);
    benchmark::AddCustomContext("balls", fmt::to_string(start.state.count(core::Kind::content)));
    kernel_benchmarks::add_contacts(start);
    kernel_benchmarks::add_balls(start);
    kernel_benchmarks::add_neighbours(start);
    kernel_benchmarks::add_classes(start);
    benchmark::RunSpecifiedBenchmarks();
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(core::ExitCode::bad_input);
  } catch (const core::Error& error) {
    fmt::print(stderr, "kernel_benchmarks: {}\n", error.what());
    return static_cast<int>(error.code());
  }
  return 0;
}
