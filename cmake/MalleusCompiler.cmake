# Compiler settings shared by every target, as the interface target malleus_settings.

find_program(MALLEUS_CCACHE ccache)
if(MALLEUS_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${MALLEUS_CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${MALLEUS_CCACHE})
endif()

set(CMAKE_CXX_FLAGS_RELEASE "-O3")
set(CMAKE_CXX_FLAGS_DEVELOPER "-O2 -g -D_GLIBCXX_ASSERTIONS" CACHE STRING "" FORCE)
set(CMAKE_CXX_FLAGS_SANITIZE
    "-O1 -g1 -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=undefined -D_GLIBCXX_ASSERTIONS"
    CACHE STRING "" FORCE)
set(CMAKE_EXE_LINKER_FLAGS_SANITIZE "-fsanitize=address,undefined" CACHE STRING "" FORCE)
set(CMAKE_CXX_FLAGS_FUZZ
    "-O1 -g1 -fno-omit-frame-pointer -fsanitize=address,undefined,fuzzer-no-link -fno-sanitize-recover=undefined"
    CACHE STRING "" FORCE)
set(CMAKE_EXE_LINKER_FLAGS_FUZZ "-fsanitize=address,undefined" CACHE STRING "" FORCE)

add_library(malleus_settings INTERFACE)
# No contraction of a*b+c: the same source gives the same bits in every function, and the filtered
# predicates of the remesher rely on correctly rounded single operations.
target_compile_options(malleus_settings INTERFACE
  -Wall -Wextra -Wshadow -Wpedantic -Werror -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # False alarms of GCC 12: in optimised standard algorithms, in its own AVX-512 intrinsics (GCC bug 105593),
  # and on "text" + string (GCC bug 105651).
  target_compile_options(malleus_settings INTERFACE
    -Wno-array-bounds -Wno-stringop-overflow -Wno-maybe-uninitialized -Wno-restrict)
else()
  target_compile_options(malleus_settings INTERFACE -Wno-error)  # the tree is kept free of GCC's warnings
endif()
if(MALLEUS_NATIVE)
  target_compile_options(malleus_settings INTERFACE -march=native)
endif()
target_compile_definitions(malleus_settings INTERFACE OMPI_SKIP_MPICXX MPICH_SKIP_MPICXX
  MALLEUS_VERSION="${PROJECT_VERSION}")
