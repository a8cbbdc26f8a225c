#include "forge/friction.hpp"

#include <cmath>

namespace malleus::forge {

FrictionTerm friction_term(const FrictionSpec& spec, Real consistency, Real shear_stress, Real pressure,
                           Real regularisation) {
  switch (spec.law) {
    case FrictionLaw::norton:
      return {spec.coefficient * consistency, spec.exponent, spec.exponent == 1 ? 0 : regularisation};
    case FrictionLaw::tresca:
      return {spec.coefficient * shear_stress, 0, regularisation};
    case FrictionLaw::coulomb:
      return {std::min(spec.coefficient * pressure, shear_stress), 0, regularisation};
  }
  return {};
}

ContactTraction contact_traction(const NormalTerm& normal, const FrictionTerm& friction, const Vector& slip,
                                 Holding holding) {
  ContactTraction result;
  const Vector& n = normal.normal;
  const Real pressure = normal.multiplier + normal.penalty * (normal.offset - n.dot(slip));
  if (holding == Holding::yes || (holding == Holding::by_slip && pressure > 0)) {
    result.pressure = pressure;
    result.traction = pressure * n;
    result.derivative = -normal.penalty * n * n.transpose();
  }
  if (!(friction.scale > 0)) return result;
  const Vector tangential = slip - n.dot(slip) * n;
  const Real square = tangential.squaredNorm() + friction.regularisation * friction.regularisation;
  const Real factor =
      friction.exponent == 1 ? friction.scale : friction.scale * std::pow(square, 0.5 * (friction.exponent - 1));
  result.traction -= factor * tangential;
  result.derivative -= factor * (Matrix::Identity() - n * n.transpose());
  if (friction.exponent != 1 && square > 0) {
    result.derivative -= factor * (friction.exponent - 1) / square * tangential * tangential.transpose();
  }
  return result;
}

}  // namespace malleus::forge
