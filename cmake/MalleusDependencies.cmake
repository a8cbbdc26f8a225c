# Libraries of the distribution, gathered in the interface target malleus_dependencies.

find_package(MPI REQUIRED COMPONENTS C CXX)
find_package(PkgConfig REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(CLI11 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(ZLIB REQUIRED)
pkg_check_modules(PETSC REQUIRED IMPORTED_TARGET PETSc)
pkg_check_modules(MUPARSER REQUIRED IMPORTED_TARGET muparser)
set(HDF5_PREFER_PARALLEL ON)
find_package(HDF5 REQUIRED COMPONENTS C)
if(NOT HDF5_IS_PARALLEL)
  message(FATAL_ERROR "HDF5 without MPI was found; install libhdf5-openmpi-dev")
endif()

add_library(malleus_dependencies INTERFACE)
target_include_directories(malleus_dependencies SYSTEM INTERFACE
  ${MPI_CXX_INCLUDE_DIRS} ${HDF5_C_INCLUDE_DIRS} ${PETSC_INCLUDE_DIRS} ${MUPARSER_INCLUDE_DIRS}
  ${EIGEN3_INCLUDE_DIRS})
target_link_libraries(malleus_dependencies INTERFACE
  MPI::MPI_CXX Eigen3::Eigen CLI11::CLI11 fmt::fmt nlohmann_json::nlohmann_json ZLIB::ZLIB
  PkgConfig::PETSC PkgConfig::MUPARSER ${HDF5_C_LIBRARIES})

# PT-Scotch (libptscotch-dev) is optional: without it [partition] method = scotch is refused.
find_path(PTSCOTCH_INCLUDE ptscotch.h PATH_SUFFIXES scotch)
find_library(PTSCOTCH_LIBRARY ptscotch)
find_library(SCOTCH_LIBRARY scotch)
find_library(PTSCOTCH_ERROR_LIBRARY ptscotcherr)
if(PTSCOTCH_INCLUDE AND PTSCOTCH_LIBRARY AND SCOTCH_LIBRARY AND PTSCOTCH_ERROR_LIBRARY)
  set(MALLEUS_PTSCOTCH_FOUND TRUE)
  add_library(ptscotch INTERFACE)
  target_include_directories(ptscotch SYSTEM INTERFACE ${PTSCOTCH_INCLUDE})
  target_link_libraries(ptscotch INTERFACE ${PTSCOTCH_LIBRARY} ${SCOTCH_LIBRARY} ${PTSCOTCH_ERROR_LIBRARY})
else()
  message(STATUS "PT-Scotch was not found (libptscotch-dev): built without it")
endif()
