#pragma once

/// One partition's grid as it stands in a results file.

#include <string>
#include <vector>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

struct GridAttribute {
  std::string name;
  bool on_nodes = true;
  int components = 1;  ///< 1, 3 (vector) or 6 (symmetric tensor xx xy xz yy yz zz)
  std::vector<double> values;
};

struct GridImage {
  int rank = 0;
  int dim = 3;
  std::vector<double> points;       ///< [node][3]
  std::vector<std::int32_t> cells;  ///< [element][dim+1]
  std::vector<GridAttribute> attributes;

  std::uint64_t point_count() const { return points.size() / 3; }
  std::uint64_t cell_count() const { return cells.size() / (static_cast<std::size_t>(dim) + 1); }
};

/// The image of this rank's part. Vectors of a plane scene get a zero third component, symmetric tensors (xx yy xy or
/// xx yy zz xy yz xz) XDMF's six. Local.
GridImage make_grid_image(int rank, const Mesh& mesh, const std::vector<const Field*>& fields);

/// To bytes and back, for sending an image to the rank that writes it.
std::vector<std::byte> pack_grid_image(const GridImage& image);
GridImage unpack_grid_image(std::span<const std::byte> bytes);

/// <Grid> element of an image that stands in group /pRRRR of the HDF5 file named (relative path).
std::string grid_xml(const GridImage& image, const std::string& file, int float_bytes);

}  // namespace malleus
