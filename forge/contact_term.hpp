#pragma once

/// Contact and friction as forces in the Stokes equations.

#include "fem/residual_term.hpp"
#include "forge/friction.hpp"

namespace malleus::forge {

/// A slave node against one face of one opponent, with everything frozen but the velocities.
struct ContactPoint {
  LocalId slave = -1;          ///< owned node
  GlobalId slave_number = -1;  ///< its global number
  std::size_t surface = 0;     ///< its place in FreeSurface::nodes()
  int opponent = 0;            ///< tools first, then pairs of bodies
  Real area = 0;               ///< m^2 (m in plane strain): weight of the tractions
  NormalTerm normal;
  FrictionTerm friction;                           ///< what it is where the point rubs
  bool rubs = false;                               ///< friction acts in this solve
  bool holds = false;                              ///< the branch that is held, or the first guess of it
  Vector opponent_velocity = Vector::Zero();       ///< of a rigid opponent there, m/s
  std::array<GlobalId, 3> masters = {-1, -1, -1};  ///< nodes of a deformable opponent's facet; -1: none
  std::array<Real, 3> weights = {0, 0, 0};
};

/// Sum over the contact points of area times traction on the slave, and its opposite, weighted, on the masters. Each
/// point is on the rank that owns its slave.
class ContactTerm final : public ResidualTerm {
 public:
  explicit ContactTerm(int dim) : dim_(dim) {}

  std::vector<ContactPoint>& points() noexcept { return points_; }
  const std::vector<ContactPoint>& points() const noexcept { return points_; }

  void extra_couplings(NodeTuples& tuples) const override;
  void add_residual(const NodeSpace& space, std::span<const Real> unknowns, std::span<Real> force) const override;
  void add_tangent(const NodeSpace& space, std::span<const Real> unknowns, TangentSink& sink) const override;
  void choose_branches(Branches choice, const NodeSpace& space, std::span<const Real> unknowns) override;
  bool is_linear() const override { return false; }

  /// The traction on the slave at a slip, which decides whether it holds.
  static ContactTraction traction(const ContactPoint& point, const Vector& slip) {
    return contact_traction(point.normal, point.rubs ? point.friction : FrictionTerm{}, slip);
  }
  /// Slave's velocity less the opponent's at the contact point, m/s. unknowns as in add_residual().
  Vector slip(const ContactPoint& point, const NodeSpace& space, std::span<const Real> unknowns) const;

 private:
  /// The traction as the held branches have it.
  ContactTraction branch_traction(const ContactPoint& point, const Vector& slip) const;
  bool acts(const ContactPoint& point, const ContactTraction& traction) const {
    return point.rubs || traction.pressure != 0;
  }

  int dim_;
  bool holds_branches_ = false;
  std::vector<ContactPoint> points_;
};

}  // namespace malleus::forge
