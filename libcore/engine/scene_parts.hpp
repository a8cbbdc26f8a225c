#pragma once

/// What decides about the symmetry of a scene, beside the shape of its boundary.

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "base/position.hpp"
#include "case/common_sections.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// To be filled by the program that knows the scene.
struct SceneParts {
  using ScalarOfPlace = std::function<Real(const Position&)>;

  /// [group + 1] parts of the boundary with the same number have the same conditions; 0, 1, ...
  std::vector<int> class_of_group;
  std::vector<char> is_symmetry_plane;       ///< [class]
  std::vector<ScalarOfPlace> scalars;        ///< m: distances to tools, level sets at the start
  std::vector<std::array<Real, 3>> vectors;  ///< that hold everywhere; of those that change in time what is not 0

  /// A class of its own for a group of the mesh.
  void add_class(int group, bool is_symmetry);
  /// False where a component depends on the position.
  bool add_vector(const ExpressionVector& components);
};

/// Parts with the groups of the boundary sections, loads and gravity; class 0 is the rest of the boundary. None where
/// anything depends on the position or comes from another run. Local.
std::optional<SceneParts> parts_of_common_sections(const Mesh& mesh, const CommonSections& sections);

}  // namespace malleus
