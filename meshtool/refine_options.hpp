#pragma once

/// What `meshtool refine` was asked for.

#include <string>

#include "base/types.hpp"

namespace malleus::meshtool {

struct RefineOptions {
  std::string input;
  std::string output;
  Real size = 0;         ///< m; 0: not given, as with the others
  int uniform = 0;       ///< how often every edge is halved
  std::string metric;    ///< a .sol or .solb file
  GlobalId nodes = 0;    ///< target count
  std::string error_of;  ///< a node field of the input
  bool anisotropic = false;
  Real min_size = 0;
  Real max_size = 0;
  Real gradation = 1.3;  ///< 1: sizes may jump
  Real hausdorff = 0;    ///< m
  bool keep_surface = false;
  bool keep_volume = false;
  std::string report;  ///< a .json file
  Real length_unit = 1;
  std::string msh_version = "4.1";
  bool ascii = false;
};

}  // namespace malleus::meshtool
