#pragma once

/// The choices of the Stokes preconditioner.

#include "base/types.hpp"

namespace malleus {

enum class CoarseModes { automatic, translations, rigid };
enum class CyclePrecision { automatic, single_precision, double_precision };
enum class VelocityMethod { multigrid, gamg };

struct PreconditionerSettings {
  VelocityMethod velocity = VelocityMethod::multigrid;
  CoarseModes modes = CoarseModes::automatic;            ///< automatic: rigid above a viscosity contrast of 30
  CyclePrecision precision = CyclePrecision::automatic;  ///< automatic: double above a contrast of 1e6
  Real threshold = 0.25;                                 ///< of strong couplings
  int chebyshev_steps = 3;
  bool positive = false;  ///< block diagonal and positive, for methods that need it

  bool operator==(const PreconditionerSettings&) const = default;
};

}  // namespace malleus
