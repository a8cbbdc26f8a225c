#include "fem/node_space.hpp"

#include <algorithm>

namespace malleus {

void NodeTuples::add(std::span<const GlobalId> set) {
  nodes.insert(nodes.end(), set.begin(), set.end());
  offsets.push_back(nodes.size());
}

namespace {

bool holds(const Mesh& mesh, GlobalId number) {
  return mesh.node_ownership.owns(number) ||
         std::binary_search(mesh.copy_numbers.begin(), mesh.copy_numbers.end(), number);
}

}  // namespace

NodeSpace::NodeSpace(const Communicator& comm, const Mesh& mesh, std::span<const GlobalId> wanted) : mesh_(&mesh) {
  for (const GlobalId number : wanted) {
    if (!holds(mesh, number)) foreign_.push_back(number);
  }
  std::sort(foreign_.begin(), foreign_.end());
  foreign_.erase(std::unique(foreign_.begin(), foreign_.end()), foreign_.end());
  std::vector<GlobalId> copies = mesh.copy_numbers;
  copies.insert(copies.end(), foreign_.begin(), foreign_.end());
  halo_ = Halo(comm, mesh.node_ownership, copies);
}

GlobalId NodeSpace::global_node(LocalId node) const noexcept {
  return node < mesh_->nodes() ? mesh_->global_node(node) : foreign_[static_cast<std::size_t>(node - mesh_->nodes())];
}

LocalId NodeSpace::local_node(GlobalId number) const noexcept {
  if (mesh_->node_ownership.owns(number)) return static_cast<LocalId>(number - mesh_->node_ownership.begin());
  const auto& copies = mesh_->copy_numbers;
  const auto copy = std::lower_bound(copies.begin(), copies.end(), number);
  if (copy != copies.end() && *copy == number) return owned() + static_cast<LocalId>(copy - copies.begin());
  const auto distant = std::lower_bound(foreign_.begin(), foreign_.end(), number);
  if (distant == foreign_.end() || *distant != number) return -1;
  return mesh_->nodes() + static_cast<LocalId>(distant - foreign_.begin());
}

}  // namespace malleus
