#include "solvers/pressure_block.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/index.hpp"
#include "solvers/graph_assembler.hpp"

namespace malleus {
namespace {

/// Adds M(1/eta)/2 times a factor.
void add_mass(const LinearSystem& system, Real factor, GraphAssembler<float>& assembler) {
  const Mesh& mesh = *system.mesh;
  const int dim = mesh.dim;
  const auto is_fixed = [&](LocalId node) { return system.constraints->is_pressure_fixed(node); };
  for (LocalId element = 0; element < mesh.elements(); ++element) {
    const Real viscosity = system.element_viscosity[index(element)];
    if (!(viscosity > 0)) continue;
    const Real entry = 0.5 * factor * system.element_volume[index(element)] / viscosity / ((dim + 1) * (dim + 2));
    const auto nodes = mesh.nodes_of_element(element);
    for (const LocalId row : nodes) {
      for (const LocalId column : nodes) {
        if (!is_fixed(row) && !is_fixed(column)) assembler.add(row, column, row == column ? 2 * entry : entry);
      }
    }
  }
  assembler.finish();
}

}  // namespace

PressureBlock::PressureBlock(const LinearSystem& system, const StokesBlocks& blocks, int steps)
    : layout_(blocks.layout), graph_(blocks.graph), steps_(steps), values_(blocks.pressure) {
  GraphAssembler<float> assembler(system, layout_, graph_, values_);
  add_mass(system, blocks.scaling * system.pressure_scale * system.pressure_scale, assembler);
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
