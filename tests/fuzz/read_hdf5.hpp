// Everything of ours that reads an HDF5 file, one after the other.
#pragma once

#include "benchmarks/trajectories_run.hpp"
#include "core/snapshot.hpp"
#include "silo/checkpoint.hpp"
#include "silo/info.hpp"
#include "silo/run_file.hpp"
#include "tests/fuzz/fuzz.hpp"

/// The library leaks on damaged files (12 free lists of 424 bytes each, say); what we leak ourselves still shows.
extern "C" const char* __lsan_default_suppressions() { return "leak:libhdf5"; }
/// It asks for 2^63 bytes where a damaged length says so, and copes with getting none.
extern "C" const char* __asan_default_options() { return "allocator_may_return_null=1"; }

namespace grainclock::fuzz {

/// The last frame and its observables, as `export` and `measure` read them.
inline void read_run(const std::string& path) {
  const silo::RunReader run(path);
  if (run.frames() == 0) return;
  const std::int64_t last = run.frame_at(run.times().back());
  validate(run.state(last), "accepted");
  run.step(last);
  for (const std::string& name : run.observables()) run.observable(name, last);
  run.scene();
}

inline void read_hdf5(const std::string& path) {
  expect_answer([&] { validate(core::read_state(path), "accepted"); });
  expect_answer([&] { validate(silo::read_checkpoint(path).state, "accepted"); });
  expect_answer([&] { read_run(path); });
  expect_answer([&] { silo::file_info(path).json(); });
  expect_answer([&] { benchmarks::read_outcome(path); });
}

}  // namespace grainclock::fuzz
