// The table of a study: one row per point, one list of columns for study.csv and study.h5.
#pragma once

#include "core/scene.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace grainclock::benchmarks {

/// What is known about one point; what is not stays empty.
struct Row {
  using Number = std::optional<double>;

  std::string name, method, method_used, integrator, events, dashpot, interface;
  Number step, tolerance, levels;
  Number error_rms, error_median, error_p99, error_wall_force, momentum_residual, energy_residual;
  Number contact_evaluations, ball_updates, wall_s;
  Number ideal_gain, counted_gain, measured_gain;                // against the plain uniform scheme
  Number gain_events_counted, gain_events_measured;              // against the uniform scheme with events
  Number sweeps, missed_contacts, events_count, missing_balls, velocity_error_rms, rtol;
  std::string start, status;
};

struct Column {
  std::string_view name;
  std::string_view unit;  // empty: a pure number or a text
  std::variant<std::string Row::*, Row::Number Row::*> field;
};

/// Every column, in the order of the file.
const std::vector<Column>& columns();

/// The table as CSV (RFC 4180) with a header line; numbers to the last bit, unknown ones empty.
std::string csv(const std::vector<Row>& rows);

/// The table as HDF5, written aside and renamed: /study/NAME one dataset per column with its unit, unknown
/// numbers NaN; /provenance with the study's and the scene's text. Throws FileError.
void write_table(const std::filesystem::path& path, const std::vector<Row>& rows, const std::string& study_text,
                 const core::Scene& scene, int threads);

}  // namespace grainclock::benchmarks
