#include "remesh/cavity.hpp"

#include <algorithm>

namespace malleus::remeshing {

/// Turns around the edge (a, b) of a tetrahedron (a, b, p, q), leaving it by the face without p (forward) so that q
/// stays, and records what comes next on the ring.
template <int D, class Metric>
void Cavity<D, Metric>::walk_shell(LocalId from, std::array<LocalId, 4> abpq, bool forward) {
  LocalId e = from;
  LocalId leaves = forward ? abpq[2] : abpq[3];
  LocalId stays = forward ? abpq[3] : abpq[2];
  while (gathered_count_ <= largest) {
    const Element<D>& element = mesh_.element(e);
    const std::size_t face = element.index_of(leaves);
    const FaceRef ref = element.neighbour[face];
    if (ref == no_face) return;
    inner_patch_ = inner_patch_ || element.patch[face] != no_patch;
    e = element_of(ref);
    if (e == from) {
      closed_ = true;
      return;
    }
    const LocalId next = mesh_.element(e).node[local_face(ref)];
    add(e);
    ring_.push_back(next);
    leaves = stays;
    stays = next;
  }
}

template <int D, class Metric>
bool Cavity<D, Metric>::gather_shell(LocalId from, std::size_t edge) {
  const Element<D>& element = mesh_.element(from);
  const auto [a, b] = EdgeTable<D>::nodes[edge];
  begin(element.node[a], element.node[b]);
  closed_ = false;
  add(from);
  if constexpr (D == 2) {
    const std::size_t face = 3 - a - b;
    ring_.push_back(element.node[face]);
    const FaceRef ref = element.neighbour[face];
    closed_ = ref != no_face;
    if (!closed_) return true;
    inner_patch_ = element.patch[face] != no_patch;
    add(element_of(ref));
    ring_.push_back(mesh_.element(element_of(ref)).node[local_face(ref)]);
  } else {
    const auto [p, q] = EdgeTable<D>::rest[edge];
    const std::array<LocalId, 4> abpq = {element.node[a], element.node[b], element.node[p], element.node[q]};
    ring_ = {abpq[2], abpq[3]};
    walk_shell(from, abpq, true);
    if (closed_) {
      ring_.pop_back();
    } else {
      std::reverse(ring_.begin(), ring_.end());
      walk_shell(from, abpq, false);
    }
  }
  return gathered_count_ <= largest;
}

template <int D, class Metric>
bool Cavity<D, Metric>::gather_pair(LocalId from, std::size_t face) {
  const FaceRef ref = mesh_.element(from).neighbour[face];
  if (ref == no_face) return false;
  begin(-1, -1);
  closed_ = true;
  add(from);
  add(element_of(ref));
  inner_patch_ = mesh_.element(from).patch[face] != no_patch;
  return true;
}

template <int D, class Metric>
void Cavity<D, Metric>::find_border() {
  border_.clear();
  inner_.clear();
  const bool pair = kernel_a_ < 0;
  for (const LocalId e : elements()) {
    const Element<D>& element = mesh_.element(e);
    for (std::size_t f = 0; f <= D; ++f) {
      const FaceRef ref = element.neighbour[f];
      const bool inside = ref != no_face && (pair ? is_of_pair(element_of(ref)) : holds_kernel(element, f));
      if (inside && (element.patch[f] == no_patch || element_of(ref) < e)) continue;
      BorderFace<D> face;
      for (std::size_t k = 0; k < D; ++k) face.node[k] = element.node[FaceTable<D>::nodes[f][k]];
      face.outside = ref;
      face.patch = element.patch[f];
      face.region = element.region;
      (inside ? inner_ : border_).push_back(face);
    }
  }
}

template <int D, class Metric>
Real Cavity<D, Metric>::worst_key() const {
  float worst = 2;
  for (const LocalId e : elements()) worst = std::min(worst, mesh_.element(e).key);
  return worst;
}

template <int D, class Metric>
Real Cavity<D, Metric>::scaled_volume_sum(bool absolute) const {
  Real sum = 0;
  for (const LocalId e : elements()) {
    const Real volume = scaled_volume<D>(mesh_.points_of(mesh_.element(e)));
    sum += absolute ? std::abs(volume) : volume;
  }
  return sum;
}

template <int D, class Metric>
Real Cavity<D, Metric>::evaluate(const Star<D, Metric>& star, Real limit) const {
  Real worst = 2;
  PointPointers<D> x;
  MetricPointers<D, Metric> m;
  x[D] = &star.site.position;
  m[D] = &star.site.metric;
  for (const auto& face : border_) {
    if (holds(face.node, star.apex)) continue;
    if (face.outside == no_face && vanishes(face, star)) continue;
    for (std::size_t k = 0; k < D; ++k) {
      x[k] = &mesh_.point(face.node[k]);
      m[k] = &mesh_.metric(face.node[k]);
    }
    worst = std::min(worst, shape_key<D>(x, m));
    if (worst <= limit) return worst;
  }
  return worst;
}

template <int D, class Metric>
Real Cavity<D, Metric>::absolute_volume(const Star<D, Metric>& star, int& inverted) const {
  Real sum = 0;
  inverted = 0;
  PointPointers<D> x;
  x[D] = &star.site.position;
  for (const auto& face : border_) {
    if (holds(face.node, star.apex)) continue;
    if (face.outside == no_face && vanishes(face, star)) continue;
    for (std::size_t k = 0; k < D; ++k) x[k] = &mesh_.point(face.node[k]);
    const Real volume = scaled_volume<D>(x);
    if (!(volume > 0)) ++inverted;
    sum += std::abs(volume);
  }
  return sum;
}

template <int D, class Metric>
bool Cavity<D, Metric>::removes_frozen(const Star<D, Metric>& star) const {
  const auto is_lost = [&](const BorderFace<D>& face) {
    return face.patch != no_patch && mesh_.patch(face.patch).frozen && vanishes(face, star);
  };
  return std::any_of(border_.begin(), border_.end(), is_lost) || std::any_of(inner_.begin(), inner_.end(), is_lost);
}

template <int D, class Metric>
void Cavity<D, Metric>::set_side(FaceRef face, FaceRef other, std::int16_t patch) {
  Element<D>& element = mesh_.element(element_of(face));
  element.neighbour[local_face(face)] = other;
  element.patch[local_face(face)] = patch;
  element.tried = 0;
}

template <int D, class Metric>
std::int16_t Cavity<D, Metric>::inner_patch_at(std::uint64_t key) const {
  for (const auto& [link, patch] : inner_links_) {
    if (link == key) return patch;
  }
  return no_patch;
}

template <int D, class Metric>
void Cavity<D, Metric>::join(const Link& first, FaceRef face, std::int16_t patch, std::uint64_t key) {
  std::int16_t both = first.patch != no_patch ? first.patch : patch;
  if (both == no_patch && !inner_links_.empty()) both = inner_patch_at(key);
  if (first.face != no_face) set_side(first.face, face, both);
  if (face != no_face) set_side(face, first.face, both);
}

/// Two faces over the same link (the face without the apex) are the two sides of one face of the star.
template <int D, class Metric>
void Cavity<D, Metric>::link(std::uint64_t key, FaceRef face, std::int16_t patch) {
  std::size_t slot = static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 52);
  while (link_stamps_[slot] == link_stamp_) {
    Link& found = links_[slot];
    if (found.key == key && found.open) {
      join(found, face, patch, key);
      found.open = false;
      return;
    }
    slot = (slot + 1) % slots;
  }
  link_stamps_[slot] = link_stamp_;
  links_[slot] = {key, face, patch, true};
}

