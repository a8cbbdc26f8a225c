#pragma once

/// How far the viscosities of a system lie apart.

#include "fem/linear_system.hpp"

namespace malleus {

/// Smallest and largest viscosity [Pa.s] of what is modelled, over all ranks. Nothing modelled: low > high.
struct ViscosityRange {
  Real low = 0;
  Real high = 0;

  Real contrast() const noexcept { return high > 0 ? high / low : 1.0; }  ///< >= 1
};

/// Collective.
ViscosityRange viscosity_range(const LinearSystem& system);

}  // namespace malleus
