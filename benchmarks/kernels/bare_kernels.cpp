// The program's own loops with a contact law that has no terms to switch: what a loop costs that never heard of clamp
// and cohesion. Compiled once per instruction set, as core/kernels.cpp is. The name of the real law is taken away
// from that file, so that it finds the one below.
#define contact_force contact_force_with_terms
#include "core/contact_law.hpp"
#undef contact_force

namespace grainclock::core {
namespace {

/// Spring and dashpot while balls overlap [N].
template <class T, class Real>
[[gnu::always_inline]] inline Real contact_force(Real overlap, Real rate, double k, double c, double) {
  const Real zero = overlap - overlap;
  return overlap > zero ? k * overlap + c * rate : zero;
}

}  // namespace
}  // namespace grainclock::core

#include "core/kernels.cpp"
