// The first phase of a scene from a start state of a study, with stepping that the study chooses.
#pragma once

#include "benchmarks/study_plan.hpp"
#include "core/stepper.hpp"
#include "silo/measures.hpp"

#include <optional>
#include <string>
#include <string_view>

namespace grainclock::benchmarks {

struct StartState {
  std::string name;                    // stem of its file
  core::State state;                   // nothing is left of how it was stepped
  std::optional<silo::Layers> layers;  // of the wall, for its force; nothing without a wall
};

/// Reads a start state. Throws InputError, FileError.
StartState read_start(const std::string& path);

/// Mean diameter of the content [m]; 0 without content.
double mean_diameter(const core::State& state);

/// The setup of the scene's first phase with this stepping; the step is a whole fraction of `every` [s].
/// Throws InputError for what phase_setup() refuses.
core::StepperSetup first_phase_setup(const core::Scene& scene, const core::State& state, const core::Stepping& stepping,
                                     double every, int threads);

/// Throws InputError where no stepper offers the point's keys together; at once, whatever the size of the state.
void require_offered(const core::Scene& scene, const StartState& start, const Point& point, double every, int threads);

/// "multirate", or "uniform" also where multi-rate stepping has one level only.
std::string_view method_used(const core::Stepping& stepping, const core::LevelStatistics& levels);

}  // namespace grainclock::benchmarks
