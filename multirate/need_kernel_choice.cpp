#include "multirate/needs.hpp"

#include <string_view>

namespace grainclock::multirate {

extern const NeedKernels need_kernels_portable;
#if defined(GRAINCLOCK_X86)
extern const NeedKernels need_kernels_avx2, need_kernels_avx512;
#endif

const NeedKernels& need_kernels_on([[maybe_unused]] const core::Kernels& kernels) {
#if defined(GRAINCLOCK_X86)
  if (std::string_view(kernels.name) == "avx512") return need_kernels_avx512;
  if (std::string_view(kernels.name) == "avx2") return need_kernels_avx2;
#endif
  return need_kernels_portable;
}

}  // namespace grainclock::multirate
