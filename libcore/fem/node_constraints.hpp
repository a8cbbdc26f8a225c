#pragma once

/// Which unknowns of each node are prescribed.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/types.hpp"
#include "parallel/halo.hpp"

namespace malleus {

/// Prescribed velocity directions and pressures of nodes. A node has 0..dim orthonormal fixed directions n_k, of any
/// orientation, and a velocity w in their span: n_k . v = n_k . w. With P = I - sum n_k n_k^T, the projector on the
/// free directions, the linear system is kept in the global axes as P A P + (I - P) d: symmetric, columns eliminated,
/// increments of the velocity stay in the span of P. Local, alike on all holders of a node.
class NodeConstraints {
 public:
  NodeConstraints() = default;
  NodeConstraints(int dim, LocalId nodes);

  int dim() const noexcept { return dim_; }
  LocalId nodes() const noexcept { return static_cast<LocalId>(index_.size()); }

  /// Demands direction . v = direction . velocity at a node. direction: [dim], any length > 0; its part along
  /// directions that are fixed already keeps its earlier value. A direction within `angle` (rad) of the span of the
  /// fixed ones is taken for one of them. Returns whether a direction was added.
  bool fix_direction(LocalId node, const Real* direction, const Real* velocity, Real angle = 1e-6);
  /// Fixes the velocity in all directions that are still free. velocity: [dim], m/s.
  void fix_velocity(LocalId node, const Real* velocity);
  /// The pressure increment of the node is zero (nodes of bodies and regions that are not modelled).
  void fix_pressure(LocalId node);
  /// Replaces the prescribed velocity w of a node, keeping its fixed directions. velocity: [dim], m/s.
  void set_velocity(LocalId node, const Real* velocity);

  int fixed_directions(LocalId node) const noexcept;              ///< 0..dim
  std::span<const Real> directions(LocalId node) const noexcept;  ///< [fixed][dim], orthonormal
  bool is_pressure_fixed(LocalId node) const noexcept;
  bool is_free(LocalId node) const noexcept { return index_[static_cast<std::size_t>(node)] < 0; }

  /// v <- P v. vector: [dim].
  void project(LocalId node, Real* vector) const noexcept;
  /// v <- P v + w: the nearest velocity that satisfies the constraints. velocity: [dim], m/s.
  void impose(LocalId node, Real* velocity) const noexcept;

  /// The same on more nodes: those here, then copies that `halo` holds beyond them, filled from their owners.
  /// Collective among neighbours.
  NodeConstraints extended(const Halo& halo) const;

 private:
  struct Entry {
    std::int8_t fixed = 0;
    bool pressure = false;
    std::array<Real, 9> directions{};  ///< [fixed][dim]
    std::array<Real, 3> velocity{};    ///< w
  };
  Entry& entry(LocalId node);
  const Entry* find(LocalId node) const noexcept;

  int dim_ = 3;
  std::vector<std::int32_t> index_;  ///< node -> entry, -1 = free
  std::vector<Entry> entries_;
};

}  // namespace malleus
