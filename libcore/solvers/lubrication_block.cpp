#include "solvers/lubrication_block.hpp"

#include <array>
#include <cmath>
#include <numeric>

#include "base/index.hpp"
#include "mesh/simplex.hpp"
#include "mesh/space_filling_curve.hpp"
#include "solvers/bordered_preconditioner.hpp"
#include "solvers/graph_assembler.hpp"

namespace malleus {
namespace {

/// Domains shorter than this many gaps have no lubrication.
constexpr Real least_slenderness = 4;
constexpr Real development = 0.7;  ///< exchange at an opening, see the header
/// Share of the mass matrix that keeps the block regular where the pressure is free.
constexpr Real shift = 1e-7;

/// What the block is made of, before its solver.
class Builder {
 public:
  Builder(const BorderedOperator& op, const StokesBlocks& blocks)
      : system_(op.system()), blocks_(blocks), mesh_(*system_.mesh), scale_(system_.pressure_scale) {}

  bool find_mobility() {
    Real held = 0;
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) held += is_held(node) ? 1 : 0;
    if (system_.comm->sum(held) == 0 && system_.element_inertia.empty()) return false;
    std::vector<Real> values(index(blocks_.graph.entries()), 0.0);
    std::vector<Real> load(index(mesh_.nodes()), 0.0);
    assemble_speed(values, load);
    mesh_.node_halo.add_to_owners(std::span(load), 1);
    load.resize(index(mesh_.owned_nodes()));
    constexpr Real tolerance = 1e-2;
    constexpr int most = 200;  // the walls are near where it matters
    const ScalarMatrix speed{*system_.comm, blocks_.layout, blocks_.graph, std::move(values)};
    mobility_ = solve_conjugate_gradients(speed, load, tolerance, most);
    for (Real& value : mobility_) value = std::max(value, 0.0);
    mobility_.resize(index(mesh_.nodes()));
    mesh_.node_halo.update_copies(std::span(mobility_), 1);
    return is_thin();
  }

  std::vector<Real> assemble() {
    std::vector<Real> values(blocks_.pressure.begin(), blocks_.pressure.end());
    values.resize(index(blocks_.graph.entries()));
    GraphAssembler<Real> assembler(system_, blocks_.layout, blocks_.graph, values);
    const Real factor = blocks_.scaling * scale_ * scale_;
    for_each_element([&](const auto& gradients, LocalId element) {
      const auto nodes = mesh_.nodes_of_element(element);
      const Real volume = system_.element_volume[index(element)];
      const Real mass = shift * volume / system_.element_viscosity[index(element)];
      const Real weight = volume * mobility(element);
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        if (system_.constraints->is_pressure_fixed(nodes[a])) continue;
        for (std::size_t b = 0; b < nodes.size(); ++b) {
          if (system_.constraints->is_pressure_fixed(nodes[b])) continue;
          const Real product =
              gradients.col(static_cast<Eigen::Index>(a)).dot(gradients.col(static_cast<Eigen::Index>(b)));
          assembler.add(nodes[a], nodes[b], factor * (weight * product + (a == b ? mass : 0)));
        }
      }
    });
    assembler.finish();
    add_openings(values);
    return values;
  }

  /// Exchange of the nodes with each border's pressure: [border][owned node].
  const std::vector<std::vector<Real>>& border_columns() const { return border_columns_; }

 private:
  bool is_held(LocalId node) const { return system_.constraints->fixed_directions(node) == mesh_.dim; }

  Real mobility(LocalId element) const {
    Real sum = 0;
    const auto nodes = mesh_.nodes_of_element(element);
    for (const LocalId node : nodes) sum += mobility_[index(node)];
    return sum / static_cast<Real>(nodes.size());
  }

  template <class Work>
  void for_each_element(Work work) const {
    with_dim(mesh_.dim, [&](auto d) {
      for (LocalId element = 0; element < mesh_.elements(); ++element) {
        if (!(system_.element_viscosity[index(element)] > 0)) continue;
        work(p1_gradients<d>(simplex_points<d>(mesh_, element)).gradients, element);
      }
    });
  }

