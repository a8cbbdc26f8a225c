#include "forge/forge_budget.hpp"

#include <fmt/format.h>

#include <cmath>

namespace malleus::forge {
namespace {

ErrorShare share_of_time(const Scene& scene, const RunMeasures& run) {
  const Real strain = run.largest_strain_step;
  ErrorShare share;
  share.source = "time";
  share.knob = run.gives_step ? "[time] step" : "[motion] strain";
  share.factor = 0.7;
  share.cost = 1.4;
  if (scene.motion.scheme == TimeScheme::euler) {
    share.relative = 0.3 * strain;
    share.basis = fmt::format("Euler with {:.2g} % of strain in a step", 100 * strain);
    share.factor = 0.5;
    share.cost = 2;
    return share;
  }
  share.relative = std::hypot(run.forces.returned, run.raw_volume_drift / 2);
  share.basis = fmt::format("volume that steps of {:.2g} % of strain lost, and the flow that returns it", 100 * strain);
  return share;
}

ErrorShare share_of_contact(const Scene& scene, const RunMeasures& run) {
  ErrorShare share;
  share.source = "contact";
  share.relative = run.forces.contact;
  share.basis = fmt::format("power of the contacts on what c = {:g} lets through", scene.penalty.penalty);
  share.knob = "[penalty] penalty";
  share.factor = 2;
  share.cost = 1.05;
  if (!scene.penalty.augmented) return share;
  share.knob = "[penalty] penetration";
  share.factor = 0.5;
  share.cost = 1.1;
  return share;
}

}  // namespace

ErrorBudget forge_error_budget(const Scene& scene, const RunMeasures& run) {
  ErrorBudget budget;
  budget.add(share_of_time(scene, run));
  if (!scene.tools.empty() || !scene.pairs.empty()) budget.add(share_of_contact(scene, run));
  budget.add({"volume", std::abs(run.volume_change), "change of the bodies' volume, after its targets",
              run.gives_step ? "[time] step" : "[motion] strain", 0.7, 1.4});
  budget.add({"nonlinear", run.forces.nonlinear / 2, "half of the residuals that Newton's method ended with",
              "[solver] newton_tolerance", 0.5, 1.05});
  const Real linear = scene.solver.linear_tolerance;
  budget.add({"linear", linear, fmt::format("the tolerance {:g} of the last linear solve", linear),
              "[solver] linear_tolerance", 0.5, 1.03});
  budget.add({"balance", run.forces.balance, "half of the forces that are left over, relative to the largest",
              "[solver] newton_tolerance", 0.5, 1.05});
  if (!scene.viscosity->is_linear()) {
    const Real cutoff = scene.solver.cutoff_strain_rate;
    budget.add({"cut-off", run.forces.cut_off, fmt::format("Newtonian below {:g} of the reference rate", cutoff),
                "[solver] cutoff_strain_rate", 0.7, 1.02});
  }
  return budget;
}

}  // namespace malleus::forge
