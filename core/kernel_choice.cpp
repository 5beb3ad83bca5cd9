#include "core/kernels.hpp"

namespace grainclock::core {

extern const Kernels kernels_portable;
#if defined(GRAINCLOCK_X86)
extern const Kernels kernels_avx2;
extern const Kernels kernels_avx512;
#endif

std::vector<const Kernels*> runnable_kernels() {
  std::vector<const Kernels*> sets{&kernels_portable};
#if defined(GRAINCLOCK_X86)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")) {
    sets.push_back(&kernels_avx2);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd")) {
      sets.push_back(&kernels_avx512);
    }
  }
#endif
  return sets;
}

const Kernels& kernels() {
  static const Kernels& best = *runnable_kernels().back();
  return best;
}

SweepTotals& SweepTotals::operator+=(const SweepTotals& other) {
  for (int k = 0; k < 3; ++k) force[k] += other.force[k];
  magnitude += other.magnitude;
  power += other.power;
  turned += other.turned;
  overloaded = overloaded || other.overloaded;
  return *this;
}

}  // namespace grainclock::core
