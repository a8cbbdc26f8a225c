# malleus_unit_test(NAME SOURCES a.cpp ... [LIBRARIES l ...] [RANKS 1 2 3 4]): one GoogleTest executable, run on each
# number of ranks. malleus_system_test(NAME SCRIPT a.py [LABELS l ...] [TIMEOUT s]): a Python test of the built executables.

set(MALLEUS_MPI_LAUNCH ${MPIEXEC_EXECUTABLE} --oversubscribe --allow-run-as-root --bind-to none)
set(MALLEUS_MPI_ENVIRONMENT
    "OMP_NUM_THREADS=1;OMPI_ALLOW_RUN_AS_ROOT=1;OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1;OMPI_MCA_rmaps_base_oversubscribe=1;OMPI_MCA_mpi_yield_when_idle=1")
set(MALLEUS_PRELOAD ${CMAKE_BINARY_DIR}/tests/libpatient_ranks.so)
set(MALLEUS_PATIENCE 1)  # times the time that a test may take
if(CMAKE_BUILD_TYPE STREQUAL Sanitize)
  set(MALLEUS_PATIENCE 10)
  # Leaks of Open MPI are told from ours by the name of their library, which must be there still at the end.
  string(APPEND MALLEUS_PRELOAD ":${CMAKE_BINARY_DIR}/tests/libkeep_libraries.so")
  list(APPEND MALLEUS_MPI_ENVIRONMENT
       "ASAN_OPTIONS=verify_asan_link_order=0"
       "LSAN_OPTIONS=suppressions=${CMAKE_SOURCE_DIR}/tests/support/leaks.supp:print_suppressions=0")
endif()
list(APPEND MALLEUS_MPI_ENVIRONMENT "LD_PRELOAD=${MALLEUS_PRELOAD}")

function(malleus_unit_test name)
  cmake_parse_arguments(arg "" "TIMEOUT" "SOURCES;LIBRARIES;RANKS" ${ARGN})
  if(NOT arg_RANKS)
    set(arg_RANKS 1 2 3 4)
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  math(EXPR timeout "${arg_TIMEOUT} * ${MALLEUS_PATIENCE}")
  add_executable(test_${name} ${arg_SOURCES})
  target_link_libraries(test_${name} PRIVATE test_main ${arg_LIBRARIES})
  target_compile_options(test_${name} PRIVATE $<$<CONFIG:Release>:-O1>)  # they call optimised code; compile them fast
  set_target_properties(test_${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  foreach(ranks ${arg_RANKS})
    add_test(NAME unit.${name}.${ranks}
             COMMAND ${MALLEUS_MPI_LAUNCH} -n ${ranks} $<TARGET_FILE:test_${name}>)
    set_tests_properties(unit.${name}.${ranks} PROPERTIES
      PROCESSORS ${ranks} TIMEOUT ${timeout} LABELS unit ENVIRONMENT "${MALLEUS_MPI_ENVIRONMENT}")
  endforeach()
endfunction()

function(malleus_system_test name)
  cmake_parse_arguments(arg "" "SCRIPT;TIMEOUT;PROCESSORS" "LABELS" ${ARGN})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 300)
  endif()
  math(EXPR timeout "${arg_TIMEOUT} * ${MALLEUS_PATIENCE}")
  if(NOT arg_PROCESSORS)
    set(arg_PROCESSORS 2)
  endif()
  add_test(NAME system.${name} COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/${arg_SCRIPT})
  set_tests_properties(system.${name} PROPERTIES
    PROCESSORS ${arg_PROCESSORS} TIMEOUT ${timeout} LABELS "system;${arg_LABELS}"
    ENVIRONMENT "${MALLEUS_MPI_ENVIRONMENT};MALLEUS_BIN=${CMAKE_BINARY_DIR}/bin;MALLEUS_SOURCE=${CMAKE_SOURCE_DIR};MALLEUS_PATIENCE=${MALLEUS_PATIENCE};PYTHONPATH=${CMAKE_SOURCE_DIR}/tests/support:${CMAKE_SOURCE_DIR}/scripts")
endfunction()
