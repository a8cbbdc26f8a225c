#include "forge/known_errors.hpp"

#include "fem/solution_errors.hpp"

namespace malleus::forge {
namespace {

KnownFunction at_time(const Expression& expression, int dim, Real time) {
  return [expression, dim, time](std::span<const Real> coordinates, std::span<Real> values) {
    expression.evaluate(coordinates, dim, time, values);
  };
}

}  // namespace

Outcome KnownErrors::advance(const Increment& increment) {
  const SolutionErrors errors(*scene_.comm, scene_.mesh, scene_.geometry);
  const auto put = [&](const std::string& name, const ErrorNorms& norms) {
    errors_[name] = norms.absolute;
    errors_[name + "_relative"] = norms.relative();
  };
  std::vector<std::optional<KnownFunction>> velocity(static_cast<std::size_t>(scene_.dim()));
  bool has_velocity = false;
  for (std::size_t c = 0; c < velocity.size(); ++c) {
    if (!reference_.velocity[c]) continue;
    velocity[c] = at_time(*reference_.velocity[c], scene_.dim(), increment.start());
    has_velocity = true;
  }
  if (has_velocity) {
    put("velocity_l2", errors.l2(scene_.fields[field_name::velocity].values(), velocity));
    put("velocity_h1", errors.h1(scene_.fields[field_name::velocity].values(), velocity));
  }
  if (reference_.pressure) {
    const std::vector<std::optional<KnownFunction>> pressure = {
        at_time(*reference_.pressure, scene_.dim(), increment.start())};
    put("pressure_l2", errors.l2(scene_.fields[field_name::pressure].values(), pressure, flow_.pressure_is_free()));
  }
  return Outcome::done();
}

}  // namespace malleus::forge
