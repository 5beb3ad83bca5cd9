// What is in one of our HDF5 files.
#pragma once

#include "silo/report.hpp"

#include <string>

namespace grainclock::silo {

/// A run (file or directory), a state, a checkpoint, or any other HDF5 file with a /provenance. Throws FileError.
Report file_info(const std::string& path);

}  // namespace grainclock::silo
