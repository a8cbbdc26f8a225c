#include "solvers/stokes_preconditioner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/index.hpp"
#include "solvers/bordered_preconditioner.hpp"
#include "solvers/gamg_velocity.hpp"
#include "solvers/viscosity_range.hpp"

namespace malleus {
namespace {

constexpr Real rigid_contrast = 30;
constexpr Real double_contrast = 1e6;

const char* name_of(CoarseModes modes) {
  return modes == CoarseModes::rigid ? "rigid-body modes" : "translations";
}

/// The finest level of the velocity block; takes the values and copies layout and graph.
MultigridLevel finest_level(const LinearSystem& system, StokesBlocks& blocks) {
  MultigridLevel level;
  const Mesh& mesh = *system.mesh;
  level.layout = blocks.layout;
  level.graph = blocks.graph;
  level.values = std::move(blocks.velocity);
  level.points.assign(mesh.coordinates.begin(),
                      mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(mesh.owned_nodes()) * mesh.dim);
  level.left_out.resize(index(mesh.owned_nodes()));
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    level.left_out[index(node)] = system.constraints->fixed_directions(node) == mesh.dim;
  }
  return level;
}

}  // namespace

PreconditionerSettings resolve(PreconditionerSettings settings, const LinearSystem& system) {
  const Real contrast = viscosity_range(system).contrast();
  if (settings.modes == CoarseModes::automatic) {
    settings.modes = contrast > rigid_contrast ? CoarseModes::rigid : CoarseModes::translations;
  }
  if (settings.precision == CyclePrecision::automatic) {
    // Methods that rely on symmetry stall at 1e-6 with the rounding of a cycle in single precision.
    const bool wants_double = settings.positive || contrast > double_contrast;
    settings.precision = wants_double ? CyclePrecision::double_precision : CyclePrecision::single_precision;
  }
  return settings;
}

StokesPreconditioner::StokesPreconditioner(const BorderedOperator& op, const PreconditionerSettings& settings)
    : settings_(settings), operator_(&op), blocks_(extract_blocks(op.system(), settings.precision)) {
  const LinearSystem& system = op.system();
  pressure_ = std::make_unique<PressureBlock>(system, blocks_, settings_.chebyshev_steps);
  lubrication_ = LubricationBlock::make_where_thin(op, blocks_);
  find_pockets(system);
  blocks_.pressure = {};
  pressure_residual_.assign(index(blocks_.graph.rows()), 0.0F);
  pressure_correction_.assign(index(blocks_.layout.size()), 0.0F);
  velocity_residual_.assign(index(blocks_.graph.rows()) * index(system.mesh->dim), 0.0);
  velocity_correction_ = velocity_residual_;
  MultigridLevel finest = finest_level(system, blocks_);
  if (settings_.velocity == VelocityMethod::gamg) {
    velocity_ = make_gamg_velocity(*system.comm, finest, *system.constraints, settings_.modes == CoarseModes::rigid);
  } else {
    MultigridSettings multigrid;
    multigrid.rigid_modes = settings_.modes == CoarseModes::rigid;
    multigrid.double_precision = settings_.precision == CyclePrecision::double_precision;
    multigrid.threshold = settings_.threshold;
    velocity_ = make_velocity_multigrid(*system.comm, std::move(finest), *system.constraints, multigrid);
  }
  make_border_block();
}

/// [pocket] e_k^T C e_k, in the blocks' scaling, by the entries that lead out of the pocket: rows of C sum up to zero,
/// and those inside would leave their rounding.
std::vector<Real> StokesPreconditioner::pocket_compliance(std::size_t count) const {
  std::vector<Real> sums(count, 0.0);
  for (const std::vector<GlobalId>& pocket_of : pocket_of_node_) {
    for (LocalId row = 0; row < blocks_.graph.rows(); ++row) {
      const GlobalId pocket = pocket_of[index(row)];
      if (pocket < 0) continue;
      for (LocalId k = blocks_.graph.offsets[index(row)]; k < blocks_.graph.offsets[index(row) + 1]; ++k) {
        if (pocket_of[index(blocks_.graph.columns[index(k)])] == pocket) continue;
        sums[static_cast<std::size_t>(pocket)] -= static_cast<Real>(blocks_.pressure[index(k)]);
      }
    }
  }
  operator_->system().comm->sum_in_place(std::span(sums));
  return sums;
}

