#include "partition/pieces.hpp"

#include <algorithm>
#include <numeric>

#include "base/error.hpp"
#include "parallel/gather.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

LocalId find_root(std::vector<LocalId>& parent, LocalId vertex) {
  while (parent[static_cast<std::size_t>(vertex)] != vertex) {
    LocalId& up = parent[static_cast<std::size_t>(vertex)];
    up = parent[static_cast<std::size_t>(up)];
    vertex = up;
  }
  return vertex;
}

/// What one rank knows of a piece: its weight here, or edges from it to another part.
struct PieceFact {
  GlobalId piece;
  std::int64_t part;   ///< that it belongs to
  std::int64_t other;  ///< part across `edges`, or -1 where `amount` is its weight
  Real amount;
  bool operator<(const PieceFact& b) const {
    return std::tie(piece, part, other, amount) < std::tie(b.piece, b.part, b.other, b.amount);
  }
};

/// Sums of equal facts.
std::vector<PieceFact> merge(std::vector<PieceFact> facts) {
  std::sort(facts.begin(), facts.end());
  std::vector<PieceFact> merged;
  for (const PieceFact& fact : facts) {
    if (!merged.empty() && merged.back().piece == fact.piece && merged.back().other == fact.other) {
      merged.back().amount += fact.amount;
    } else {
      merged.push_back(fact);
    }
  }
  return merged;
}

/// All ranks' facts about the pieces whose lowest vertex this rank owns.
std::vector<PieceFact> send_to_owners(const Communicator& comm, const WorkGraph& graph, std::vector<PieceFact> facts) {
  facts = merge(std::move(facts));
  if (comm.size() == 1) return facts;
  std::map<int, std::vector<PieceFact>> outgoing;
  for (const PieceFact& fact : facts) outgoing[graph.ownership.owner_of(fact.piece)].push_back(fact);
  facts.clear();
  for (const auto& [rank, list] : sparse_exchange(comm, outgoing)) facts.insert(facts.end(), list.begin(), list.end());
  return merge(std::move(facts));
}

std::vector<PieceFact> weigh_pieces(const WorkGraph& graph, std::span<const int> parts,
                                    std::span<const GlobalId> pieces) {
  std::vector<PieceFact> facts;
  for (LocalId v = 0; v < graph.owned(); ++v) {
    const auto i = static_cast<std::size_t>(v);
    if (!facts.empty() && facts.back().piece == pieces[i]) {
      facts.back().amount += graph.weights[i];
    } else {
      facts.push_back({pieces[i], parts[i], -1, graph.weights[i]});
    }
  }
  return facts;
}

/// The heaviest piece of each part: [part] its number, -1 of an empty part.
std::vector<GlobalId> find_main_pieces(const Communicator& comm, std::span<const PieceFact> weights, int n_parts) {
  std::vector<PieceFact> best(static_cast<std::size_t>(n_parts), {-1, -1, -1, -1});
  const auto improve = [&](const PieceFact& fact) {
    PieceFact& known = best[static_cast<std::size_t>(fact.part)];
    if (fact.amount > known.amount || (fact.amount == known.amount && fact.piece < known.piece)) known = fact;
  };
  for (const PieceFact& fact : weights) improve(fact);
  std::vector<PieceFact> mine;
  for (const PieceFact& fact : best) {
    if (fact.piece >= 0) mine.push_back(fact);
  }
  for (const PieceFact& fact : gather_lists<PieceFact>(comm, mine)) improve(fact);
  std::vector<GlobalId> main_pieces;
  for (const PieceFact& fact : best) main_pieces.push_back(fact.piece);
  return main_pieces;
}

/// New part of each stray piece, (piece, part), by increasing piece; known to all ranks.
struct Adoption {
  GlobalId piece;
  std::int64_t from;
  std::int64_t to;
  Real weight;
};

