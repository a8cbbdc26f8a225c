#pragma once

/// Distance of a discrete solution from a known one.

#include <array>
#include <functional>
#include <optional>
#include <span>

#include "fem/facet.hpp"
#include "mesh/mesh.hpp"

namespace malleus {

/// A known function: values [points] at coordinates [points][dim] (m).
using KnownFunction = std::function<void(std::span<const Real> coordinates, std::span<Real> values)>;

struct ErrorNorms {
  Real absolute = 0;
  Real reference = 0;  ///< the known solution in the same norm
  Real relative() const { return reference > 0 ? absolute / reference : absolute; }
};

/// The known functions evaluated once at the quadrature points of the mesh: 3 points an axis, exact for products of
/// linear functions and far below the element's error for smooth ones. All norms are over the whole domain (the whole
/// revolution in axisymmetric scenes). Every call is collective.
class SolutionErrors {
 public:
  SolutionErrors(const Communicator& comm, const Mesh& mesh, Geometry geometry)
      : comm_(comm), mesh_(mesh), geometry_(geometry) {}

  /// ||f_h - f||_L2. field: [node][components], of which those with a known function count. without_means: the mean
  /// over the domain is removed from both (a pressure that is free up to a constant; one component).
  ErrorNorms l2(std::span<const Real> field, std::span<const std::optional<KnownFunction>> known,
                bool without_means = false) const;
  /// ||grad(f_h - f)||_L2, the seminorm. The known gradient is taken by central differences over 1e-5 of an edge.
  ErrorNorms h1(std::span<const Real> field, std::span<const std::optional<KnownFunction>> known) const;
  /// Measure of the region where the signs of a P1 field and the known function differ; reference: of the region where
  /// the known function is positive. By 4 points an axis.
  ErrorNorms sign_mismatch(std::span<const Real> field, const KnownFunction& known) const;

 private:
  const Communicator& comm_;
  const Mesh& mesh_;
  Geometry geometry_;
};

}  // namespace malleus
