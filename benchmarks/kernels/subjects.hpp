// The subjects of kernel_benchmarks, one source file each. `start` outlives the runs.
// Names are subject/variant/instruction set, or subject/variant where there is no such choice.
#pragma once

#include "benchmarks/kernels/scene.hpp"

namespace grainclock::kernel_benchmarks {

void add_contacts(const Start& start);    // evaluation of pairs
void add_balls(const Start& start);       // motion of balls
void add_neighbours(const Start& start);  // pair lists
void add_classes(const Start& start);     // what selective steps cost beyond contacts and motion

}  // namespace grainclock::kernel_benchmarks
