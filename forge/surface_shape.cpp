#include "forge/surface_shape.hpp"

#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "base/error.hpp"

namespace malleus::forge {
namespace {

constexpr Real everywhere = 1e150;  ///< m; a reach whose square is a number

/// Kinds of sharp edges, as the material meets them.
constexpr int convex = 1;
constexpr int concave = 2;

using Ridge = std::array<LocalId, 2>;  ///< what two facets share: an edge in 3D, a point (and -1) in 2D

Ridge ridge_of(const FacetSet& set, LocalId facet, int k) {
  const auto& corners = set.facets[static_cast<std::size_t>(facet)];
  const LocalId a = corners[static_cast<std::size_t>(k)];
  if (set.dim == 2) return {a, -1};
  const LocalId b = corners[static_cast<std::size_t>((k + 1) % 3)];
  return {std::min(a, b), std::max(a, b)};
}

/// Drops facets without area.
LocalId drop_flat(FacetSet& set) {
  std::vector<std::array<LocalId, 3>> kept;
  for (LocalId f = 0; f < set.size(); ++f) {
    const Bounds box = set.bounds(f);
    const Real size = (box.high - box.low).norm();
    const Real tiny = set.dim == 2 ? 1e-12 * size : 1e-12 * size * size;
    if (set.area_normal(f).norm() > tiny) kept.push_back(set.facets[static_cast<std::size_t>(f)]);
  }
  const auto dropped = static_cast<LocalId>(set.facets.size() - kept.size());
  set.facets = std::move(kept);
  return dropped;
}

Real enclosed_volume(const FacetSet& set) {
  Real volume = 0;
  const Vector origin = set.points.empty() ? Vector(Vector::Zero()) : set.points.front();
  for (LocalId f = 0; f < set.size(); ++f) volume += (set.corner(f, 0) - origin).dot(set.area_normal(f)) / set.dim;
  return volume;
}

class Surface final : public ToolShape {
 public:
  Surface(FacetSet set, Side side, Real feature_angle, SurfaceReport& report) : set_(std::move(set)), side_(side) {
    report.dropped_facets = drop_flat(set_);
    if (set_.facets.empty()) throw InputError("the tool's surface has no facets with an area");
    find_ridges(report);
    if (report.closed && enclosed_volume(set_) < 0) {
      for (auto& facet : set_.facets) std::swap(facet[0], facet[1]);
      ridges_.clear();
      find_ridges(report);
      report.turned = true;
    }
    for (LocalId f = 0; f < set_.size(); ++f) normals_.push_back(set_.area_normal(f).normalized());
    tree_ = FacetTree(set_);
    grow_patches(std::cos(feature_angle * std::numbers::pi / 180));
    smooth_corners();
  }
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;

  SurfaceContact nearest(const Vector& point) const override {
    return contact_at(point, tree_.closest(point, everywhere));
  }

  Real area(bool is_revolved) const override {
    Real sum = 0;
    for (LocalId f = 0; f < set_.size(); ++f) {
      const Real radius = 0.5 * (set_.corner(f, 0)[0] + set_.corner(f, 1)[0]);
      sum += set_.area_normal(f).norm() * (is_revolved ? 2 * std::numbers::pi * std::abs(radius) : 1);
    }
    return sum;
  }

  void contacts(const Vector& point, Real reach, std::vector<SurfaceContact>& found) const override {
    const ClosestFacet nearest_facet = tree_.closest(point, everywhere);
    const SurfaceContact first = contact_at(point, nearest_facet);
    if (first.distance >= reach) return;
    // Behind a concave edge the planes on both sides of it hold, not the direction to the edge.
    const bool is_behind_edge = first.distance < 0 && is_on_edge(nearest_facet, concave);
    const std::size_t before = found.size();
    if (!is_behind_edge) found.push_back(first);
    if (has_concave_ridges_) add_other_patches(point, reach, first, found);
    if (found.size() == before) found.push_back(first);
  }

 private:
  /// Contacts with the patches that meet at concave edges near the point.
  void add_other_patches(const Vector& point, Real reach, const SurfaceContact& first,
                         std::vector<SurfaceContact>& found) const {
    const Real range = 1.5 * std::max(reach, std::abs(first.distance));
    std::map<LocalId, ClosestFacet> of_patch;
    for (const LocalId f : tree_.within(point, range)) {
      const ClosestPoint at = set_.closest(f, point);
      ClosestFacet& best = of_patch[patches_[static_cast<std::size_t>(f)]];
      if (at.squared_distance < best.at.squared_distance) best = {f, at};
    }
    for (const auto& [patch, closest] : of_patch) {
      const SurfaceContact contact = facing(by_plane(point, closest), side_);
      const bool stands = contact.distance > 0 && stands_on(point, closest);
      const bool holds = stands || is_on_edge(closest, concave);
      if (contact.distance < reach && holds && contact.normal.dot(first.normal) < 0.9) found.push_back(contact);
    }
  }

