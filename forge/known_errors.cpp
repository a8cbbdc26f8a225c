#include "forge/known_errors.hpp"

#include <cmath>

#include "fem/error_norms.hpp"

namespace malleus::forge {

Outcome KnownErrors::advance(const Increment& increment) {
  KnownSolution known;
  known.velocity = reference_.velocity;
  known.pressure = reference_.pressure;
  DiscreteFields fields;
  fields.velocity = scene_.fields[field_name::velocity].values();
  fields.pressure = scene_.fields[field_name::pressure].values();
  fields.pressure_is_free = flow_.pressure_is_free();
  const SolutionErrors errors = solution_errors(*scene_.comm, scene_.mesh, scene_.geometry, known, fields,
                                                scene_.fields[field_name::viscosity].values(), increment.start());
  const auto put = [&](const std::string& name, const std::optional<ErrorNorm>& norm) {
    if (!norm) return;
    errors_[name] = norm->absolute;
    if (std::isfinite(norm->relative())) errors_[name + "_relative"] = norm->relative();
  };
  put("velocity_l2", errors.velocity_l2);
  put("velocity_h1", errors.velocity_h1);
  put("pressure_l2", errors.pressure_l2);
  return Outcome::done();
}

}  // namespace malleus::forge
