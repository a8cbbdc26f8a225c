#pragma once

/// The serial remesher: a mesh is brought to the sizes of a metric by local operations on cavities.

#include <string>
#include <vector>

#include "remesh/metric.hpp"

namespace malleus {

struct RemeshOptions {
  Real feature_angle = 45;    ///< degrees; edges (corners in 2D) that bend more are kept as features
  Real hausdorff = 0;         ///< m; faces stay this close to the input surface; 0 = bounded by their slope alone
  bool keep_surface = false;  ///< no facet changes
  bool keep_volume = false;   ///< restore each region's volume by a shift of curved free surfaces along normals
  Real surface_finer = 1;  ///< >= 1; edges on curved free surfaces are this much shorter: less volume is lost to chords
  int size_rounds = 60;    ///< at most, until edge lengths settle
  int improvement_rounds = 6;  ///< of swaps and relocation once lengths have settled
};

/// Times of one phase.
struct RemeshPhase {
  std::string name;
  Real wall_s = 0;       ///< of a distributed remesh alone
  Real processor_s = 0;  ///< of a distributed remesh: of the slowest rank, waiting included
};

struct RemeshQuality {
  Real minimum = 0;  ///< mean ratio in metric space; <= 0: inverted or flat elements are left
  Real mean = 0;
  Real conforming = 0;   ///< share of edges of metric length in [1/sqrt 2, sqrt 2]
  LocalId inverted = 0;  ///< elements of volume <= 0
};

struct RemeshReport {
  LocalId nodes_before = 0, nodes_after = 0;
  LocalId elements_before = 0, elements_after = 0;
  Real volume_before = 0, volume_after = 0;  ///< m^D, signed
  Real volume_error = 0;                     ///< with keep_volume: largest relative error of a region's volume
  RemeshQuality before, after;
  std::int64_t splits = 0, collapses = 0, swaps = 0, moves = 0;
  LocalId unmatched_facets = 0;  ///< listed facets that were no element's face
  LocalId unused_nodes = 0;      ///< nodes of the input without elements
  std::vector<RemeshPhase> phases;
};

/// Remeshes in place. Nodes and elements come out in Morton order, facets and curves complete. Throws InputError for
/// input that is no simplicial mesh (bad numbers, faces of more than two elements) or a metric that does not fit.
/// Elements that no operation could turn are counted in the report's after.inverted. Local; deterministic.
/// carried: if given, receives the metric at the nodes of the new mesh, of the same kind.
RemeshReport remesh(RemeshMesh& mesh, const Metric& metric, const RemeshOptions& options = {},
                    Metric* carried = nullptr);

}  // namespace malleus