/// Where patch faces inside the cavity vanish, the faces of the star over their remaining links take their patch.
template <int D, class Metric>
void Cavity<D, Metric>::note_inner_links(const Star<D, Metric>& star) {
  inner_links_.clear();
  for (const auto& face : inner_) {
    for (std::size_t without = 0; without < D; ++without) {
      const LocalId gone = face.node[without];
      const bool removed = gone == star.removed_a || gone == star.removed_b;
      if (holds(face.node, star.apex) ? gone == star.apex : removed)
        inner_links_.emplace_back(link_key(face.node, without), face.patch);
    }
  }
}

template <int D, class Metric>
LocalId Cavity<D, Metric>::take_slot() {
  if (reused_ < gathered_count_) return gathered_[reused_++];
  if (!mesh_.free_elements.empty()) {
    const LocalId e = mesh_.free_elements.back();
    mesh_.free_elements.pop_back();
    return e;
  }
  mesh_.elements.emplace_back();
  return static_cast<LocalId>(mesh_.elements.size()) - 1;
}

template <int D, class Metric>
void Cavity<D, Metric>::make_element(const BorderFace<D>& face, LocalId apex) {
  const LocalId e = take_slot();
  Element<D>& element = mesh_.element(e);
  std::copy(face.node.begin(), face.node.end(), element.node.begin());
  element.node[D] = apex;
  element.neighbour.fill(no_face);
  element.patch.fill(no_patch);
  element.neighbour[D] = face.outside;
  element.patch[D] = face.patch;
  element.region = face.region;
  element.tried = 0;
  if (face.outside != no_face) set_side(face.outside, face_ref(e, D), face.patch);
  for (const LocalId v : element.node) mesh_.vertex(v).element = e;
  element.key = static_cast<float>(mesh_.key_of_element(element));
  made_.push_back(e);
  for (std::size_t without = 0; without < D; ++without)
    link(link_key(face.node, without), face_ref(e, without), no_patch);
}

template <int D, class Metric>
void Cavity<D, Metric>::commit(const Star<D, Metric>& star) {
  ++link_stamp_;
  made_.clear();
  reused_ = 0;
  note_inner_links(star);
  for (const auto& face : border_) {
    if (holds(face.node, star.apex) && face.outside != no_face) {
      for (const LocalId v : face.node) mesh_.vertex(v).element = element_of(face.outside);
    }
  }
  for (const auto& face : border_) {
    if (holds(face.node, star.apex)) {
      const auto at =
          static_cast<std::size_t>(std::find(face.node.begin(), face.node.end(), star.apex) - face.node.begin());
      link(link_key(face.node, at), face.outside, face.patch);
    } else if (face.outside == no_face && vanishes(face, star)) {
      for (std::size_t without = 0; without < D; ++without) link(link_key(face.node, without), no_face, face.patch);
    } else {
      make_element(face, star.apex);
    }
  }
  for (std::size_t n = reused_; n < gathered_count_; ++n) {
    mesh_.element(gathered_[n]).node[0] = -1;
    mesh_.free_elements.push_back(gathered_[n]);
  }
}

template class Cavity<2, SizeMetric<2>>;
template class Cavity<2, TensorMetric<2>>;
template class Cavity<3, SizeMetric<3>>;
template class Cavity<3, TensorMetric<3>>;

}  // namespace malleus::remeshing
