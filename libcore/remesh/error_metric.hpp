#pragma once

/// Metrics that spread the interpolation error of a field evenly.

#include "field/field.hpp"
#include "remesh/metric.hpp"

namespace malleus {

struct ErrorMetricOptions {
  bool anisotropic = false;  ///< tensors that follow the field's curvature; else one size per node
  Real smallest = 1e-100;    ///< m
  Real largest = 1e100;      ///< m
};

/// The metric of a node field with about `nodes` nodes for which the error of linear interpolation in L2 is least
/// (Loseille and Alauzet 2011): M ~ det(H)^(-1/(4+D)) H with H the absolute Hessian of the field, summed over its
/// components. Hessians are recovered by averaging gradients over the elements at a node, twice; boundary nodes take
/// the mean of their inner neighbours. Where the field is linear the sizes are `largest`, or those that the count
/// leaves. Collective.
Metric error_metric(const Communicator& comm, const Mesh& mesh, const Field& field, Real nodes,
                    const ErrorMetricOptions& options);

/// Sizes for which the estimated relative error of a field's gradient in L2 is `error`, spread evenly over the
/// elements. The estimate (Zienkiewicz and Zhu 1987) is the distance of the gradient to its recovered mean at the
/// nodes; sizes by Diez and Huerta (1999) for an error of first order. Where the field is linear: `largest`, but no
/// more than four times the present size. Collective.
Metric error_sizes(const Communicator& comm, const Mesh& mesh, const Field& field, Real error,
                   const ErrorMetricOptions& options);

}  // namespace malleus