  static SurfaceContact facing(SurfaceContact contact, Side side) {
    if (side == Side::outside) return contact;
    return {-contact.distance, -contact.normal};
  }

  void find_ridges(SurfaceReport& report) {
    std::map<Ridge, std::vector<LocalId>> at_ridge;
    std::map<std::array<LocalId, 2>, int> directed;
    for (LocalId f = 0; f < set_.size(); ++f) {
      const auto& corners = set_.facets[static_cast<std::size_t>(f)];
      for (int k = 0; k < set_.dim; ++k) {
        at_ridge[ridge_of(set_, f, k)].push_back(f);
        const std::array<LocalId, 2> way = set_.dim == 2
                                               ? std::array<LocalId, 2>{corners[static_cast<std::size_t>(k)], k}
                                               : std::array<LocalId, 2>{corners[static_cast<std::size_t>(k)],
                                                                        corners[static_cast<std::size_t>((k + 1) % 3)]};
        if (++directed[way] > 1) {
          throw InputError("the tool's surface is not sound: its facets overlap or are not turned alike");
        }
      }
    }
    report.closed = true;
    for (const auto& [ridge, facets] : at_ridge) {
      if (facets.size() == 1) report.closed = false;
      if (facets.size() == 2) ridges_[ridge] = {facets[0], facets[1]};
    }
  }

  /// Facets joined over ridges that are bent little share a patch.
  void grow_patches(Real cosine) {
    edges_at_.assign(set_.points.size(), 0);
    patches_.resize(set_.facets.size());
    std::iota(patches_.begin(), patches_.end(), 0);
    const auto root = [&](LocalId f) {
      while (patches_[static_cast<std::size_t>(f)] != f) f = patches_[static_cast<std::size_t>(f)];
      return f;
    };
    for (const auto& [ridge, pair] : ridges_) {
      const Vector& a = normals_[static_cast<std::size_t>(pair[0])];
      const Vector& b = normals_[static_cast<std::size_t>(pair[1])];
      if (a.dot(b) > cosine) {
        const LocalId one = root(pair[0]);
        const LocalId two = root(pair[1]);
        patches_[static_cast<std::size_t>(std::max(one, two))] = std::min(one, two);
      } else {
        const bool holds_twice = is_concave(pair) != (side_ == Side::inside);
        has_concave_ridges_ = has_concave_ridges_ || holds_twice;
        for (const LocalId point : ridge) {
          if (point >= 0) edges_at_[static_cast<std::size_t>(point)] |= holds_twice ? concave : convex;
        }
      }
    }
    for (LocalId f = 0; f < set_.size(); ++f) patches_[static_cast<std::size_t>(f)] = root(f);
  }

  bool is_concave(const std::array<LocalId, 2>& pair) const {
    Vector centre = Vector::Zero();
    for (int k = 0; k < set_.dim; ++k) centre += set_.corner(pair[1], k) / set_.dim;
    Vector base = Vector::Zero();
    for (int k = 0; k < set_.dim; ++k) base += set_.corner(pair[0], k) / set_.dim;
    return normals_[static_cast<std::size_t>(pair[0])].dot(centre - base) > 0;
  }

  Real angle_at(LocalId facet, int k) const {
    if (set_.dim == 2) return 1;
    const Vector a = set_.corner(facet, (k + 1) % 3) - set_.corner(facet, k);
    const Vector b = set_.corner(facet, (k + 2) % 3) - set_.corner(facet, k);
    return std::atan2(a.cross(b).norm(), a.dot(b));
  }

  /// Angle-weighted normals of each corner: of its patch alone (smoothed), and of all facets (pseudonormal).
  void smooth_corners() {
    std::map<std::array<LocalId, 2>, Vector> of_patch;
    pseudonormals_.assign(set_.points.size(), Vector::Zero());
    const auto add = [](auto& map, const std::array<LocalId, 2>& key, const Vector& value) {
      const auto [entry, is_new] = map.try_emplace(key, value);
      if (!is_new) entry->second += value;
    };
    for (LocalId f = 0; f < set_.size(); ++f) {
      for (int k = 0; k < set_.dim; ++k) {
        const LocalId point = set_.facets[static_cast<std::size_t>(f)][static_cast<std::size_t>(k)];
        const Vector weighted = angle_at(f, k) * normals_[static_cast<std::size_t>(f)];
        add(of_patch, {patches_[static_cast<std::size_t>(f)], point}, weighted);
        pseudonormals_[static_cast<std::size_t>(point)] += weighted;
      }
    }
    corner_normals_.resize(set_.facets.size());
    for (LocalId f = 0; f < set_.size(); ++f) {
      for (int k = 0; k < set_.dim; ++k) {
        const LocalId point = set_.facets[static_cast<std::size_t>(f)][static_cast<std::size_t>(k)];
        const Vector& sum = of_patch.at({patches_[static_cast<std::size_t>(f)], point});
        const Real length = sum.norm();
        corner_normals_[static_cast<std::size_t>(f)][static_cast<std::size_t>(k)] =
            length > 1e-6 ? Vector(sum / length) : normals_[static_cast<std::size_t>(f)];
      }
    }
  }