std::vector<Adoption> choose_adoptions(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts,
                                       std::span<const GlobalId> pieces, std::span<const Real> targets) {
  const std::vector<PieceFact> weights = send_to_owners(comm, graph, weigh_pieces(graph, parts, pieces));
  const std::vector<GlobalId> main_pieces = find_main_pieces(comm, weights, static_cast<int>(targets.size()));
  std::vector<PieceFact> facts;
  for (LocalId v = 0; v < graph.owned(); ++v) {
    const int part = parts[static_cast<std::size_t>(v)];
    const GlobalId piece = pieces[static_cast<std::size_t>(v)];
    if (main_pieces[static_cast<std::size_t>(part)] == piece) continue;
    facts.push_back({piece, part, -1, graph.weights[static_cast<std::size_t>(v)]});
    for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
      const int other = parts[static_cast<std::size_t>(graph.neighbours[j])];
      if (other != part) facts.push_back({piece, part, other, static_cast<Real>(graph.edge_weights[j])});
    }
  }
  facts = send_to_owners(comm, graph, std::move(facts));
  std::vector<Adoption> adoptions;
  for (std::size_t first = 0; first < facts.size();) {
    const PieceFact& head = facts[first];  // other = -1: the weight comes first
    Adoption adoption = {head.piece, head.part, -1, head.amount};
    Real most = 0;
    for (++first; first < facts.size() && facts[first].piece == adoption.piece; ++first) {
      if (facts[first].amount <= most) continue;
      most = facts[first].amount;
      adoption.to = facts[first].other;
    }
    const bool is_small = adoption.weight <= 0.5 * targets[static_cast<std::size_t>(adoption.from)];
    if (adoption.to >= 0 && is_small) adoptions.push_back(adoption);
  }
  adoptions = gather_lists<Adoption>(comm, adoptions);
  std::sort(adoptions.begin(), adoptions.end(), [](const auto& a, const auto& b) { return a.piece < b.piece; });
  return adoptions;
}

}  // namespace

std::vector<GlobalId> find_pieces(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts) {
  std::vector<LocalId> parent(static_cast<std::size_t>(graph.vertices()));
  std::iota(parent.begin(), parent.end(), 0);
  for (LocalId v = 0; v < graph.owned(); ++v) {
    for (std::size_t j = graph.first(v); j < graph.last(v); ++j) {
      const LocalId other = graph.neighbours[j];
      if (parts[static_cast<std::size_t>(other)] != parts[static_cast<std::size_t>(v)]) continue;
      const LocalId a = find_root(parent, v);
      const LocalId b = find_root(parent, other);
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  std::vector<GlobalId> lowest(parent.size());  // of each local piece, at its root
  for (LocalId v = 0; v < graph.vertices(); ++v) lowest[static_cast<std::size_t>(v)] = graph.number(v);
  std::vector<LocalId> roots(parent.size());
  for (LocalId v = 0; v < graph.vertices(); ++v) roots[static_cast<std::size_t>(v)] = find_root(parent, v);
  std::vector<GlobalId> pieces(parent.size());
  const auto settle = [&] {
    for (std::size_t v = 0; v < roots.size(); ++v) {
      GlobalId& least = lowest[static_cast<std::size_t>(roots[v])];
      least = std::min(least, lowest[v]);
    }
    for (std::size_t v = 0; v < roots.size(); ++v) pieces[v] = lowest[static_cast<std::size_t>(roots[v])];
  };
  settle();
  for (bool has_changed = comm.size() > 1; has_changed;) {
    const std::vector<GlobalId> before = pieces;
    graph.halo.update_copies(std::span<GlobalId>(pieces), 1);
    lowest = pieces;
    settle();
    has_changed = comm.any(before != pieces);
  }
  return pieces;
}

GlobalId count_stray_pieces(const Communicator& comm, const WorkGraph& graph, std::span<const int> parts, int n_parts) {
  const std::vector<GlobalId> pieces = find_pieces(comm, graph, parts);
  std::vector<GlobalId> per_part(static_cast<std::size_t>(n_parts), 0);
  for (LocalId v = 0; v < graph.owned(); ++v) {
    const auto i = static_cast<std::size_t>(v);
    if (pieces[i] == graph.number(v)) ++per_part[static_cast<std::size_t>(parts[i])];
  }
  comm.sum_in_place(std::span<GlobalId>(per_part));
  GlobalId stray = 0;
  for (const GlobalId count : per_part) stray += std::max<GlobalId>(0, count - 1);
  return stray;
}

GlobalId absorb_stray_pieces(const Communicator& comm, const WorkGraph& graph, std::vector<int>& parts,
                             std::vector<Real>& loads, std::span<const Real> targets) {
  const std::vector<GlobalId> pieces = find_pieces(comm, graph, parts);
  const std::vector<Adoption> adoptions = choose_adoptions(comm, graph, parts, pieces, targets);
  if (adoptions.empty()) return 0;
  for (LocalId v = 0; v < graph.vertices(); ++v) {
    const GlobalId piece = pieces[static_cast<std::size_t>(v)];
    const auto found = std::lower_bound(adoptions.begin(), adoptions.end(), piece,
                                        [](const Adoption& a, GlobalId number) { return a.piece < number; });
    if (found == adoptions.end() || found->piece != piece) continue;
    parts[static_cast<std::size_t>(v)] = static_cast<int>(found->to);
  }
  for (const Adoption& adoption : adoptions) {
    loads[static_cast<std::size_t>(adoption.from)] -= adoption.weight;
    loads[static_cast<std::size_t>(adoption.to)] += adoption.weight;
  }
  return static_cast<GlobalId>(adoptions.size());
}

}  // namespace malleus
