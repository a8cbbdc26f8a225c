#include "forge/contact_term.hpp"

namespace malleus::forge {
namespace {

/// The nodes that a point's traction acts on, with their parts: 1 for the slave, -w for the masters. A contact depends
/// on the velocities only through the sum of part times velocity, the slip.
struct Participants {
  std::array<LocalId, 4> nodes{};
  std::array<Real, 4> parts{};
  int count = 0;
};

Participants participants(const ContactPoint& point, const NodeSpace& space) {
  Participants all;
  all.nodes[0] = point.slave;
  all.parts[0] = 1;
  all.count = 1;
  for (std::size_t k = 0; k < 3 && point.masters[k] >= 0; ++k) {
    const auto i = static_cast<std::size_t>(all.count++);
    all.nodes[i] = space.local_node(point.masters[k]);
    all.parts[i] = -point.weights[k];
  }
  return all;
}

}  // namespace

void ContactTerm::extra_couplings(NodeTuples& tuples) const {
  for (const ContactPoint& point : points_) {
    if (point.masters[0] < 0) continue;
    std::array<GlobalId, 4> set{};
    std::size_t count = 0;
    set[count++] = point.slave_number;
    for (std::size_t k = 0; k < 3 && point.masters[k] >= 0; ++k) set[count++] = point.masters[k];
    tuples.add(std::span(set).first(count));
  }
}

Vector ContactTerm::slip(const ContactPoint& point, const NodeSpace& space, std::span<const Real> unknowns) const {
  const Participants all = participants(point, space);
  Vector sum = -point.opponent_velocity;
  for (std::size_t i = 0; i < static_cast<std::size_t>(all.count); ++i) {
    const auto at = static_cast<std::size_t>(all.nodes[i]) * static_cast<std::size_t>(dim_ + 1);
    sum += all.parts[i] * to_vector(unknowns.data() + at, dim_);
  }
  return sum;
}

void ContactTerm::choose_branches(Branches choice, const NodeSpace& space, std::span<const Real> unknowns) {
  holds_branches_ = choice != Branches::follow;
  if (choice != Branches::hold) return;
  for (ContactPoint& point : points_) point.holds = traction(point, slip(point, space, unknowns)).pressure > 0;
}

ContactTraction ContactTerm::branch_traction(const ContactPoint& point, const Vector& slip) const {
  if (!holds_branches_) return traction(point, slip);
  return contact_traction(point.normal, point.rubs ? point.friction : FrictionTerm{}, slip,
                          point.holds ? Holding::yes : Holding::no);
}

void ContactTerm::add_residual(const NodeSpace& space, std::span<const Real> unknowns, std::span<Real> force) const {
  for (const ContactPoint& point : points_) {
    const ContactTraction at = branch_traction(point, slip(point, space, unknowns));
    if (!acts(point, at)) continue;
    const Participants all = participants(point, space);
    for (std::size_t i = 0; i < static_cast<std::size_t>(all.count); ++i) {
      const auto first = static_cast<std::size_t>(all.nodes[i]) * static_cast<std::size_t>(dim_);
      for (std::size_t c = 0; c < static_cast<std::size_t>(dim_); ++c) {
        force[first + c] -= all.parts[i] * point.area * at.traction[static_cast<Eigen::Index>(c)];
      }
    }
  }
}

void ContactTerm::add_tangent(const NodeSpace& space, std::span<const Real> unknowns, TangentSink& sink) const {
  for (const ContactPoint& point : points_) {
    const ContactTraction at = branch_traction(point, slip(point, space, unknowns));
    if (!acts(point, at)) continue;
    const Participants all = participants(point, space);
    for (std::size_t i = 0; i < static_cast<std::size_t>(all.count); ++i) {
      for (std::size_t j = 0; j < static_cast<std::size_t>(all.count); ++j) {
        const Real factor = -all.parts[i] * all.parts[j] * point.area;
        if (factor == 0) continue;
        std::array<Real, 9> block{};
        for (int row = 0; row < dim_; ++row) {
          for (int column = 0; column < dim_; ++column) {
            block[static_cast<std::size_t>(row * dim_ + column)] = factor * at.derivative(row, column);
          }
        }
        sink.add(all.nodes[i], all.nodes[j], block.data());
      }
    }
  }
}

}  // namespace malleus::forge
