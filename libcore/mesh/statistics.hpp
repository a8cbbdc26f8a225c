#pragma once

/// What a mesh is like, in numbers.

#include <array>
#include <string>
#include <vector>

#include "mesh/mesh.hpp"
#include "mesh/space_filling_curve.hpp"

namespace malleus {

/// Spread of a quantity over the elements or edges. Bins: [0, 0.1), [0.1, 0.2), ... of quality; of edge lengths in
/// steps of a factor two, up from `first_edge`.
struct Distribution {
  Real min = 0;
  Real mean = 0;
  Real max = 0;
  Real p01 = 0;  ///< one per cent of the values lie below, to within 1/1000 of the range
  std::vector<GlobalId> bins;
  Real first_edge = 0;
};

struct RegionStatistics {
  std::string name;
  GlobalId elements = 0;
  Real volume = 0;  ///< m^3, in 2D m^2
};

struct GroupStatistics {
  std::string name;
  GlobalId facets = 0;
  Real area = 0;  ///< m^2, in 2D m
};

struct MeshStatistics {
  int dim = 3;
  GlobalId nodes = 0;
  GlobalId elements = 0;
  GlobalId exterior_facets = 0;
  GlobalId unnamed_exterior_facets = 0;
  GlobalId fewest_elements_of_a_rank = 0;
  GlobalId most_elements_of_a_rank = 0;
  Box box;  ///< m
  Real volume = 0;
  Real area = 0;  ///< of the exterior
  std::vector<RegionStatistics> regions;
  std::vector<GroupStatistics> groups;
  Distribution quality;  ///< of elements: 1 regular, 0 flat
  Distribution edges;    ///< m; each edge counts once for each element at it
};

/// The same on all ranks; to roundoff the same for any division. An empty mesh has zeros. Collective.
MeshStatistics mesh_statistics(const Communicator& comm, const Mesh& mesh);

}  // namespace malleus
