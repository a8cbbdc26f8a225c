#include "partition/relabel.hpp"

#include <algorithm>

#include "parallel/gather.hpp"

namespace malleus {
namespace {

/// Weight that a new part has in common with an old one.
struct Overlap {
  int part;
  int old_part;
  Real weight;
};

void merge(std::vector<Overlap>& overlaps) {
  std::sort(overlaps.begin(), overlaps.end(), [](const Overlap& a, const Overlap& b) {
    return std::tie(a.part, a.old_part, a.weight) < std::tie(b.part, b.old_part, b.weight);
  });
  std::vector<Overlap> merged;
  for (const Overlap& overlap : overlaps) {
    if (!merged.empty() && merged.back().part == overlap.part && merged.back().old_part == overlap.old_part) {
      merged.back().weight += overlap.weight;
    } else {
      merged.push_back(overlap);
    }
  }
  overlaps = std::move(merged);
}

std::vector<Overlap> find_overlaps(const Communicator& comm, const WorkGraph& graph, std::span<const int> old_parts,
                                   std::span<const int> parts) {
  std::vector<Overlap> overlaps;
  for (std::size_t v = 0; v < parts.size(); ++v) {
    if (!overlaps.empty() && overlaps.back().part == parts[v] && overlaps.back().old_part == old_parts[v]) {
      overlaps.back().weight += graph.weights[v];
    } else {
      overlaps.push_back({parts[v], old_parts[v], graph.weights[v]});
    }
  }
  merge(overlaps);
  overlaps = gather_lists<Overlap>(comm, overlaps);
  merge(overlaps);
  return overlaps;
}

}  // namespace

void relabel_parts(const Communicator& comm, const WorkGraph& graph, const Architecture& architecture,
                   std::span<const int> old_parts, std::vector<int>& parts) {
  std::vector<Overlap> overlaps = find_overlaps(comm, graph, old_parts, parts);
  std::stable_sort(overlaps.begin(), overlaps.end(),
                   [](const Overlap& a, const Overlap& b) { return a.weight > b.weight; });
  const auto n = static_cast<std::size_t>(architecture.parts());
  std::vector<int> name(n, -1);
  std::vector<char> is_taken(n, 0);
  const auto join = [&](int part, int old_part) {
    const auto p = static_cast<std::size_t>(part);
    const auto o = static_cast<std::size_t>(old_part);
    if (name[p] >= 0 || is_taken[o] != 0 || !architecture.are_alike(part, old_part)) return;
    name[p] = old_part;
    is_taken[o] = 1;
  };
  for (const Overlap& overlap : overlaps) join(overlap.part, overlap.old_part);
  for (int part = 0; part < architecture.parts(); ++part) join(part, part);
  for (int part = 0; part < architecture.parts(); ++part) {
    for (int old_part = 0; name[static_cast<std::size_t>(part)] < 0 && old_part < architecture.parts(); ++old_part) {
      join(part, old_part);
    }
  }
  for (int& part : parts) part = name[static_cast<std::size_t>(part)];
}

}  // namespace malleus
