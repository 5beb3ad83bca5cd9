#include "multirate/needs.hpp"

#include <string_view>

namespace grainclock::multirate {

extern const AddNeeds add_needs_portable;
#if defined(GRAINCLOCK_X86)
extern const AddNeeds add_needs_avx2, add_needs_avx512;
#endif

AddNeeds add_needs_on([[maybe_unused]] const core::Kernels& kernels) {
#if defined(GRAINCLOCK_X86)
  if (std::string_view(kernels.name) == "avx512") return add_needs_avx512;
  if (std::string_view(kernels.name) == "avx2") return add_needs_avx2;
#endif
  return add_needs_portable;
}

}  // namespace grainclock::multirate
