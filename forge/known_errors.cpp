#include "forge/known_errors.hpp"

#include <cmath>

#include "fem/error_norms.hpp"

namespace malleus::forge {

Outcome KnownErrors::advance(const Increment& increment) {
  time_ = increment.start();
  coordinates_ = scene_.mesh.coordinates;
  is_due_ = true;
  if (reference_.at == ReferenceTime::every) errors();
  return Outcome::done();
}

const nlohmann::json& KnownErrors::errors() {
  if (!is_due_) return errors_;
  std::swap(coordinates_, scene_.mesh.coordinates);
  compute();
  std::swap(coordinates_, scene_.mesh.coordinates);
  is_due_ = false;
  return errors_;
}

std::vector<std::string> KnownErrors::columns() const {
  std::vector<std::string> names;
  if (reference_.at != ReferenceTime::every) return names;
  if (reference_.velocity[0]) names.insert(names.end(), {"velocity_l2", "velocity_h1"});
  if (reference_.pressure) names.emplace_back("pressure_l2");
  return names;
}

void KnownErrors::compute() {
  KnownSolution known;
  known.velocity = reference_.velocity;
  known.pressure = reference_.pressure;
  DiscreteFields fields;
  fields.velocity = scene_.fields[field_name::velocity].values();
  fields.pressure = scene_.fields[field_name::pressure].values();
  fields.pressure_is_free = flow_.pressure_is_free();
  const SolutionErrors errors = solution_errors(*scene_.comm, scene_.mesh, scene_.geometry, known, fields,
                                                scene_.fields[field_name::viscosity].values(), time_);
  const auto put = [&](const std::string& name, const std::optional<ErrorNorm>& norm) {
    if (!norm) return;
    errors_[name] = norm->absolute;
    if (std::isfinite(norm->relative())) errors_[name + "_relative"] = norm->relative();
  };
  put("velocity_l2", errors.velocity_l2);
  put("velocity_h1", errors.velocity_h1);
  put("pressure_l2", errors.pressure_l2);
}

}  // namespace malleus::forge
