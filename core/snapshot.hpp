// States in files: HDF5 for an exact restart, CSV for exchange.
#pragma once

#include "core/hdf5.hpp"
#include "core/state.hpp"

#include <cstdint>
#include <string>
#include <string_view>

namespace grainclock::core {

/// Reads a state from .csv or .h5, by the extension. Throws InputError for an unknown extension or bad content
/// (CSV: file:line:column, the value and what would be right), FileError for a missing, unreadable or damaged file.
State read_state(const std::string& path);
/// Reads a CSV state, whatever the file is called.
State read_csv(const std::string& path);
/// Writes a state to .csv or .h5, by the extension, aside and renamed. Throws FileError, or InputError for the extension.
void write_state(const std::string& path, const State& state);

/// The same within an HDF5 file that holds more, such as a checkpoint.
State read_state(const Hdf5Group& group);
void write_state(Hdf5Group& group, const State& state);
/// Whether the group holds a state.
bool has_state(const Hdf5Group& group);

/// 64-bit FNV-1a sum over every field, in the order of the file: equal states have equal sums, bit for bit.
std::uint64_t checksum(const State& state);
/// The same of a text.
std::uint64_t checksum(std::string_view text);

}  // namespace grainclock::core
