#include "solvers/pressure_block.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/error.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

std::size_t index(LocalId i) {
  return static_cast<std::size_t>(i);
}

/// A number for an entry of a row that another rank owns.
struct ForeignEntry {
  GlobalId row;
  GlobalId column;
  Real value;
};

/// M(1/eta)/2 of this rank's elements on the rows of a graph, with what belongs to rows of other ranks.
class MassAssembler {
 public:
  MassAssembler(const LinearSystem& system, const BlockLayout& layout, const BlockGraph& graph,
                std::vector<float>& values)
      : system_(system), layout_(layout), graph_(graph), values_(values) {}

  void run(Real scaling) {
    const Mesh& mesh = *system_.mesh;
    const Real scale = 0.5 * scaling * system_.pressure_scale * system_.pressure_scale;
    for (LocalId element = 0; element < mesh.elements(); ++element) {
      const Real viscosity = system_.element_viscosity[index(element)];
      if (viscosity > 0) add_element(element, scale * system_.element_volume[index(element)] / viscosity);
    }
    for (const auto& [rank, entries] : sparse_exchange(*system_.comm, foreign_)) {
      for (const ForeignEntry& entry : entries) {
        add(static_cast<LocalId>(entry.row - layout_.ownership.begin()), layout_.local(entry.column), entry.value);
      }
    }
  }

 private:
  void add_element(LocalId element, Real weight) {
    const Mesh& mesh = *system_.mesh;
    const int dim = mesh.dim;
    const Real entry = weight / ((dim + 1) * (dim + 2));
    const auto nodes = mesh.nodes_of_element(element);
    for (const LocalId row : nodes) {
      if (system_.constraints->is_pressure_fixed(row)) continue;
      for (const LocalId column : nodes) {
        if (system_.constraints->is_pressure_fixed(column)) continue;
        const Real value = row == column ? 2 * entry : entry;
        const GlobalId number = mesh.global_node(column);
        if (row < mesh.owned_nodes()) {
          add(row, layout_.local(number), value);
        } else {
          const GlobalId row_number = mesh.global_node(row);
          foreign_[mesh.node_ownership.owner_of(row_number)].push_back({row_number, number, value});
        }
      }
    }
  }

  void add(LocalId row, LocalId column, Real value) {
    const auto begin = graph_.columns.begin() + graph_.offsets[index(row)];
    const auto end = graph_.columns.begin() + graph_.offsets[index(row) + 1];
    const auto place = std::lower_bound(begin, end, column);
    check(place != end && *place == column, "the nodes of an element are coupled in the matrix");
    values_[static_cast<std::size_t>(place - graph_.columns.begin())] += static_cast<float>(value);
  }

  const LinearSystem& system_;
  const BlockLayout& layout_;
  const BlockGraph& graph_;
  std::vector<float>& values_;
  std::map<int, std::vector<ForeignEntry>> foreign_;
};

}  // namespace

PressureBlock::PressureBlock(const LinearSystem& system, const StokesBlocks& blocks, int steps)
    : layout_(blocks.layout), graph_(blocks.graph), steps_(steps), values_(blocks.pressure) {
  MassAssembler(system, layout_, graph_, values_).run(blocks.scaling);
  inverse_diagonal_.resize(index(graph_.rows()));
  for (LocalId row = 0; row < graph_.rows(); ++row) {
    const float diagonal = values_[index(graph_.diagonals[index(row)])];
    inverse_diagonal_[index(row)] = diagonal > 0 ? 1 / diagonal : 0;
  }
  product_.resize(inverse_diagonal_.size());
  step_.resize(inverse_diagonal_.size());
  estimate_bounds(system);
}

void PressureBlock::multiply(const float* x, float* y) const {
  for (LocalId row = 0; row < graph_.rows(); ++row) {
    float sum = 0;
    for (LocalId k = graph_.offsets[index(row)]; k < graph_.offsets[index(row) + 1]; ++k) {
      sum += values_[index(k)] * x[index(graph_.columns[index(k)])];
    }
    y[index(row)] = sum;
  }
}

void PressureBlock::estimate_bounds(const LinearSystem& system) {
  constexpr int steps = 10;
  constexpr Real margin = 1.04;
  const auto rows = index(graph_.rows());
  std::vector<float> x(index(layout_.size()), 0.0F);
  const auto first = static_cast<Real>(layout_.ownership.begin());
  for (std::size_t i = 0; i < rows; ++i) {
    x[i] = static_cast<float>(std::cos(2.3 * (first + static_cast<Real>(i)) + 0.7));
  }
  Real estimate = 0;
  for (int step = 0; step < steps; ++step) {
    // Norms with the weight D, in which D^-1 S is symmetric: the Rayleigh quotients increase to the largest value.
    layout_.halo.update_copies(std::span(x), 1);
    multiply(x.data(), product_.data());
    std::array<Real, 2> sums = {0, 0};
    for (std::size_t i = 0; i < rows; ++i) {
      if (inverse_diagonal_[i] <= 0) continue;
      sums[0] += static_cast<Real>(x[i]) * product_[i];
      sums[1] += static_cast<Real>(x[i]) * x[i] / inverse_diagonal_[i];
    }
    system.comm->sum_in_place(std::span(sums));
    if (!(sums[1] > 0)) break;
    estimate = sums[0] / sums[1];
    const auto norm = static_cast<float>(1 / std::sqrt(sums[1]));
    for (std::size_t i = 0; i < rows; ++i) x[i] = norm * inverse_diagonal_[i] * product_[i];
  }
  const Real of_mass = (system.mesh->dim + 2) / 2.0;
  bounds_.high = std::max(margin * of_mass, 1.1 * estimate);
}

void PressureBlock::apply(const float* residual, std::vector<float>& correction) {
  const auto center = static_cast<float>((bounds_.high + bounds_.low) / 2);
  const auto radius = static_cast<float>((bounds_.high - bounds_.low) / 2);
  const float sigma = center / radius;
  float rho = 1 / sigma;
  for (std::size_t i = 0; i < step_.size(); ++i) {
    step_[i] = inverse_diagonal_[i] * residual[i] / center;
    correction[i] = step_[i];
  }
  for (int k = 1; k < steps_; ++k) {
    layout_.halo.update_copies(std::span(correction), 1);
    multiply(correction.data(), product_.data());
    const float next = 1 / (2 * sigma - rho);
    for (std::size_t i = 0; i < step_.size(); ++i) {
      step_[i] = next * rho * step_[i] + 2 * next / radius * inverse_diagonal_[i] * (residual[i] - product_[i]);
      correction[i] += step_[i];
    }
    rho = next;
  }
  layout_.halo.update_copies(std::span(correction), 1);
}

std::size_t PressureBlock::bytes() const {
  return sizeof(float) * (values_.size() + 3 * inverse_diagonal_.size());
}

}  // namespace malleus
