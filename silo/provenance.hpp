// What a result was made with, for its file.
#pragma once

#include "core/hdf5.hpp"

#include <string>
#include <utility>
#include <vector>

namespace grainclock::silo {

/// Version of the program, as in "0.1.0".
std::string version();
/// Name and value of everything about program and machine: version, git_revision, compiler, flags,
/// kernels (the instruction set chosen), host, libraries.
std::vector<std::pair<std::string, std::string>> provenance();
/// Writes them to the new group /provenance, with threads, seed and the resolved scene (or study) as TOML text.
void write_provenance(core::Hdf5Group& file, int threads, std::uint64_t seed, const std::string& scene_text);

}  // namespace grainclock::silo
