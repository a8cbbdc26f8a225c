#include "solvers/arrival_trace.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "base/index.hpp"
#include "mesh/faces.hpp"
#include "mesh/simplex.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

constexpr Real never = std::numeric_limits<Real>::infinity();
constexpr Real step_share = 0.25;  ///< of an element
constexpr int most_idle = 400;     ///< faces crossed without moving: around a vertex
constexpr int exterior = -2;       ///< in place of a neighbour; -3 - k: face k between ranks
constexpr std::int32_t crossings_per_length = 20;

/// A node on its way back.
struct Traveller {
  std::int32_t home_rank = 0;
  LocalId home_node = 0;
  LocalId element = 0;  ///< on arrival from another rank: the face between ranks
  std::int32_t crossings = 0;
  std::int32_t idle = 0;
  std::array<Real, 4> weights{};  ///< barycentric; on arrival those of the face, by increasing global nodes
  Real elapsed = 0;               ///< s
};

struct Arrival {
  LocalId node = 0;
  Real time = 0;
};

/// One side of a face between ranks.
struct BorderFace {
  LocalId element = 0;
  int face = 0;
  std::array<int, 3> order{};  ///< places of its nodes in the element, by increasing global number
  int rank = -1;               ///< of the other side
  std::int32_t other = -1;     ///< its number there
};

struct FaceOffer {
  std::array<GlobalId, 3> key{};
  std::int32_t number = 0;
  std::int32_t rank = 0;
};

struct FaceMatch {
  std::int32_t number = 0;
  std::int32_t rank = 0;
  std::int32_t other = 0;
};

template <int D>
class Tracer {
 public:
  Tracer(const Communicator& comm, const Mesh& mesh, std::span<const Real> velocity, std::span<const Real> start)
      : comm_(comm), mesh_(mesh), velocity_(velocity), start_(start) {
    neighbours_ = element_neighbours(D, mesh.nodes(), mesh.element_nodes);
    mark_exterior();
    find_borders();
    const Real length = std::pow(static_cast<Real>(std::max<GlobalId>(1, mesh.total_elements)), 1.0 / D);
    most_crossings_ = static_cast<std::int32_t>(1000 + crossings_per_length * length);
  }

  std::vector<Real> run() {
    times_.assign(index(mesh_.nodes()), never);
    std::vector<Traveller> travellers = departures();
    while (comm_.any(!travellers.empty())) {
      for (Traveller& traveller : travellers) walk(traveller);
      travellers = exchange();
    }
    mesh_.node_halo.update_copies(std::span(times_), 1);
    return std::move(times_);
  }

 private:
  using Weights = Eigen::Matrix<Real, D + 1, 1>;
  static constexpr std::size_t sides = D + 1;

  std::int32_t& neighbour(LocalId element, int face) {
    return neighbours_[index(element) * sides + static_cast<std::size_t>(face)];
  }

  void mark_exterior() {
    for (LocalId f = 0; f < mesh_.exterior_facets; ++f) {
      const LocalId element = mesh_.facet_element[index(f)];
      const auto facet = mesh_.nodes_of_facet(f);
      const auto nodes = mesh_.nodes_of_element(element);
      for (std::size_t i = 0; i < sides; ++i) {
        if (std::find(facet.begin(), facet.end(), nodes[i]) == facet.end())
          neighbour(element, static_cast<int>(i)) = exterior;
      }
    }
  }

