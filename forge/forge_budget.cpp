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
  switch (scene.motion.scheme) {
    case TimeScheme::adams_bashforth_2:
      share.relative = 1.2 * strain * strain;
      share.basis = fmt::format("Adams-Bashforth 2 with {:.2g} % of strain in a step", 100 * strain);
      break;
    case TimeScheme::runge_kutta_2:
      share.relative = 0.4 * strain * strain;
      share.basis = fmt::format("Runge-Kutta 2 with {:.2g} % of strain in a step", 100 * strain);
      break;
    case TimeScheme::euler:
      share.relative = 0.3 * strain;
      share.basis = fmt::format("Euler with {:.2g} % of strain in a step", 100 * strain);
      share.factor = 0.5;
      share.cost = 2;
      break;
  }
  return share;
}

ErrorShare share_of_contact(const Scene& scene, const RunMeasures& run) {
  if (scene.penalty.augmented) {
    const Real relative = run.travel > 0 ? run.max_penetration / run.travel : 0;
    return {"contact",
            relative,
            fmt::format("deepest penetration {:.2g} m of {:.2g} m of stroke", run.max_penetration, run.travel),
            "[penalty] penetration",
            0.5,
            1.1};
  }
  return {"contact",
          0.1 / scene.penalty.penalty,
          fmt::format("penalty c = {:g}: 0.1/c", scene.penalty.penalty),
          "[penalty] penalty",
          2,
          1.05};
}

}  // namespace

ErrorBudget forge_error_budget(const Scene& scene, const RunMeasures& run) {
  ErrorBudget budget;
  budget.add(share_of_time(scene, run));
  if (!scene.tools.empty() || !scene.pairs.empty()) budget.add(share_of_contact(scene, run));
  budget.add({"volume", std::abs(run.volume_change), "change of the bodies' volume, after its targets",
              run.gives_step ? "[time] step" : "[motion] strain", 0.7, 1.4});
  const Real newton = scene.solver.newton_tolerance;
  budget.add({"nonlinear", 0.5 * newton, fmt::format("half the tolerance {:g}", newton), "[solver] newton_tolerance",
              0.5, 1.05});
  const Real linear = scene.solver.linear_tolerance;
  budget.add({"linear", linear, fmt::format("the tolerance {:g} of the last linear solve", linear),
              "[solver] linear_tolerance", 0.5, 1.03});
  budget.add({"balance", run.force_imbalance, "forces that are left over, relative to the largest",
              "[solver] newton_tolerance", 0.5, 1.05});
  if (!scene.viscosity->is_linear()) {
    const Real cutoff = scene.solver.cutoff_strain_rate;
    budget.add({"cut-off", 0.6 * cutoff * cutoff, fmt::format("Newtonian below {:g} of the reference rate", cutoff),
                "[solver] cutoff_strain_rate", 0.7, 1.02});
  }
  return budget;
}

}  // namespace malleus::forge
