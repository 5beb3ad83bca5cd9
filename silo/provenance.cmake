# Tells the program what it was built from: version, git revision, compiler and flags.
#
# Included by CMakeLists.txt it adds a target that runs this same file as a script at
# every build, so that the revision is that of the build and not of the last configure.
# The header is rewritten only if it changed. Without git the revision is "unknown".
if(CMAKE_SCRIPT_MODE_FILE)
  set(revision "unknown")
  execute_process(COMMAND git -C ${source} rev-parse --show-toplevel
    OUTPUT_VARIABLE top OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
  if(NOT failed)
    # A tarball unpacked inside another repository must not take that one's revision.
    file(REAL_PATH ${source} here)
    file(REAL_PATH ${top} top)
    if(here STREQUAL top)
      execute_process(COMMAND git -C ${source} describe --always --dirty --abbrev=40 "--exclude=*"
        OUTPUT_VARIABLE described OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
      if(NOT failed)
        set(revision ${described})
      endif()
    endif()
  endif()
  configure_file(${source}/silo/provenance.hpp.in ${header} @ONLY)
  return()
endif()

set(provenance_dir ${CMAKE_BINARY_DIR}/generated)
set(provenance_header ${provenance_dir}/grainclock_provenance.hpp)
get_target_property(provenance_options grainclock_flags INTERFACE_COMPILE_OPTIONS)
list(FILTER provenance_options INCLUDE REGEX "^-[fm]")
string(TOUPPER "${CMAKE_BUILD_TYPE}" provenance_type)
string(JOIN " " provenance_flags ${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${provenance_type}} ${provenance_options})
string(REPLACE "\"" "\\\"" provenance_flags "${provenance_flags}")

add_custom_target(grainclock_provenance
  COMMAND ${CMAKE_COMMAND} -D "source=${PROJECT_SOURCE_DIR}" -D "header=${provenance_header}"
    -D "version=${PROJECT_VERSION}" -D "compiler=${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}"
    -D "flags=${provenance_flags}" -P ${CMAKE_CURRENT_LIST_FILE}
  BYPRODUCTS ${provenance_header}
  COMMENT "Noting version, git revision, compiler and flags"
  VERBATIM)
add_dependencies(grainclock_silo grainclock_provenance)
target_include_directories(grainclock_silo PRIVATE ${provenance_dir})
