#pragma once

/// The metric that `meshtool refine` works towards.

#include "field/field.hpp"
#include "meshtool/refine_options.hpp"
#include "remesh/metric.hpp"

namespace malleus::meshtool {

/// By size, metric file, or node count (with or without an error's field), bounded and graded as asked. numbers: node
/// numbers in the input file, [node]; empty where the file has none. InputError. Collective.
Metric wanted_metric(const Communicator& comm, const Mesh& mesh, const FieldStore& fields,
                     const std::vector<GlobalId>& numbers, const RefineOptions& options);

}  // namespace malleus::meshtool