  /// The normal that decides the side: that of the face, edge or vertex on which the closest point lies.
  Vector pseudonormal(const ClosestFacet& closest) const {
    const auto& corners = set_.facets[static_cast<std::size_t>(closest.facet)];
    int parts = 0;
    int with = 0;
    int without = 0;
    for (int k = 0; k < set_.dim; ++k) {
      const bool has_part = closest.at.weights[static_cast<std::size_t>(k)] > 0;
      parts += has_part ? 1 : 0;
      (has_part ? with : without) = k;
    }
    const Vector& own = normals_[static_cast<std::size_t>(closest.facet)];
    if (parts == 1) return pseudonormals_[static_cast<std::size_t>(corners[static_cast<std::size_t>(with)])];
    if (parts == set_.dim) return own;
    const auto found = ridges_.find(ridge_of(set_, closest.facet, (without + 1) % 3));
    if (found == ridges_.end()) return own;
    const auto& pair = found->second;
    return normals_[static_cast<std::size_t>(pair[0])] + normals_[static_cast<std::size_t>(pair[1])];
  }

  /// Whether the closest place is a sharp edge or vertex of one of the kinds.
  bool is_on_edge(const ClosestFacet& closest, int kinds) const {
    const auto& corners = set_.facets[static_cast<std::size_t>(closest.facet)];
    bool all_sharp = true;
    bool inside = true;
    for (std::size_t k = 0; k < static_cast<std::size_t>(set_.dim); ++k) {
      const bool has_part = closest.at.weights[k] > 0;
      inside = inside && has_part;
      if (has_part) all_sharp = all_sharp && (edges_at_[static_cast<std::size_t>(corners[k])] & kinds) != 0;
    }
    return !inside && all_sharp;
  }

  bool is_touching(Real distance) const {
    return std::abs(distance) < 1e-9 * (tree_.bounds().high - tree_.bounds().low).norm();
  }

  Vector smoothed_normal(const ClosestFacet& closest) const {
    Vector normal = Vector::Zero();
    for (std::size_t k = 0; k < static_cast<std::size_t>(set_.dim); ++k) {
      normal += closest.at.weights[k] * corner_normals_[static_cast<std::size_t>(closest.facet)][k];
    }
    return normal.normalized();
  }

  /// Whether the point lies along the smoothed normal of its closest place: not so beyond a patch's border.
  bool stands_on(const Vector& point, const ClosestFacet& closest) const {
    const Real distance = std::sqrt(closest.at.squared_distance);
    if (is_touching(distance)) return true;
    return std::abs((point - closest.at.point).dot(smoothed_normal(closest))) > 0.9 * distance;
  }

  SurfaceContact by_plane(const Vector& point, const ClosestFacet& closest) const {
    const Vector normal = smoothed_normal(closest);
    return {normal.dot(point - closest.at.point), normal};
  }

  SurfaceContact contact_at(const Vector& point, const ClosestFacet& closest) const {
    const Vector offset = point - closest.at.point;
    const Vector side = pseudonormal(closest);
    const Real distance = std::copysign(std::sqrt(closest.at.squared_distance), side.dot(offset));
    Vector normal = smoothed_normal(closest);
    if (!stands_on(point, closest) || (is_on_edge(closest, convex | concave) && !is_touching(distance)))
      normal = offset / distance;
    return facing({distance, normal}, side_);
  }

  FacetSet set_;
  FacetTree tree_;
  Side side_;
  std::map<Ridge, std::array<LocalId, 2>> ridges_;
  std::vector<Vector> normals_;
  std::vector<LocalId> patches_;
  std::vector<int> edges_at_;  ///< [point] bits: sharp edges there that are convex, concave for the material
  std::vector<std::array<Vector, 3>> corner_normals_;
  std::vector<Vector> pseudonormals_;
  bool has_concave_ridges_ = false;
};

}  // namespace

std::unique_ptr<ToolShape> make_surface(FacetSet set, Side side, SurfaceReport& report, Real feature_angle) {
  return std::make_unique<Surface>(std::move(set), side, feature_angle, report);
}

}  // namespace malleus::forge
