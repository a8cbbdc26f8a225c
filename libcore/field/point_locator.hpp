#pragma once

/// Finding the element of a point, and field values there.

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "field/field.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// A point in an element of this rank.
struct Location {
  LocalId element = -1;
  std::array<Real, 4> weights = {};  ///< barycentric, of the element's nodes; sum 1
  Real inside = 0;                   ///< smallest weight: >= 0 inside, < 0 outside
};

/// Elements of this rank sorted into the cells of a grid. Build anew when the mesh moves. Local.
class PointLocator {
 public:
  explicit PointLocator(const Mesh& mesh);
  /// The element that holds the point best; none where the point is farther outside each candidate than `tolerance`
  /// (a barycentric weight below -tolerance).
  std::optional<Location> find(const Real* point, Real tolerance = 1e-9) const;

 private:
  std::array<int, 3> cell_of(const Real* point) const;
  std::size_t index(const std::array<int, 3>& cell) const;

  const Mesh& mesh_;
  std::array<Real, 3> low_ = {0, 0, 0};
  Real width_ = 1;
  std::array<int, 3> counts_ = {1, 1, 1};
  std::vector<LocalId> begin_;     ///< [cell+1] in elements_
  std::vector<LocalId> elements_;  ///< by cell
};

/// Values of fields at points that all ranks know.
struct PointValues {
  std::vector<char> found;   ///< [point]: whether it lies in the mesh
  std::vector<Real> values;  ///< [point][all components, in the order of the fields]; 0 where not found
};

/// points: [n][dim], the same on all ranks; node fields are interpolated, element fields taken from the element that
/// holds the point. A point between ranks is read on the lowest rank that holds it best. The result is the same on all
/// ranks. Cost: n log n local searches a rank and two reductions of the size of the result. Collective.
PointValues values_at_points(const Communicator& comm, const Mesh& mesh, const std::vector<const Field*>& fields,
                             std::span<const Real> points);

}  // namespace malleus
