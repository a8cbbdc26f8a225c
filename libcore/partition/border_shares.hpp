#pragma once

/// Who takes over what lies along the border of two parts when borders are moved inside: one of them, or each a stretch
/// of it, so that what the parts end with is even.

#include <array>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "mesh/mesh.hpp"
#include "partition/node_parts.hpp"

namespace malleus {

/// The border of two parts, as all ranks know it.
struct Border {
  Real from_low = 0;                        ///< work of the layer of the lower part, which the higher may take
  Real from_high = 0;                       ///< and the other way round
  std::array<Real, 3> lowest = {0, 0, 0};   ///< of its nodes' coordinates, m
  std::array<Real, 3> highest = {0, 0, 0};  ///< likewise
  Real share = 0;                           ///< of the border at which the lower part takes over, in [0, 1]
  int axis = 0;                             ///< along which it is divided
  Real cut = 0;                             ///< the lower part takes over at nodes below this coordinate

  Real work() const { return from_low + from_high; }
  /// Along its axis, m; a border that is a single point cannot be divided.
  Real extent() const { return highest[static_cast<std::size_t>(axis)] - lowest[static_cast<std::size_t>(axis)]; }
};

class BorderShares {
 public:
  /// The borders at nodes with released[node] != 0. work, parts: [element]. Collective.
  BorderShares(const Communicator& comm, const Mesh& mesh, const AroundNodes& around,
               std::span<const std::uint8_t> released, std::span<const Real> work, std::span<const int> parts);

  /// Chooses the shares such that the parts' measures are as even as may be, up to `slack`: measure[part] is what it
  /// would be if the higher part took all of each border; a share f of a border adds f times its work to the lower
  /// part's and takes it from the higher's. Most borders go to one part whole. Collective.
  void level(std::vector<Real> measures, Real slack);

  /// Does `part` take over from `other` at a node there? [dim] coordinates.
  bool takes(int part, int other, const Real* point) const;

  const std::map<std::pair<int, int>, Border>& borders() const { return borders_; }

 private:
  void choose_sides(std::vector<Real>& measures);
  void divide(std::vector<Real>& measures, Real slack);
  void place_cuts();

  const Communicator& comm_;
  const Mesh& mesh_;
  const AroundNodes& around_;
  std::span<const std::uint8_t> released_;
  std::map<std::pair<int, int>, Border> borders_;  ///< by (lower part, higher part)
};

}  // namespace malleus
