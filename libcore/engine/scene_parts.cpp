#include "engine/scene_parts.hpp"

namespace malleus {
namespace {

bool depends_on_position(const std::optional<Expression>& formula) {
  return formula && formula->depends_on_position();
}

/// Whether a boundary's conditions are the same all over it; its vectors go to the parts.
bool add_conditions(const BoundarySettings& boundary, SceneParts& parts) {
  if (depends_on_position(boundary.pressure) || depends_on_position(boundary.temperature) ||
      depends_on_position(boundary.heat_flux)) {
    return false;
  }
  const std::array<Expression, 3> traction = boundary.imposed_traction();
  return parts.add_vector(boundary.imposed_velocity()) && parts.add_vector({traction[0], traction[1], traction[2]});
}

}  // namespace

void SceneParts::add_class(int group, bool is_symmetry) {
  class_of_group[static_cast<std::size_t>(group + 1)] = static_cast<int>(is_symmetry_plane.size());
  is_symmetry_plane.push_back(is_symmetry ? 1 : 0);
}

bool SceneParts::add_vector(const ExpressionVector& components) {
  std::array<Real, 3> vector = {};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!components[c]) continue;
    if (components[c]->depends_on_position()) return false;
    vector[c] = components[c]->is_constant() ? (*components[c])({}, 0) : 1;
  }
  vectors.push_back(vector);
  return true;
}

std::optional<SceneParts> parts_of_common_sections(const Mesh& mesh, const CommonSections& sections) {
  SceneParts parts;
  parts.class_of_group.assign(mesh.group_names.size() + 1, 0);
  parts.is_symmetry_plane.assign(1, 0);
  for (const BoundarySettings& boundary : sections.boundaries) {
    const bool is_symmetry = boundary.type == BoundarySettings::Type::symmetry;
    parts.add_class(mesh.find_group(boundary.group), is_symmetry);
    if (!is_symmetry && !add_conditions(boundary, parts)) return std::nullopt;
  }
  if (sections.gravity) parts.vectors.push_back(sections.gravity->acceleration);
  if (const auto& force = sections.body_force) {
    if (!parts.add_vector({force->force[0], force->force[1], force->force[2]})) return std::nullopt;
  }
  if (sections.thermal && sections.thermal->initial.depends_on_position()) return std::nullopt;
  return parts;
}

}  // namespace malleus
