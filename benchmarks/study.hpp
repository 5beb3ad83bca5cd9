// The accuracy-versus-speed matrix: a fine reference, methods, errors and costs.
#pragma once

#include <string>

namespace grainclock::benchmarks {

/// Runs the study of this TOML file and writes study.csv and study.h5 into `out_dir`, which must be empty
/// or not there. A point whose numerics fail is a row with its status, not the end of the study.
/// Throws InputError (content, key combinations), FileError (files), NumericsError (the reference failed).
void run_study(const std::string& study_path, const std::string& out_dir, int threads);

}  // namespace grainclock::benchmarks