  void assemble_speed(std::vector<Real>& values, std::vector<Real>& load) {
    GraphAssembler<Real> assembler(system_, blocks_.layout, blocks_.graph, values);
    for_each_element([&](const auto& gradients, LocalId element) {
      const auto nodes = mesh_.nodes_of_element(element);
      const Real volume = system_.element_volume[index(element)];
      const Real weight = volume * system_.element_viscosity[index(element)];
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        if (is_held(nodes[a])) continue;
        const Real share = volume / static_cast<Real>(nodes.size());
        if (!system_.element_inertia.empty()) {
          assembler.add(nodes[a], nodes[a], share * system_.element_inertia[index(element)]);
        }
        load[index(nodes[a])] += share;
        for (std::size_t b = 0; b < nodes.size(); ++b) {
          if (is_held(nodes[b])) continue;
          const Real product =
              gradients.col(static_cast<Eigen::Index>(a)).dot(gradients.col(static_cast<Eigen::Index>(b)));
          assembler.add(nodes[a], nodes[b], weight * product);
        }
      }
    });
    assembler.finish();
  }

  /// The gap H of mean H^2 = 12 eta psi, against the diagonal of the domain's box.
  bool is_thin() const {
    std::array<Real, 2> sums = {0, 0};
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      const Real viscosity = system_.element_viscosity[index(element)];
      if (!(viscosity > 0)) continue;
      sums[0] += system_.element_volume[index(element)] * 12 * viscosity * mobility(element);
      sums[1] += system_.element_volume[index(element)];
    }
    system_.comm->sum_in_place(std::span(sums));
    const Box box = bounding_box(*system_.comm, mesh_.coordinates, mesh_.dim);
    Real square = 0;
    for (std::size_t c = 0; c < static_cast<std::size_t>(mesh_.dim); ++c)
      square += std::pow(box.high[c] - box.low[c], 2);
    return square * sums[1] > least_slenderness * least_slenderness * sums[0];
  }

  /// Volume-weighted geometric mean of the viscosities around the nodes.
  std::vector<Real> viscosity_of_nodes() const {
    std::vector<Real> sums(2 * index(mesh_.nodes()), 0.0);
    for (LocalId element = 0; element < mesh_.elements(); ++element) {
      const Real viscosity = system_.element_viscosity[index(element)];
      if (!(viscosity > 0)) continue;
      for (const LocalId node : mesh_.nodes_of_element(element)) {
        sums[2 * index(node)] += system_.element_volume[index(element)] * std::log(viscosity);
        sums[2 * index(node) + 1] += system_.element_volume[index(element)];
      }
    }
    mesh_.node_halo.add_to_owners(std::span(sums), 2);
    std::vector<Real> viscosity(index(mesh_.owned_nodes()), 1.0);
    for (std::size_t node = 0; node < viscosity.size(); ++node) {
      if (sums[2 * node + 1] > 0) viscosity[node] = std::exp(sums[2 * node] / sums[2 * node + 1]);
    }
    return viscosity;
  }

  /// [owned node][dim] forces of a pressure of one everywhere: on the openings, and rounding elsewhere.
  std::vector<Real> push_of_pressure() const {
    const auto dim = index(mesh_.dim);
    std::vector<Real> push(index(blocks_.graph.rows()) * dim, 0.0);
    for (std::size_t row = 0; row < index(blocks_.graph.rows()); ++row) {
      for (LocalId k = blocks_.graph.offsets[row]; k < blocks_.graph.offsets[row + 1]; ++k) {
        for (std::size_t d = 0; d < dim; ++d) push[row * dim + d] += static_cast<Real>(blocks_.gradient.at(k)[d]);
      }
    }
    return push;
  }

  Real norm(const Real* force) const { return std::hypot(force[0], force[1], mesh_.dim == 3 ? force[2] : 0); }

  /// What a node's pressure exchanges with the other side of an opening that pushes on it with that force.
  Real exchange(std::size_t row, const Real* force, Real viscosity) const {
    return scale_ * development * std::sqrt(mobility_[row] / viscosity) * norm(force);
  }

  void add_to_diagonal(std::size_t row, Real value, std::vector<Real>& values) const {
    if (system_.constraints->is_pressure_fixed(static_cast<LocalId>(row))) return;
    values[index(blocks_.graph.diagonals[row])] += value;
  }

  /// Exchange with the borders' pressures, and with none outside where no border pushes back.
  void add_openings(std::vector<Real>& values) {
    const auto dim = index(mesh_.dim);
    const auto rows = index(blocks_.graph.rows());
    const std::vector<Real> viscosity = viscosity_of_nodes();
    std::vector<Real> push = push_of_pressure();
    for (const BorderColumn& border : system_.borders) {
      std::vector<Real>& column = border_columns_.emplace_back(rows, 0.0);
      for (std::size_t k = 0; k < border.nodes.size(); ++k) {
        const std::size_t row = index(border.nodes[k]);
        std::array<Real, 3> force{};
        for (std::size_t d = 0; d < dim; ++d) {
          force[d] = blocks_.scaling * border.values[k * dim + d];
          push[row * dim + d] += force[d];
        }
        column[row] = exchange(row, force.data(), viscosity[row]);
        add_to_diagonal(row, column[row], values);
      }
    }
    Real largest = 0;
    for (std::size_t row = 0; row < rows; ++row) largest = std::max(largest, norm(push.data() + row * dim));
    const Real rounding = 1e-5 * system_.comm->max(largest);
    for (std::size_t row = 0; row < rows; ++row) {
      const Real* force = push.data() + row * dim;
      if (norm(force) > rounding) add_to_diagonal(row, exchange(row, force, viscosity[row]), values);
    }
  }

  const LinearSystem& system_;
  const StokesBlocks& blocks_;
  const Mesh& mesh_;
  Real scale_;
  std::vector<Real> mobility_;  ///< [node] psi, m^2/(Pa.s)
  std::vector<std::vector<Real>> border_columns_;
};

}  // namespace

