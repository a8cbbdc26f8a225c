#pragma once

/// Small MSH files for tests, written without the code under test.

#include <array>
#include <map>
#include <string>
#include <vector>

#include "base/types.hpp"
#include "support/scratch_directory.hpp"

namespace malleus::test {

struct MshNode {
  GlobalId tag;
  std::array<Real, 3> point;
};

struct MshElement {
  GlobalId tag;
  int type;  ///< of MSH: 1 line, 2 triangle, 4 tetrahedron, 15 point
  int physical;
  std::vector<GlobalId> nodes;
};

struct MshMesh {
  std::map<std::pair<int, int>, std::string> names;
  std::vector<MshNode> nodes;
  std::vector<MshElement> elements;
};

struct MshFlavour {
  int version = 4;  ///< 2 or 4 for 2.2 or 4.1
  bool binary = false;
};
inline constexpr std::array<MshFlavour, 4> msh_flavours = {{{2, false}, {2, true}, {4, false}, {4, true}}};

/// The unit square (dim 2) or cube cut into n^dim cells, scaled by 1, 2, 3 along x, y, z. Regions "left part" (x < 0.5)
/// and "right" by elements; groups "bottom" (last axis = 0) and "top" (last axis at its end) and a physical group 9
/// without a name (x = 0); node tags are sparse and unordered; every third element is inverted; the first element of
/// the file is a physical point.
MshMesh box_msh(int dim, int n);

/// The file's bytes. An element of a physical group 0 has none.
std::string msh_bytes(const MshMesh& mesh, MshFlavour flavour);

/// Puts bytes in a file in a scratch directory and gives its path. The root writes. Collective.
std::string put_file(const ScratchDirectory& scratch, const std::string& name, const std::string& bytes);

}  // namespace malleus::test
