#include "forge/pair_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "base/error.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus::forge {
namespace {

/// Facets face a slave node where their normal and the node's are opposed at least by this cosine. It keeps nodes of a
/// rim from the side wall beyond it.
constexpr Real facing_cosine = 0.1;
/// A node beyond the rim of the master by more than this share of the facet's size does not meet it.
constexpr Real overhang = 0.02;
/// Nodes outside a facet by less than this share of its size are in its plane.
constexpr Real flush = 1e-6;
/// Squares of distances above this ratio are equal.
constexpr Real same_place = 1 - 1e-9;

/// A slave node on its way to a rank that may have its master facet.
struct Question {
  std::int64_t index;  ///< of the asking rank's list
  std::array<Real, 3> point;
  std::array<Real, 3> normal;
};

/// What a rank's facets are to a slave node: the one it meets, and the nearest of all, facing it or not.
struct Answer {
  std::int64_t index = -1;
  bool meets = false;
  Real nearest_squared_distance = 0;  ///< of all facets
  Real nearest_side = 0;              ///< m; > 0: outside that facet
  Real size = 0;                      ///< m, of the facet that it meets
  Real squared_distance = 0;
  Real gap = 0;
  std::array<Real, 3> normal{};
  std::array<GlobalId, 3> masters{};
  std::array<Real, 3> weights{};
};

Vector to_vector(const std::array<Real, 3>& values) {
  return {values[0], values[1], values[2]};
}
std::array<Real, 3> to_array(const Vector& vector) {
  return {vector[0], vector[1], vector[2]};
}

/// This rank's facets of the master body, at the positions asked for.
class MasterFacets {
 public:
  MasterFacets(const FreeSurface& surface, std::span<const Vector> positions, std::int32_t body) : surface_(surface) {
    const Mesh& mesh = surface.mesh();
    set_.dim = mesh.dim;
    for (const LocalId facet : surface.facets()) {
      if (surface.body_of_facet(facet) != body) continue;
      facets_.push_back(facet);
      std::array<LocalId, 3> corners = {-1, -1, -1};
      for (std::size_t k = 0; k < static_cast<std::size_t>(mesh.dim); ++k) {
        corners[k] = static_cast<LocalId>(set_.points.size());
        set_.points.push_back(positions[static_cast<std::size_t>(mesh.nodes_of_facet(facet)[k])]);
      }
      set_.facets.push_back(corners);
      normals_.push_back(set_.area_normal(set_.size() - 1).normalized());
    }
    tree_ = FacetTree(set_);
  }
  MasterFacets(const MasterFacets&) = delete;
  MasterFacets& operator=(const MasterFacets&) = delete;

  Bounds bounds() const { return tree_.bounds(); }

  /// index of the answer is -1 where no facet is within reach.
  Answer answer(const Question& question, Real reach) const {
    const Vector point = to_vector(question.point);
    const ClosestFacet nearest = tree_.closest(point, reach);
    Answer answer;
    if (nearest.facet < 0) return answer;
    answer.index = question.index;
    answer.nearest_squared_distance = nearest.at.squared_distance;
    answer.nearest_side = (point - nearest.at.point).dot(normals_[static_cast<std::size_t>(nearest.facet)]);
    meet(point, to_vector(question.normal), reach, answer);
    return answer;
  }

 private:
  /// The facet that the node meets: the closest that faces it, where the node is not beyond the rim.
  void meet(const Vector& point, const Vector& normal, Real reach, Answer& answer) const {
    const ClosestFacet closest = tree_.closest(
        point, reach, [&](LocalId f) { return normals_[static_cast<std::size_t>(f)].dot(normal) < -facing_cosine; });
    if (closest.facet < 0) return;
    const Vector smoothed = smoothed_normal(closest);
    const Vector offset = point - closest.at.point;
    answer.gap = offset.dot(smoothed);
    const Real beside = (offset - answer.gap * smoothed).norm();
    const Bounds box = set_.bounds(closest.facet);
    answer.size = (box.high - box.low).norm();
    if (beside > overhang * answer.size + std::abs(answer.gap)) return;
    const Mesh& mesh = surface_.mesh();
    const LocalId facet = facets_[static_cast<std::size_t>(closest.facet)];
    answer.meets = true;
    answer.squared_distance = closest.at.squared_distance;
    answer.normal = to_array(smoothed);
    answer.weights = closest.at.weights;
    answer.masters = {-1, -1, -1};
    for (std::size_t k = 0; k < static_cast<std::size_t>(mesh.dim); ++k) {
      answer.masters[k] = mesh.global_node(mesh.nodes_of_facet(facet)[k]);
    }
  }

