#pragma once

/// Medit (GMF) files: .mesh and .sol in ASCII, .meshb and .solb in binary. Read and written by one rank; local.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// The simplices of a Medit mesh, numbered from 0. `reference` is Medit's integer label of an entity.
struct MeditMesh {
  int dimension = 3;
  std::vector<Real> coordinates;  ///< [node][dimension]
  std::vector<std::int32_t> node_reference;
  std::vector<LocalId> tetrahedra;  ///< [tetrahedron][4]
  std::vector<std::int32_t> tetrahedron_reference;
  std::vector<LocalId> triangles;  ///< [triangle][3]
  std::vector<std::int32_t> triangle_reference;
  std::vector<LocalId> edges;  ///< [edge][2]
  std::vector<std::int32_t> edge_reference;
  std::vector<LocalId> corners;  ///< nodes
  std::vector<LocalId> ridges;   ///< edges, by their place in `edges`

  LocalId nodes() const { return static_cast<LocalId>(coordinates.size() / static_cast<std::size_t>(dimension)); }
};

/// Values at the nodes: one scalar, or one symmetric tensor in Medit's order (2D xx, xy, yy; 3D xx, xy, yy, xz, yz,
/// zz).
struct MeditSolution {
  int dimension = 3;
  int components = 1;
  std::vector<Real> values;  ///< [node][components]
};

/// The ending decides between ASCII (.mesh, .sol) and binary (.meshb, .solb; versions 1 to 4, of this machine's byte
/// order). Sections that are not simplices or their marks are skipped. InputError where the file is missing, cut off,
/// names nodes that it does not have, has tetrahedra in a plane, or (solutions) holds anything but one scalar or tensor
/// per node.
MeditMesh read_medit(const std::filesystem::path& path);
MeditSolution read_medit_solution(const std::filesystem::path& path);

/// StorageError where the file cannot be written. ASCII numbers have 17 digits.
void write_medit(const std::filesystem::path& path, const MeditMesh& mesh);
void write_medit_solution(const std::filesystem::path& path, const MeditSolution& solution);

}  // namespace malleus