void StokesPreconditioner::find_pockets(const LinearSystem& system) {
  const SoftPockets pockets = find_soft_pockets(system);
  open_regions_ = pockets.open;
  if (pockets.count() == 0) return;
  for (const std::vector<std::int32_t>* of_node : {&pockets.of_node, &pockets.part}) {
    std::vector<GlobalId>& labels = pocket_of_node_.emplace_back(index(blocks_.layout.size()), -1);
    std::copy(of_node->begin(), of_node->end(), labels.begin());
    blocks_.layout.halo.update_copies(std::span(labels), 1);
  }
  // A sphere in an unbounded fluid has 0.75 V/eta; anything from that to ten times as much serves.
  constexpr Real factor = 1.5;
  const Real scale = system.pressure_scale * system.pressure_scale * blocks_.scaling;
  const std::vector<Real> compliance = pocket_compliance(pockets.volume.size());
  for (std::size_t k = 0; k < pockets.volume.size(); ++k) {
    const Real outside = factor * scale * (pockets.volume[k] / pockets.outside_viscosity[k] + pockets.rim[k]);
    pocket_weights_.push_back(1 / (outside + std::max(compliance[k], 0.0)));
  }
}

/// Adds the pockets' constants to the pressure's correction, copies included.
void StokesPreconditioner::add_pockets(const Real* residual) {
  if (pocket_weights_.empty()) return;
  const auto dim = index(operator_->system().mesh->dim);
  const Real sign = settings_.positive ? 1.0 : -1.0;
  std::vector<Real> sums(pocket_weights_.size(), 0.0);
  for (const std::vector<GlobalId>& pocket_of : pocket_of_node_) {
    for (std::size_t node = 0; node < index(blocks_.graph.rows()); ++node) {
      if (pocket_of[node] < 0) continue;
      sums[static_cast<std::size_t>(pocket_of[node])] += sign * residual[node * (dim + 1) + dim];
    }
  }
  operator_->system().comm->sum_in_place(std::span(sums));
  for (const std::vector<GlobalId>& pocket_of : pocket_of_node_) {
    for (std::size_t node = 0; node < pocket_of.size(); ++node) {
      if (pocket_of[node] < 0) continue;
      const auto pocket = static_cast<std::size_t>(pocket_of[node]);
      pressure_correction_[node] += static_cast<float>(sums[pocket] * pocket_weights_[pocket]);
    }
  }
}

void StokesPreconditioner::make_border_block() {
  const int borders = operator_->borders();
  const auto dim = index(operator_->system().mesh->dim);
  Eigen::MatrixXd schur(borders, borders);
  std::vector<Real> column(operator_->node_unknowns());
  for (int j = 0; j < borders; ++j) {
    std::vector<Real> unit(static_cast<std::size_t>(borders), 0.0);
    unit[static_cast<std::size_t>(j)] = 1;
    std::fill(column.begin(), column.end(), 0.0);
    operator_->add_borders(unit, 1.0, column.data());
    for (std::size_t node = 0; node < index(blocks_.graph.rows()); ++node) {
      for (std::size_t d = 0; d < dim; ++d) velocity_residual_[node * dim + d] = column[node * (dim + 1) + d];
    }
    solve_velocity(velocity_residual_, column.data());
    const std::vector<Real> products = operator_->border_products(column.data());
    for (int i = 0; i < borders; ++i) schur(i, j) = -products[static_cast<std::size_t>(i)];
    schur(j, j) += operator_->system().borders[static_cast<std::size_t>(j)].diagonal;
  }
  border_inverse_ = symmetric_pseudo_inverse(schur, settings_.positive);
}

/// correction: [owned node][dim+1], of which the velocities are written.
void StokesPreconditioner::solve_velocity(std::vector<Real>& right_side, Real* correction) {
  velocity_->apply(right_side.data(), velocity_correction_.data());
  const auto dim = index(operator_->system().mesh->dim);
  for (std::size_t node = 0; node < index(blocks_.graph.rows()); ++node) {
    for (std::size_t d = 0; d < dim; ++d) {
      correction[node * (dim + 1) + d] = blocks_.scaling * velocity_correction_[node * dim + d];
    }
  }
}

