#pragma once

/// Distances of discrete fields from a known solution.

#include <optional>
#include <span>

#include "case/expression.hpp"
#include "fem/facet.hpp"

namespace malleus {

/// What is known; a velocity has all its components.
struct KnownSolution {
  std::array<std::optional<Expression>, 3> velocity;  ///< m/s
  std::optional<Expression> pressure;                 ///< Pa
  std::optional<Expression> level_set;                ///< m, positive inside
};

/// An error and the norm of the known field; relative is NaN where that is zero.
struct ErrorNorm {
  Real absolute = 0;
  Real known = 0;
  Real relative() const;
};

struct SolutionErrors {
  std::optional<ErrorNorm> velocity_l2;  ///< root of the integral of |v - v_known|^2, m^(D/2) m/s
  std::optional<ErrorNorm>
      velocity_h1;  ///< the same of the gradients (in axisymmetric scenes with v_r/r): the seminorm
  std::optional<ErrorNorm> pressure_l2;   ///< both means removed where the pressure is free
  std::optional<ErrorNorm> level_set_l1;  ///< measure of the region where the signs differ, m^D; known: that inside
};

/// The discrete fields on all local nodes; empty spans are not compared.
struct DiscreteFields {
  std::span<const Real> velocity;   ///< [local node][dim], m/s
  std::span<const Real> pressure;   ///< [local node], Pa
  std::span<const Real> level_set;  ///< [local node], m
  bool pressure_is_free = false;
};

/// Errors at one time [s], integrals weighted as `geometry` says. Quadrature of degree 5 (values) and 3 (gradients);
/// the known gradients by central differences over a thousandth of the element. The subscales are left out. The level
/// sets' signs are compared at 64 points of each element near either front. Elements whose `modelled` entry is 0 are
/// left out (empty: none). An expression that is not finite inside is an InputError. Collective.
SolutionErrors solution_errors(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                               const KnownSolution& known, const DiscreteFields& fields, std::span<const Real> modelled,
                               Real time);

}  // namespace malleus
