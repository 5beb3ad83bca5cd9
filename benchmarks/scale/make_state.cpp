// Makes a larger filled silo out of the original: `scale_state SOURCE.h5 FACTOR BALLS OUTPUT.h5`.
#include "benchmarks/scale/scaled_silo.hpp"
#include "benchmarks/scale/settle.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdio>
#include <string>

using namespace grainclock;

namespace {

constexpr double kGravity = 9.81;  // m/s2
constexpr int kRounds = 400;        // of pushing apart
constexpr std::uint64_t kSeed = 1; // of the wall's radii

struct Options {
  std::string source, output;
  double factor = 1.0;
  std::int64_t balls = 0;
  int threads = 1;
};

void make(const Options& options) {
  const auto began = std::chrono::steady_clock::now();
  const auto say = [&](const std::string& text) {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - began;
    fmt::print("{:6.1f} s  {}\n", elapsed.count(), text);
    std::fflush(stdout);
  };
  const core::Materials materials;  // Table 1
  const core::State source = core::read_state(options.source);
  say(fmt::format("{}: {}", options.source, describe(scale::load_of(source, materials, kGravity, options.threads))));
  const silo::SiloShape shape;      // Table 1
  core::State state = scale::tile(scale::interior(source, shape), shape, options.factor, options.balls, materials, kGravity, kSeed);
  say(fmt::format("laid out {} balls and {} of wall and plug", options.balls, state.size() - static_cast<std::size_t>(options.balls)));
  scale::push_apart(state, materials, kGravity, kRounds, options.threads);
  say("pushed apart: " + describe(scale::load_of(state, materials, kGravity, options.threads)));
  state = scale::settle(state, materials, kGravity, options.threads);
  say("settled: " + describe(scale::load_of(state, materials, kGravity, options.threads)));
  core::write_state(options.output, state);
  say("wrote " + options.output);
}

}  // namespace

int main(int count, char** arguments) try {
  Options options;
  CLI::App app("Makes a larger filled silo out of the filled silo of Table 1.", "scale_state");
  app.add_option("SOURCE", options.source, "filled silo of Table 1, at rest")->required();
  app.add_option("FACTOR", options.factor, "how many times as wide and high")->required()->check(CLI::Range(1.0, 10.0));
  app.add_option("BALLS", options.balls, "content of the larger silo")->required()->check(CLI::PositiveNumber);
  app.add_option("OUTPUT", options.output, "state to write")->required();
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024))->capture_default_str();
  CLI11_PARSE(app, count, arguments);
  make(options);
  return 0;
} catch (const core::Error& error) {
  fmt::print(stderr, "scale_state: {}\n", error.what());
  return static_cast<int>(error.code());
}
