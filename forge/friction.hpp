#pragma once

/// Tractions between a surface node and what it touches, as functions of the relative velocity.

#include "forge/geometry.hpp"

namespace malleus::forge {

enum class FrictionLaw { norton, tresca, coulomb };

/// norton:  traction = - f K |dv_t|^(q-1) dv_t, f [s^(q-m) m^-q], K the slave's consistency
/// tresca:  traction = - f k dv_t / |dv_t|, f in [0, 1], k the slave's flow stress in shear
/// coulomb: traction = - min(f p, k) dv_t / |dv_t|, p the contact pressure
struct FrictionSpec {
  FrictionLaw law = FrictionLaw::norton;
  Real coefficient = 0;  ///< f >= 0; 0: none
  Real exponent = 1;     ///< q > 0, norton alone
};

/// A contact point's friction with everything frozen that is not the relative velocity:
/// traction = - scale (|dv_t|^2 + e^2)^((q-1)/2) dv_t, q = 0 for a limit stress. `regularisation` e [m/s] > 0 where
/// q < 1: the velocity below which friction is linear (the neutral point). Symmetric positive in dv_t for q >= 0.
struct FrictionTerm {
  Real scale = 0;  ///< f K [Pa (s/m)^q], or the limit stress [Pa]
  Real exponent = 1;
  Real regularisation = 0;
};

/// limit stresses are of the last known state: shear_stress k [Pa], pressure p [Pa].
FrictionTerm friction_term(const FrictionSpec& spec, Real consistency, Real shear_stress, Real pressure,
                           Real regularisation);

/// Normal part of a contact point: the closing speed is offset - normal . dv, and the pressure
/// p = [multiplier + penalty (offset - normal . dv)]^+. Paper, eq. [5] to [7], with the multiplier of the augmented
/// Lagrangian.
struct NormalTerm {
  Vector normal = Vector::UnitX();  ///< unit, toward the slave
  Real offset = 0;                  ///< m/s: -gap at the end of the increment for dv = 0, over the effective step
  Real penalty = 0;                 ///< r, Pa.s/m
  Real multiplier = 0;              ///< Pa, >= 0
};

/// What the other side does to the slave, per area.
struct ContactTraction {
  Vector traction = Vector::Zero();    ///< Pa, on the slave
  Matrix derivative = Matrix::Zero();  ///< d traction / d dv, Pa.s/m; symmetric, not positive
  Real pressure = 0;                   ///< Pa, >= 0 where the slip says whether the point holds
};

/// Whether a contact point presses: as its slip says, or as it was told.
enum class Holding { by_slip, yes, no };

/// slip: dv = slave's velocity - velocity of the other side there [m/s]. Friction acts whatever the pressure is: who
/// solves says which points rub, and looks again after the solve. Else the traction would jump where contact begins. A
/// point told to hold pulls as well: p = multiplier + penalty (offset - normal . dv) of either sign; one told not to
/// has p = 0.
ContactTraction contact_traction(const NormalTerm& normal, const FrictionTerm& friction, const Vector& slip,
                                 Holding holding = Holding::by_slip);

}  // namespace malleus::forge
