#include "support/sticking_block.hpp"

#include "fem/boundary_conditions.hpp"

namespace malleus::test {

StickingBlock::StickingBlock(const Communicator& comm, const BoxMeshOptions& box, Real sensitivity, Real cut_off)
    : mesh(box_mesh(comm, box)), op(comm, mesh, Geometry::plane) {
  std::vector<std::unique_ptr<const ViscousLaw>> laws;
  laws.push_back(std::make_unique<NortonHoffLaw>(NortonHoff{2, sensitivity, cut_off}));
  model = std::make_unique<RegionViscosity>(std::move(laws));
  std::vector<BoundaryCondition> conditions(2);
  conditions[0].group = mesh.find_group("y_low");
  conditions[1].group = mesh.find_group("y_high");
  conditions[1].kind = ConditionKind::velocity;
  conditions[1].velocity = {Expression(0), Expression(-1), std::nullopt};
  if (mesh.dim == 3) conditions[1].velocity[2] = Expression(0);
  op.set_viscosity(*model);
  op.set_constraints(make_constraints(comm, mesh, Geometry::plane, conditions, 0));
  op.prepare();
}

}  // namespace malleus::test