  /// Faces that are neither matched here nor exterior are matched where their lowest node is owned.
  void find_borders() {
    std::map<int, std::vector<FaceOffer>> offers;
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      for (int face = 0; face <= D; ++face) {
        if (neighbour(e, face) != -1) continue;
        BorderFace border{e, face, {}, -1, -1};
        FaceOffer offer;
        const auto nodes = mesh_.nodes_of_element(e);
        const auto number = [&](int place) { return mesh_.global_node(nodes[static_cast<std::size_t>(place)]); };
        for (std::size_t k = 0; k < D; ++k) border.order[k] = face_node(D, face, static_cast<int>(k));
        std::sort(border.order.begin(), border.order.begin() + D, [&](int a, int b) { return number(a) < number(b); });
        for (std::size_t k = 0; k < D; ++k) offer.key[k] = number(border.order[k]);
        offer.number = static_cast<std::int32_t>(borders_.size());
        offer.rank = comm_.rank();
        neighbour(e, face) = -3 - offer.number;
        borders_.push_back(border);
        offers[mesh_.node_ownership.owner_of(offer.key[0])].push_back(offer);
      }
    }
    std::vector<FaceOffer> all;
    for (const auto& [rank, list] : sparse_exchange(comm_, offers)) all.insert(all.end(), list.begin(), list.end());
    std::stable_sort(all.begin(), all.end(), [](const FaceOffer& a, const FaceOffer& b) { return a.key < b.key; });
    std::map<int, std::vector<FaceMatch>> matches;
    for (std::size_t i = 0; i + 1 < all.size(); ++i) {
      if (all[i].key != all[i + 1].key) continue;
      matches[all[i].rank].push_back({all[i].number, all[i + 1].rank, all[i + 1].number});
      matches[all[i + 1].rank].push_back({all[i + 1].number, all[i].rank, all[i].number});
    }
    for (const auto& [rank, list] : sparse_exchange(comm_, matches)) {
      for (const FaceMatch& match : list) {
        borders_[static_cast<std::size_t>(match.number)].rank = match.rank;
        borders_[static_cast<std::size_t>(match.number)].other = match.other;
      }
    }
  }

  /// Owned nodes, from any element here that has them.
  std::vector<Traveller> departures() {
    std::vector<LocalId> element_of(index(mesh_.nodes()), -1);
    for (LocalId e = 0; e < mesh_.elements(); ++e) {
      for (const LocalId node : mesh_.nodes_of_element(e)) element_of[index(node)] = e;
    }
    std::vector<Traveller> travellers;
    for (LocalId node = 0; node < mesh_.owned_nodes(); ++node) {
      const LocalId element = element_of[index(node)];
      if (start_[index(node)] > 0) times_[index(node)] = 0;
      if (start_[index(node)] > 0 || element < 0) continue;
      Traveller traveller;
      traveller.home_rank = comm_.rank();
      traveller.home_node = node;
      traveller.element = element;
      const auto nodes = mesh_.nodes_of_element(element);
      const auto place = std::find(nodes.begin(), nodes.end(), node) - nodes.begin();
      traveller.weights[static_cast<std::size_t>(place)] = 1;
      travellers.push_back(traveller);
    }
    return travellers;
  }

  void finish(const Traveller& traveller, Real time) {
    if (traveller.home_rank == comm_.rank()) {
      times_[index(traveller.home_node)] = time;
    } else {
      arrivals_[traveller.home_rank].push_back({traveller.home_node, time});
    }
  }

  /// Until the traveller is where the fluid started, gives up, or leaves this rank.
  void walk(Traveller& traveller) {
    while (traveller.crossings < most_crossings_ && traveller.idle < most_idle) {
      const LocalId element = traveller.element;
      int face = -1;
      const bool has_arrived = cross_element(traveller, face);
      if (has_arrived) return finish(traveller, traveller.elapsed);
      if (face < 0) return finish(traveller, never);
      ++traveller.crossings;
      const std::int32_t next = neighbour(element, face);
      if (next < exterior) return hand_over(traveller, borders_[static_cast<std::size_t>(-3 - next)]);
      enter(traveller, element, next);
    }
    finish(traveller, never);
  }

  /// Backwards to a face that is not exterior; -1 where nothing moves. True where the fluid was on the way.
  bool cross_element(Traveller& traveller, int& face) {
    const LocalId element = traveller.element;
    const auto nodes = mesh_.nodes_of_element(element);
    const auto p1 = p1_gradients<D>(simplex_points<D>(mesh_, element));
    Eigen::Matrix<Real, D, D + 1> velocities;
    Weights start;
    for (std::size_t i = 0; i < sides; ++i) {
      velocities.col(static_cast<Eigen::Index>(i)) = Eigen::Map<const Point<D>>(velocity_.data() + index(nodes[i]) * D);
      start[static_cast<Eigen::Index>(i)] = start_[index(nodes[i])];
    }
    const Eigen::Matrix<Real, D + 1, D + 1> rates = -p1.gradients.transpose() * velocities;
    Eigen::Map<Weights> at(traveller.weights.data());
    constexpr int most_steps = 200;
    for (int step = 0; step < most_steps; ++step) {
      const Weights first = rates * at;
      const Real fastest = first.cwiseAbs().maxCoeff();
      if (!(fastest > 1e-200)) return false;
      Real dt = step_share / fastest;
      Weights change = rates * (at + 0.5 * dt * first);
      slide(element, at, change);
      const Real share = leave_by(at, dt * change, traveller.idle, face);
      const Weights next = at + share * dt * change;
      const Real before = start.dot(at);
      const Real after = start.dot(next);
      if (after > 0) {
        traveller.elapsed += share * dt * (before < 0 ? -before / (after - before) : 0);
        return true;
      }
      traveller.elapsed += share * dt;
      traveller.idle = share * dt * fastest > 1e-9 ? 0 : traveller.idle + 1;
      at = next;
      if (face < 0) continue;
      at[face] = 0;
      if (neighbour(element, face) != exterior) return false;
      face = -1;
      if (traveller.idle >= most_idle) return false;
    }
    return false;
  }

  /// The share of a step up to the first face that it meets, and that face, -1: none. At a vertex several faces are met
  /// at once, and always taking the first may lead around it in a circle: the choice turns with the faces crossed in
  /// vain (a stochastic walk: Devillers, Pion, Teillaud 2002).
  static Real leave_by(const Weights& at, const Weights& step, std::int32_t idle, int& face) {
    Real share = 1;
    for (int i = 0; i <= D; ++i) {
      if (step[i] < 0) share = std::clamp(at[i] / -step[i], 0.0, share);
    }
    std::array<int, 4> met{};
    std::uint32_t count = 0;
    for (int i = 0; i <= D; ++i) {
      if (at[i] + share * step[i] <= 1e-14 && step[i] < 0) met[count++] = i;
    }
    if (count == 0 || (share == 1 && (at + step).minCoeff() > 0)) return share;
    const std::uint32_t turned = static_cast<std::uint32_t>(idle) * 2654435761U;
    face = met[(turned >> 16U) % count];
    return share;
  }

  /// Along exterior faces, not through them.
  void slide(LocalId element, const Weights& at, Weights& change) {
    for (int i = 0; i <= D; ++i) {
      if (at[i] > 1e-12 || !(change[i] < 0) || neighbour(element, i) != exterior) continue;
      const Real through = change[i];
      change[i] = 0;
      for (int j = 0; j <= D; ++j) change[j] += j == i ? 0 : through / D;
    }
  }

  void enter(Traveller& traveller, LocalId from, LocalId to) {
    const auto old_nodes = mesh_.nodes_of_element(from);
    const auto new_nodes = mesh_.nodes_of_element(to);
    std::array<Real, 4> weights{};
    for (std::size_t i = 0; i < sides; ++i) {
      const auto place = std::find(old_nodes.begin(), old_nodes.end(), new_nodes[i]);
      if (place != old_nodes.end()) weights[i] = traveller.weights[static_cast<std::size_t>(place - old_nodes.begin())];
    }
    traveller.weights = weights;
    traveller.element = to;
  }

  void hand_over(Traveller traveller, const BorderFace& border) {
    std::array<Real, 4> weights{};
    for (std::size_t k = 0; k < D; ++k) weights[k] = traveller.weights[static_cast<std::size_t>(border.order[k])];
    traveller.weights = weights;
    traveller.element = border.other;
    leaving_[border.rank].push_back(traveller);
  }

  std::vector<Traveller> exchange() {
    for (const auto& [rank, list] : sparse_exchange(comm_, arrivals_)) {
      for (const Arrival& arrival : list) times_[index(arrival.node)] = arrival.time;
    }
    arrivals_.clear();
    std::vector<Traveller> arrived;
    for (auto& [rank, list] : sparse_exchange(comm_, leaving_)) {
      for (Traveller& traveller : list) {
        const BorderFace& border = borders_[index(traveller.element)];
        std::array<Real, 4> weights{};
        for (std::size_t k = 0; k < D; ++k) weights[static_cast<std::size_t>(border.order[k])] = traveller.weights[k];
        traveller.weights = weights;
        traveller.element = border.element;
        arrived.push_back(traveller);
      }
    }
    leaving_.clear();
    return arrived;
  }

  const Communicator& comm_;
  const Mesh& mesh_;
  std::span<const Real> velocity_;
  std::span<const Real> start_;
  std::vector<LocalId> neighbours_;
  std::vector<BorderFace> borders_;
  std::int32_t most_crossings_ = 0;
  std::vector<Real> times_;
  std::map<int, std::vector<Arrival>> arrivals_;
  std::map<int, std::vector<Traveller>> leaving_;
};

}  // namespace

std::vector<Real> arrival_times(const Communicator& comm, const Mesh& mesh, std::span<const Real> velocity,
                                std::span<const Real> start) {
  return with_dim(mesh.dim, [&](auto d) { return Tracer<decltype(d)::value>(comm, mesh, velocity, start).run(); });
}

}  // namespace malleus
