// How much memory the process has in use: what the system counts, not what was asked for.
#pragma once

#include <cstddef>

namespace grainclock::scale {

/// Bytes resident now, and at most since the start or the last forget_peak(). Linux; throws FileError elsewhere.
std::size_t resident_now();
std::size_t resident_peak();

/// Gives freed memory back to the system and lets the peak start anew from what is in use.
/// Throws FileError where the system does not offer it.
void forget_peak();

}  // namespace grainclock::scale