  Vector smoothed_normal(const ClosestFacet& closest) const {
    Vector normal = Vector::Zero();
    for (int k = 0; k < set_.dim; ++k) {
      normal += closest.at.weights[static_cast<std::size_t>(k)] *
                surface_.corner_normal(facets_[static_cast<std::size_t>(closest.facet)], k);
    }
    return normal.normalized();
  }

  const FreeSurface& surface_;
  std::vector<LocalId> facets_;
  FacetSet set_;
  std::vector<Vector> normals_;
  FacetTree tree_;
};

/// Of the answers of all ranks, whatever their order.
struct BestAnswer {
  std::optional<Answer> met;  ///< the closest that the node meets
  Real nearest_squared_distance = std::numeric_limits<Real>::infinity();
  Real nearest_side = 0;

  void take(const Answer& answer) {
    if (answer.meets && (!met || answer.squared_distance < met->squared_distance)) met = answer;
    const bool is_nearer = answer.nearest_squared_distance < nearest_squared_distance;
    if (is_nearer ||
        (answer.nearest_squared_distance == nearest_squared_distance && answer.nearest_side > nearest_side)) {
      nearest_squared_distance = answer.nearest_squared_distance;
      nearest_side = answer.nearest_side;
    }
  }

  /// A node outside a facet that is nearer than the one which it seems to have gone through went round the rim, where
  /// it is beyond the rim or deep; nodes of flush sides are neither.
  bool meets() const {
    if (!met) return false;
    const bool is_outside = met->gap < 0 && nearest_side > flush * met->size &&
                            nearest_squared_distance < same_place * met->squared_distance;
    return !is_outside || std::max(nearest_side, -met->gap) <= overhang * met->size;
  }
};

/// The boxes of all ranks' master facets, in rank order.
std::vector<Bounds> boxes_of_ranks(const Communicator& comm, const Bounds& mine) {
  std::vector<Bounds> boxes(static_cast<std::size_t>(comm.size()));
  for (Eigen::Index i = 0; i < 3; ++i) {
    const std::vector<Real> lows = comm.gather_to_all(mine.low[i]);
    const std::vector<Real> highs = comm.gather_to_all(mine.high[i]);
    for (std::size_t r = 0; r < boxes.size(); ++r) {
      boxes[r].low[i] = lows[r];
      boxes[r].high[i] = highs[r];
    }
  }
  return boxes;
}

}  // namespace

std::vector<NodeFacetPair> find_pairs(const Communicator& comm, const FreeSurface& surface,
                                      std::span<const Vector> positions, const PairSearch& search) {
  const MasterFacets masters(surface, positions, search.master_body);
  const std::vector<Bounds> boxes = boxes_of_ranks(comm, masters.bounds());
  std::map<int, std::vector<Question>> questions;
  for (std::size_t i = 0; i < surface.nodes().size(); ++i) {
    const LocalId node = surface.nodes()[i];
    if (surface.body_of_node(node) != search.slave_body) continue;
    const Vector& point = positions[static_cast<std::size_t>(node)];
    for (std::size_t r = 0; r < boxes.size(); ++r) {
      if (boxes[r].squared_distance(point) > search.reach * search.reach) continue;
      questions[static_cast<int>(r)].push_back(
          {static_cast<std::int64_t>(i), to_array(point), to_array(surface.normal(i))});
    }
  }
  std::map<int, std::vector<Answer>> answers;
  for (const auto& [rank, asked] : sparse_exchange(comm, questions)) {
    for (const Question& question : asked) {
      const Answer answer = masters.answer(question, search.reach);
      if (answer.index >= 0) answers[rank].push_back(answer);
    }
  }
  std::map<std::int64_t, BestAnswer> best;
  for (const auto& [rank, given] : sparse_exchange(comm, answers)) {
    for (const Answer& answer : given) best[answer.index].take(answer);
  }
  std::vector<NodeFacetPair> pairs;
  for (const auto& [index, of_all_ranks] : best) {
    if (!of_all_ranks.meets()) continue;
    const Answer& answer = *of_all_ranks.met;
    const auto place = static_cast<std::size_t>(index);
    pairs.push_back(
        {surface.nodes()[place], place, answer.masters, answer.weights, to_vector(answer.normal), answer.gap});
  }
  return pairs;
}

}  // namespace malleus::forge
