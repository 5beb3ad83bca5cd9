// What the machine allows at best: counts of operations and bytes from the code, and the processor's rates.
#pragma once

#include <cstddef>

namespace grainclock::scale {

/// Work of one ball-step of the uniform stepper (predicted, no events): so much per ball and so much per listed pair.
struct Counts {
  double operations_per_ball = 0.0;   // floating or 64-bit integer operations of one lane
  double operations_per_pair = 0.0;
  double bytes_per_ball = 0.0;        // read or written, each array once a step
  double bytes_per_pair = 0.0;
};
Counts uniform_counts();

/// Operations per second that `threads` threads reach together with vectors as wide as the sweeps' here: multiplications and
/// additions of doubles in equal parts, not fused, all in registers. Roots and divisions are many times slower.
double operation_rate(int threads);

}  // namespace grainclock::scale
