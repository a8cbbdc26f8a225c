#pragma once

/// Fields in files: their description, and values side by side.

#include <nlohmann/json.hpp>
#include <vector>

#include "field/field.hpp"

namespace malleus {

/// The specs of all fields of a store, in order, and back. Local.
nlohmann::json describe_fields(const FieldStore& fields);
std::vector<FieldSpec> field_specs(const nlohmann::json& list);

/// From values field by field to rows [entity][components of all fields of that support]. Local.
std::vector<Real> interleave_fields(const std::vector<FieldSpec>& specs, const std::vector<std::vector<Real>>& values,
                                    Support support, std::size_t entities);

}  // namespace malleus