void StokesPreconditioner::apply(const Real* residual, Real* correction) {
  const auto dim = index(operator_->system().mesh->dim);
  const auto rows = index(blocks_.graph.rows());
  for (std::size_t node = 0; node < rows; ++node) {
    for (std::size_t d = 0; d < dim; ++d) velocity_residual_[node * dim + d] = residual[node * (dim + 1) + d];
  }
  const Eigen::VectorXd q = solve_pressures(residual);
  for (std::size_t node = 0; node < rows; ++node) {
    correction[node * (dim + 1) + dim] = blocks_.scaling * static_cast<Real>(pressure_correction_[node]);
  }
  if (!settings_.positive) {
    with_block(static_cast<int>(dim), [&](auto block) { subtract_gradient<block>(); });
  }
  if (q.size() > 0) {
    if (operator_->system().comm->is_root()) std::copy(q.begin(), q.end(), correction + operator_->node_unknowns());
    if (!settings_.positive) {
      operator_->subtract_borders({q.data(), static_cast<std::size_t>(q.size())}, velocity_residual_.data());
    }
  }
  solve_velocity(velocity_residual_, correction);
}

template <int D>
void StokesPreconditioner::subtract_gradient() {
  for (std::size_t node = 0; node < index(blocks_.graph.rows()); ++node) {
    std::array<float, D> sum{};
    for (LocalId k = blocks_.graph.offsets[node]; k < blocks_.graph.offsets[node + 1]; ++k) {
      const float p = pressure_correction_[index(blocks_.graph.columns[index(k)])];
      for (std::size_t d = 0; d < D; ++d) sum[d] += blocks_.gradient.values[index(k) * D + d] * p;
    }
    for (std::size_t d = 0; d < D; ++d) velocity_residual_[node * D + d] -= static_cast<Real>(sum[d]);
  }
}

/// Fills the pressure's correction, copies included, in the blocks' scaling; returns the borders'.
Eigen::VectorXd StokesPreconditioner::solve_pressures(const Real* residual) {
  const auto dim = index(operator_->system().mesh->dim);
  const Real sign = settings_.positive ? 1.0 : -1.0;
  std::vector<Real> wanted(index(blocks_.graph.rows()));
  for (std::size_t node = 0; node < wanted.size(); ++node) {
    wanted[node] = residual[node * (dim + 1) + dim];
    pressure_residual_[node] = static_cast<float>(sign * wanted[node]);
  }
  const std::vector<Real> rest = operator_->border_values(residual);
  Eigen::VectorXd q = border_inverse_ * Eigen::Map<const Eigen::VectorXd>(rest.data(), border_inverse_.rows());
  pressure_->apply(pressure_residual_.data(), pressure_correction_);
  if (lubrication_) {
    Eigen::VectorXd along = Eigen::VectorXd::Zero(q.size());
    lubrication_->add(wanted.data(), rest, sign, pressure_correction_, along);
    blocks_.layout.halo.update_copies(std::span(pressure_correction_), 1);
    q += blocks_.scaling * along;
  }
  add_pockets(residual);
  return q;
}

std::string StokesPreconditioner::summary() const {
  if (settings_.velocity == VelocityMethod::gamg) {
    return fmt::format("GAMG with {}, {} levels, complexity {:.2f}", name_of(settings_.modes),
                       velocity_->levels().size(), velocity_->operator_complexity());
  }
  return fmt::format("multigrid with {} in {} precision, {} levels, complexity {:.2f}", name_of(settings_.modes),
                     settings_.precision == CyclePrecision::double_precision ? "double" : "single",
                     velocity_->levels().size(), velocity_->operator_complexity());
}

std::string StokesPreconditioner::table() const {
  std::string text = summary() + "\n";
  for (const MultigridLevelSummary& level : velocity_->levels()) {
    text += fmt::format("  {:>12} nodes of {} unknowns, {:5.1f} entries a row, on {} ranks\n", level.nodes, level.block,
                        level.entries_per_row, level.active_ranks);
  }
  text += fmt::format("pressure: {} Chebyshev steps on [{:.2f}, {:.2f}]\n", settings_.chebyshev_steps,
                      pressure_->bounds().low, pressure_->bounds().high);
  if (lubrication_) text += "with the flow along thin sections\n";
  if (!pocket_weights_.empty() || open_regions_ > 0) {
    text +=
        fmt::format("{} closed soft pockets deflated, {} soft regions open\n", pocket_weights_.size(), open_regions_);
  }
  return text;
}

std::size_t StokesPreconditioner::bytes() const {
  return velocity_->bytes() + pressure_->bytes() + (lubrication_ ? lubrication_->bytes() : 0) +
         sizeof(float) * blocks_.gradient.values.size() + sizeof(LocalId) * blocks_.graph.columns.size() +
         sizeof(Real) * (velocity_residual_.size() + velocity_correction_.size());
}

}  // namespace malleus
