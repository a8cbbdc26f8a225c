#include "remesh/locator.hpp"

#include <limits>

namespace malleus::remeshing {

template <int D>
std::array<Real, D + 1> Locator<D>::barycentric(const Cell& cell, const Point<D>& x) const {
  std::array<Real, D + 1> weights;
  Real total = 0;
  for (std::size_t f = 0; f <= D; ++f) {
    std::array<const Point<D>*, D + 1> corners;
    for (std::size_t k = 0; k < D; ++k)
      corners[k] = &points_[static_cast<std::size_t>(cell.node[FaceTable<D>::nodes[f][k]])];
    corners[D] = &x;
    weights[f] = scaled_volume<D>(corners);
    total += weights[f];
  }
  if (!(std::abs(total) > std::numeric_limits<Real>::min())) {
    weights.fill(1.0 / (D + 1));
    return weights;
  }
  for (Real& weight : weights) weight /= total;
  return weights;
}

template <int D>
typename Locator<D>::Hit Locator<D>::walk(const Point<D>& x, LocalId start, int max_steps) const {
  Hit best;
  Real best_outside = std::numeric_limits<Real>::max();
  LocalId at = start;
  LocalId before = -1;
  for (int step = 0; step < max_steps; ++step) {
    const Cell& cell = cells_[static_cast<std::size_t>(at)];
    const auto weights = barycentric(cell, x);
    LocalId next = -1;
    Real lowest = 0;
    Real lowest_passable = 0;
    for (std::size_t f = 0; f <= D; ++f) {
      lowest = weights[f] < lowest ? weights[f] : lowest;
      if (weights[f] < lowest_passable && cell.neighbour[f] >= 0 && cell.neighbour[f] != before) {
        lowest_passable = weights[f];
        next = cell.neighbour[f];
      }
    }
    if (-lowest < best_outside) {
      best_outside = -lowest;
      best = {at, weights, 0};
    }
    if (lowest >= -1e-12 || next < 0) break;
    before = at;
    at = next;
  }
  best.outside = clamp_weights(best.weights);
  return best;
}

template class Locator<2>;
template class Locator<3>;

}  // namespace malleus::remeshing
