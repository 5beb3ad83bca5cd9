# Loops that are compiled once per instruction set; the sets are chosen between at run time (core/kernel_choice.cpp).
set(kernel_sets portable)
set(flags_portable "")
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  list(APPEND kernel_sets avx2 avx512)
  set(flags_avx2 -march=x86-64-v3)
  set(flags_avx512 -march=x86-64-v4 -mprefer-vector-width=512)
endif()

set(GRAINCLOCK_KERNEL_FLAGS -O3 CACHE STRING "Optimisation of the hot loops, in every type of build")

# Adds `file`, compiled for every set, to the library of `folder`.
function(grainclock_kernels folder file)
  if(GRAINCLOCK_FUZZ)  # no input comes here, and clang takes minutes to watch over vectors
    set_source_files_properties(${PROJECT_SOURCE_DIR}/${folder}/${file} PROPERTIES COMPILE_OPTIONS "-O0;-fno-sanitize=all")
  endif()
  if("avx2" IN_LIST kernel_sets)
    target_compile_definitions(grainclock_${folder} PRIVATE GRAINCLOCK_X86)
  endif()
  foreach(set ${kernel_sets})
    set(object grainclock_${folder}_kernels_${set})
    add_library(${object} OBJECT ${PROJECT_SOURCE_DIR}/${folder}/${file})
    target_link_libraries(${object} PRIVATE grainclock_flags)
    target_compile_definitions(${object} PRIVATE GRAINCLOCK_KERNEL_SET=${set})
    # Where forces are beyond all bounds sums may wrap: that is seen (SweepTotals::overloaded), and the step fails.
    target_compile_options(${object} PRIVATE ${GRAINCLOCK_KERNEL_FLAGS} -fwrapv ${flags_${set}} -Wno-psabi)
    target_sources(grainclock_${folder} PRIVATE $<TARGET_OBJECTS:${object}>)
  endforeach()
endfunction()
grainclock_kernels(core kernels.cpp)
grainclock_kernels(multirate need_kernels.cpp)
