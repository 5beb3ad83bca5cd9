// The quantities that a run records with every frame.
#pragma once

#include "core/stepper.hpp"
#include "silo/measures.hpp"
#include "silo/run_file.hpp"

#include <optional>
#include <vector>

namespace grainclock::silo {

/// Twenty layers over the height of the wall balls; nothing without a wall of some height.
std::optional<Layers> layers_of(const core::State& state);
/// Edges of the layers [m], one more than there are layers.
std::vector<double> edges(const Layers& layers);

/// Energies, ledger, residuals, costs and wall forces of the moment. `start`: energies when the run began.
std::vector<Observable> observe(const core::Stepper& stepper, const core::State& state, const core::Energies& start,
                                const std::optional<Layers>& layers);

}  // namespace grainclock::silo