std::unique_ptr<LubricationBlock> LubricationBlock::make_where_thin(const BorderedOperator& op,
                                                                    const StokesBlocks& blocks) {
  Builder builder(op, blocks);
  if (!builder.find_mobility()) return nullptr;
  std::unique_ptr<LubricationBlock> block(new LubricationBlock);
  block->comm_ = op.system().comm;
  const ScalarMatrix matrix{*block->comm_, blocks.layout, blocks.graph, builder.assemble()};
  block->cycle_ = make_scalar_multigrid(matrix);
  const auto precondition = [&](const Real* residual, Real* correction) { block->cycle_->apply(residual, correction); };
  const auto borders = static_cast<Eigen::Index>(op.borders());
  Eigen::MatrixXd schur = Eigen::MatrixXd::Zero(borders, borders);
  for (Eigen::Index j = 0; j < borders; ++j) {
    const std::vector<Real>& exchange = builder.border_columns()[static_cast<std::size_t>(j)];
    constexpr Real tolerance = 1e-6;
    constexpr int most = 60;
    block->columns_.push_back(solve_conjugate_gradients(matrix, exchange, precondition, tolerance, most));
    const Real total = block->comm_->sum(std::accumulate(exchange.begin(), exchange.end(), 0.0));
    schur(j, j) += total - op.system().borders[static_cast<std::size_t>(j)].diagonal;
    for (Eigen::Index i = 0; i < borders; ++i) {
      const std::vector<Real>& other = builder.border_columns()[static_cast<std::size_t>(i)];
      const Real through = std::inner_product(other.begin(), other.end(), block->columns_.back().begin(), 0.0);
      schur(i, j) -= block->comm_->sum(through);
    }
  }
  block->border_inverse_ = symmetric_pseudo_inverse(schur, true);
  block->corrected_.resize(index(blocks.graph.rows()));
  return block;
}

void LubricationBlock::add(const Real* residual, std::span<const Real> border_residual, Real factor,
                           std::vector<float>& correction, Eigen::VectorXd& border_correction) {
  cycle_->apply(residual, corrected_.data());
  std::vector<Real> sums(columns_.size());
  for (std::size_t j = 0; j < columns_.size(); ++j) {
    sums[j] = std::inner_product(columns_[j].begin(), columns_[j].end(), residual, 0.0);
  }
  comm_->sum_in_place(std::span(sums));
  for (std::size_t j = 0; j < sums.size(); ++j) sums[j] += border_residual[j];
  const Eigen::VectorXd q = border_inverse_ * Eigen::Map<const Eigen::VectorXd>(sums.data(), border_inverse_.rows());
  for (std::size_t j = 0; j < columns_.size(); ++j) {
    for (std::size_t i = 0; i < corrected_.size(); ++i)
      corrected_[i] += q[static_cast<Eigen::Index>(j)] * columns_[j][i];
  }
  for (std::size_t i = 0; i < corrected_.size(); ++i) correction[i] += static_cast<float>(factor * corrected_[i]);
  border_correction += factor * q;
}

std::size_t LubricationBlock::bytes() const {
  return cycle_->bytes() + sizeof(Real) * (corrected_.size() + columns_.size() * corrected_.size());
}

}  // namespace malleus
