#include "forge/folds.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/log.hpp"
#include "mesh/simplex.hpp"

namespace malleus::forge {
namespace {

constexpr Real crease = 0.9;       ///< share of all directions that the material fills
constexpr Real same_fold = 6;      ///< edges
constexpr int most_new_folds = 8;  ///< told in one increment

/// Share of all directions that a simplex fills as seen from vertex k: angle over 2 pi; solid angle over 4 pi (Van
/// Oosterom, Strackee 1983).
template <int D>
Real directions_filled(const SimplexPoints<D>& points, int k) {
  std::array<Point<D>, D> rays;
  for (int i = 0; i < D; ++i)
    rays[static_cast<std::size_t>(i)] = (points.col((k + 1 + i) % (D + 1)) - points.col(k)).normalized();
  if constexpr (D == 2) {
    return std::acos(std::clamp(rays[0].dot(rays[1]), -1.0, 1.0)) / (2 * std::numbers::pi);
  } else {
    const Real volume = std::abs(rays[0].dot(Point<3>(rays[1].cross(rays[2]))));
    const Real below = 1 + rays[0].dot(rays[1]) + rays[1].dot(rays[2]) + rays[2].dot(rays[0]);
    return 2 * std::atan2(volume, below) / (4 * std::numbers::pi);
  }
}

std::vector<Real> filled_shares(const Mesh& mesh) {
  std::vector<Real> shares(static_cast<std::size_t>(mesh.nodes()), 0.0);
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      const SimplexPoints<D> points = simplex_points<D>(mesh, e);
      for (int k = 0; k <= D; ++k) {
        shares[static_cast<std::size_t>(mesh.nodes_of_element(e)[static_cast<std::size_t>(k)])] +=
            directions_filled<D>(points, k);
      }
    }
  });
  mesh.node_halo.add_to_owners(shares, 1);
  return shares;
}

Vector to_place(const std::array<Real, 3>& place) {
  return {place[0], place[1], place[2]};
}

std::array<Real, 3> of_place(const Vector& place) {
  return {place[0], place[1], place[2]};
}

}  // namespace

std::vector<FoldWatch::Candidate> FoldWatch::candidates(std::span<const Touching> touching) const {
  const Mesh& mesh = scene_.mesh;
  const std::vector<Real> shares = filled_shares(mesh);
  std::vector<Real> is_free(static_cast<std::size_t>(mesh.nodes()), 0.0);
  std::vector<Real> is_held(static_cast<std::size_t>(mesh.nodes()), 0.0);
  for (LocalId facet = 0; facet < mesh.exterior_facets; ++facet) {
    const auto group = static_cast<std::size_t>(mesh.facet_group[static_cast<std::size_t>(facet)] + 1);
    std::vector<Real>& marks = scene_.boundaries->is_free()[group] != 0 ? is_free : is_held;
    for (const LocalId node : mesh.nodes_of_facet(facet)) marks[static_cast<std::size_t>(node)] = 1;
  }
  mesh.node_halo.max_to_owners(is_free, 1);
  mesh.node_halo.max_to_owners(is_held, 1);
  for (const Touching& point : touching) is_held[static_cast<std::size_t>(point.slave)] = 1;
  std::vector<Candidate> list;
  for (LocalId node = 0; node < mesh.owned_nodes(); ++node) {
    const auto i = static_cast<std::size_t>(node);
    if (is_free[i] > 0 && is_held[i] == 0 && shares[i] > crease && shares[i] < 1) list.push_back({node, shares[i]});
  }
  return list;
}

template <class Counts>
std::optional<std::pair<Vector, std::size_t>> FoldWatch::sharpest(const std::vector<Candidate>& list,
                                                                  Counts counts) const {
  Candidate best;
  for (const Candidate& one : list) {
    if (one.share > best.share && counts(to_vector(scene_.mesh.point(one.node), scene_.dim()))) best = one;
  }
  const Real share = scene_.comm->max(best.share);
  if (!(share > 0)) return std::nullopt;
  const GlobalId mine = best.share == share ? scene_.comm->rank() : scene_.comm->size();
  const auto speaker = static_cast<int>(scene_.comm->min(mine));
  std::array<Real, 4> told = {0, 0, 0, 0};
  if (scene_.comm->rank() == speaker) {
    std::copy_n(scene_.mesh.point(best.node), scene_.dim(), told.begin());
    for (LocalId e = 0; e < scene_.mesh.elements(); ++e) {
      const auto nodes = scene_.mesh.nodes_of_element(e);
      if (std::find(nodes.begin(), nodes.end(), best.node) == nodes.end()) continue;
      told[3] = scene_.mesh.element_region[static_cast<std::size_t>(e)];
    }
  }
  scene_.comm->broadcast(std::span<Real>(told), speaker);
  return std::pair(Vector(told[0], told[1], told[2]), static_cast<std::size_t>(told[3]));
}

void FoldWatch::look(Real time, std::span<const Touching> touching) {
  const std::vector<Candidate> list = candidates(touching);
  Real edge = 0;
  for (const BodyScale& body : scene_.body_scales) edge = std::max(edge, body.is_deformable ? body.edge : 0);
  const Real reach = same_fold * edge;
  for (Fold& fold : folds_) {
    const auto seen = sharpest(list, [&](const Vector& x) { return (x - to_place(fold.last_place)).norm() < reach; });
    if (seen) fold.last_place = of_place(seen->first);
  }
  for (int count = 0; count < most_new_folds; ++count) {
    const auto found = sharpest(list, [&](const Vector& x) {
      return std::none_of(folds_.begin(), folds_.end(),
                          [&](const Fold& fold) { return (x - to_place(fold.last_place)).norm() < reach; });
    });
    if (!found) return;
    const std::array<Real, 3> place = of_place(found->first);
    folds_.push_back({time, scene_.bodies[found->second].name, place, place});
    log::warn(fmt::format("body {} begins to fold at ({:.4g}, {:.4g}, {:.4g}) m, after {:.4g} s", folds_.back().body,
                          place[0], place[1], place[2], time));
  }
}

nlohmann::json FoldWatch::save() const {
  nlohmann::json list = nlohmann::json::array();
  for (const Fold& fold : folds_) {
    list.push_back(
        {{"time_s", fold.time}, {"body", fold.body}, {"place_m", fold.place}, {"last_place_m", fold.last_place}});
  }
  return list;
}

void FoldWatch::restore(const nlohmann::json& list) {
  folds_.clear();
  for (const nlohmann::json& one : list) {
    folds_.push_back({one.at("time_s"), one.at("body"), one.at("place_m"), one.at("last_place_m")});
  }
}

}  // namespace malleus::forge
