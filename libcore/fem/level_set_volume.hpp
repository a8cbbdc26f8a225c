#pragma once

/// Volumes enclosed by a level set, and the shift that restores one. A level set is a P1 function [node], positive
/// inside; its front is its zero set.

#include <span>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

/// Volume of each element [m^3] (area [m^2] in plane 2D: per metre of depth). axisymmetric (x = r): of the whole
/// revolution [m^3]. Local.
std::vector<Real> element_measures(const Mesh& mesh, bool axisymmetric);

/// Elements in which the level set changes its sign, increasing. Local.
std::vector<LocalId> cut_elements(const Mesh& mesh, std::span<const Real> level_set);

/// Share of an element in which the level set is positive: cut_simplex.hpp. Local.
Real positive_fraction(const Mesh& mesh, std::span<const Real> level_set, LocalId element);

/// Measure of the region where level_set + shift > 0: cut fractions times element measures. In axisymmetric scenes the
/// mean radius of a cut element stands for that of its part. Collective.
Real positive_volume(const Communicator& comm, const Mesh& mesh, std::span<const Real> measures,
                     std::span<const Real> level_set, Real shift = 0);

struct VolumeRestoration {
  Real shift = 0;   ///< what was added to the level set [m]
  Real volume = 0;  ///< positive volume after it [m^3]
};

/// Adds to the level set the constant with which its positive volume is `target` (clamped to what the mesh holds), to
/// rounding of the total. Collective.
VolumeRestoration restore_volume(const Communicator& comm, const Mesh& mesh, std::span<const Real> measures,
                                 std::span<Real> level_set, Real target);

}  // namespace malleus
