#include "core/kernels.hpp"

#include "core/check.hpp"

#include <cstdlib>
#include <string_view>

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

namespace {

const Kernels& chosen_kernels() {
  const auto runnable = runnable_kernels();
  const char* const wanted = std::getenv("GRAINCLOCK_KERNELS");
  if (!wanted || !*wanted) return *runnable.back();
  std::string names;
  for (const Kernels* set : runnable) {
    if (std::string_view(set->name) == wanted) return *set;
    names += fmt::format("{}{}", names.empty() ? "" : ", ", set->name);
  }
  throw InputError(fmt::format("GRAINCLOCK_KERNELS={}: this processor runs {}; unset the variable for the best of them", wanted, names));
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& chosen = chosen_kernels();
  return chosen;
}

SweepTotals& SweepTotals::operator+=(const SweepTotals& other) {
  // Sums may wrap where forces are beyond all bounds, as in kernels.cpp: `overloaded` tells, and the step fails.
  const auto add = [](std::int64_t& to, std::int64_t value) {
    to = static_cast<std::int64_t>(static_cast<std::uint64_t>(to) + static_cast<std::uint64_t>(value));
  };
  for (int k = 0; k < 3; ++k) add(force[k], other.force[k]);
  add(magnitude, other.magnitude);
  add(power, other.power);
  add(turned, other.turned);
  overloaded = overloaded || other.overloaded;
  return *this;
}

}  // namespace grainclock::core
