#include "solvers/level_set_extension.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

#include "base/index.hpp"

namespace malleus {
namespace {

/// What a neighbour counts beside the slope toward it: for level sets that are flat.
constexpr Real least_weight = 1e-3;

/// Elements of this rank around each node.
struct NodeElements {
  explicit NodeElements(const Mesh& mesh) : start(index(mesh.nodes()) + 1, 0) {
    for (const LocalId node : mesh.element_nodes) ++start[index(node) + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    elements.resize(start.back());
    std::vector<std::size_t> next(start.begin(), start.end() - 1);
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      for (const LocalId node : mesh.nodes_of_element(e)) elements[next[index(node)]++] = e;
    }
  }
  std::span<const LocalId> of(LocalId node) const {
    return {elements.data() + start[index(node)], start[index(node) + 1] - start[index(node)]};
  }

  std::vector<std::size_t> start;
  std::vector<LocalId> elements;
};

class Extension {
 public:
  Extension(const Mesh& mesh, std::span<const char> is_known, std::span<const Real> level_set, std::span<Real> velocity)
      : mesh_(mesh),
        around_(mesh),
        known_(is_known.begin(), is_known.end()),
        level_set_(level_set),
        velocity_(velocity),
        sums_(index(mesh.nodes()) * size(), 0.0) {
    for (LocalId node = 0; node < mesh.nodes(); ++node) {
      if (known_[index(node)] != 0) newest_.push_back(node);
    }
  }

  bool is_over() const { return newest_.empty(); }

  /// The nodes beside those that became known last.
  void advance(const std::function<void(LocalId, Real*)>& constrain) {
    std::fill(sums_.begin(), sums_.end(), 0.0);
    for (const LocalId node : candidates()) add_neighbours(node);
    mesh_.node_halo.add_to_owners(sums_, static_cast<int>(size()));
    mesh_.node_halo.update_copies(sums_, static_cast<int>(size()));
    newest_.clear();
    const auto dim = static_cast<std::size_t>(mesh_.dim);
    for (LocalId node = 0; node < mesh_.nodes(); ++node) {
      const Real* sum = sums_.data() + index(node) * size();
      if (known_[index(node)] != 0 || !(sum[dim] > 0)) continue;
      Real* velocity = velocity_.data() + index(node) * dim;
      for (std::size_t d = 0; d < dim; ++d) velocity[d] = sum[d] / sum[dim];
      constrain(node, velocity);
      newest_.push_back(node);
    }
    for (const LocalId node : newest_) known_[index(node)] = 1;
  }

 private:
  std::size_t size() const { return static_cast<std::size_t>(mesh_.dim) + 1; }

  std::vector<LocalId> candidates() const {
    std::vector<LocalId> found;
    for (const LocalId node : newest_) {
      for (const LocalId e : around_.of(node)) {
        for (const LocalId other : mesh_.nodes_of_element(e)) {
          if (known_[index(other)] == 0) found.push_back(other);
        }
      }
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  void add_neighbours(LocalId node) {
    const auto dim = static_cast<std::size_t>(mesh_.dim);
    Real* sum = sums_.data() + index(node) * size();
    for (const LocalId e : around_.of(node)) {
      for (const LocalId other : mesh_.nodes_of_element(e)) {
        if (known_[index(other)] == 0) continue;
        Real square = 0;
        for (std::size_t d = 0; d < dim; ++d) {
          const Real way = mesh_.point(other)[d] - mesh_.point(node)[d];
          square += way * way;
        }
        const Real rise = std::max(0.0, level_set_[index(other)] - level_set_[index(node)]);
        const Real weight = least_weight + rise * rise / square;
        for (std::size_t d = 0; d < dim; ++d) sum[d] += weight * velocity_[index(other) * dim + d];
        sum[dim] += weight;
      }
    }
  }

  const Mesh& mesh_;
  NodeElements around_;
  std::vector<char> known_;
  std::span<const Real> level_set_;
  std::span<Real> velocity_;
  std::vector<Real> sums_;  ///< [node] velocity times weight, weight
  std::vector<LocalId> newest_;
};

}  // namespace

void extend_velocity(const Communicator& comm, const Mesh& mesh, std::span<const char> is_known,
                     std::span<const Real> level_set, const std::function<void(LocalId, Real*)>& constrain,
                     std::span<Real> velocity) {
  Extension extension(mesh, is_known, level_set, velocity);
  while (comm.any(!extension.is_over())) extension.advance(constrain);
}

}  // namespace malleus
