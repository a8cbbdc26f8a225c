#include "solvers/viscosity_range.hpp"

#include <algorithm>
#include <limits>

namespace malleus {

ViscosityRange viscosity_range(const LinearSystem& system) {
  ViscosityRange range{std::numeric_limits<Real>::max(), 0};
  for (const Real viscosity : system.element_viscosity) {
    if (viscosity <= 0) continue;
    range.low = std::min(range.low, viscosity);
    range.high = std::max(range.high, viscosity);
  }
  return {system.comm->min(range.low), system.comm->max(range.high)};
}

}  // namespace malleus
