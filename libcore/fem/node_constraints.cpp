#include "fem/node_constraints.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace malleus {

namespace {

Real dot(const Real* a, const Real* b, int dim) {
  Real sum = 0;
  for (int d = 0; d < dim; ++d) sum += a[d] * b[d];
  return sum;
}

}  // namespace

NodeConstraints::NodeConstraints(int dim, LocalId nodes) : dim_(dim), index_(static_cast<std::size_t>(nodes), -1) {}

NodeConstraints::Entry& NodeConstraints::entry(LocalId node) {
  auto& index = index_[static_cast<std::size_t>(node)];
  if (index < 0) {
    index = static_cast<std::int32_t>(entries_.size());
    entries_.emplace_back();
  }
  return entries_[static_cast<std::size_t>(index)];
}

const NodeConstraints::Entry* NodeConstraints::find(LocalId node) const noexcept {
  const auto index = index_[static_cast<std::size_t>(node)];
  return index < 0 ? nullptr : &entries_[static_cast<std::size_t>(index)];
}

bool NodeConstraints::fix_direction(LocalId node, const Real* direction, const Real* velocity, Real angle) {
  const Real length = std::sqrt(dot(direction, direction, dim_));
  check(length > 0, "a fixed direction is not zero");
  std::array<Real, 3> rest = {direction[0] / length, direction[1] / length, dim_ == 3 ? direction[2] / length : 0};
  // The prescribed speed along the whole direction; the earlier directions' share of it is theirs.
  const Real speed = dot(rest.data(), velocity, dim_);
  Entry& here = entry(node);
  if (here.fixed == dim_) return false;
  Real settled = dot(rest.data(), here.velocity.data(), dim_);
  for (int pass = 0; pass < 2; ++pass) project(node, rest.data());  // twice: orthogonal to rounding
  const Real left = std::sqrt(dot(rest.data(), rest.data(), dim_));
  if (!(left > std::sin(angle))) return false;
  Real* slot = here.directions.data() + here.fixed * dim_;
  for (int d = 0; d < dim_; ++d) slot[d] = rest[static_cast<std::size_t>(d)] / left;
  // n.v = speed with v = w + slot u: (n.slot) u = speed - n.w, n.slot = left
  const Real along = (speed - settled) / left;
  for (int d = 0; d < dim_; ++d) here.velocity[static_cast<std::size_t>(d)] += along * slot[d];
  ++here.fixed;
  return true;
}

void NodeConstraints::fix_velocity(LocalId node, const Real* velocity) {
  for (int d = 0; d < dim_; ++d) {
    std::array<Real, 3> axis{};
    axis[static_cast<std::size_t>(d)] = 1;
    project(node, axis.data());
    if (!(dot(axis.data(), axis.data(), dim_) > 1e-2 / dim_)) continue;  // some axis always has a larger part left
    fix_direction(node, axis.data(), velocity);
  }
}

void NodeConstraints::fix_pressure(LocalId node) {
  entry(node).pressure = true;
}

void NodeConstraints::set_velocity(LocalId node, const Real* velocity) {
  if (find(node) == nullptr) return;
  Entry& here = entry(node);
  here.velocity = {};
  for (int k = 0; k < here.fixed; ++k) {
    const Real* direction = here.directions.data() + k * dim_;
    const Real along = dot(direction, velocity, dim_);
    for (int d = 0; d < dim_; ++d) here.velocity[static_cast<std::size_t>(d)] += along * direction[d];
  }
}

int NodeConstraints::fixed_directions(LocalId node) const noexcept {
  const Entry* here = find(node);
  return here == nullptr ? 0 : here->fixed;
}

std::span<const Real> NodeConstraints::directions(LocalId node) const noexcept {
  const Entry* here = find(node);
  if (here == nullptr) return {};
  return {here->directions.data(), static_cast<std::size_t>(here->fixed * dim_)};
}

bool NodeConstraints::is_pressure_fixed(LocalId node) const noexcept {
  const Entry* here = find(node);
  return here != nullptr && here->pressure;
}

void NodeConstraints::project(LocalId node, Real* vector) const noexcept {
  const Entry* here = find(node);
  if (here == nullptr) return;
  if (here->fixed == dim_) {
    std::fill_n(vector, dim_, 0.0);
    return;
  }
  for (int k = 0; k < here->fixed; ++k) {
    const Real* direction = here->directions.data() + k * dim_;
    const Real along = dot(direction, vector, dim_);
    for (int d = 0; d < dim_; ++d) vector[d] -= along * direction[d];
  }
}

void NodeConstraints::impose(LocalId node, Real* velocity) const noexcept {
  const Entry* here = find(node);
  if (here == nullptr) return;
  project(node, velocity);
  for (int d = 0; d < dim_; ++d) velocity[d] += here->velocity[static_cast<std::size_t>(d)];
}

NodeConstraints NodeConstraints::extended(const Halo& halo) const {
  // count, pressure, directions, velocity of each node: only foreign nodes read them
  constexpr int size = 14;
  const auto total = static_cast<std::size_t>(halo.owned() + halo.copies());
  NodeConstraints result = *this;
  result.index_.resize(total, -1);
  if (halo.neighbours() == 0) return result;
  std::vector<Real> packed(total * size, 0.0);
  for (LocalId node = 0; node < halo.owned(); ++node) {
    const Entry* here = find(node);
    if (here == nullptr) continue;
    Real* place = packed.data() + static_cast<std::size_t>(node) * size;
    place[0] = here->fixed + (here->pressure ? 8 : 0);
    std::copy(here->directions.begin(), here->directions.end(), place + 1);
    std::copy(here->velocity.begin(), here->velocity.end(), place + 10);
  }
  halo.update_copies(packed, size);
  for (LocalId node = nodes(); node < result.nodes(); ++node) {
    const Real* place = packed.data() + static_cast<std::size_t>(node) * size;
    const int code = static_cast<int>(place[0]);
    if (code == 0) continue;
    Entry& there = result.entry(node);
    there.fixed = static_cast<std::int8_t>(code % 8);
    there.pressure = code >= 8;
    std::copy_n(place + 1, 9, there.directions.begin());
    std::copy_n(place + 10, 3, there.velocity.begin());
  }
  return result;
}

}  // namespace malleus
