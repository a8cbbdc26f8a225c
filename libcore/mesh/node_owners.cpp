#include "mesh/node_owners.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/error.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

/// Neighbours hear of each other's loads and correct their shares so many times.
constexpr int sweeps = 10;
/// Of what would make two loads equal, so much is moved in a sweep, as other ranks do the same.
constexpr Real damping = 0.5;

/// Nodes of the same holders, and how many of them each holder shall own. The lowest holder sees to it.
struct Group {
  std::vector<std::size_t> nodes;   ///< places in SharedNodes
  std::vector<std::int64_t> given;  ///< [holder], adding up to the nodes
};

class OwnerChoice {
 public:
  OwnerChoice(const Communicator& comm, const SharedNodes& shared, Real load)
      : comm_(comm), shared_(shared), own_load_(load) {
    for (std::size_t i = 0; i < shared.holders.size(); ++i) {
      const std::vector<int>& holders = shared.holders[i];
      neighbours_.insert(holders.begin(), holders.end());
      if (holders.front() == comm.rank()) groups_[holders].nodes.push_back(i);
    }
    for (auto& [holders, group] : groups_) {
      const auto ranks = static_cast<std::int64_t>(holders.size());
      const auto nodes = static_cast<std::int64_t>(group.nodes.size());
      for (std::int64_t h = 0; h < ranks; ++h) group.given.push_back((h + 1) * nodes / ranks - h * nodes / ranks);
    }
  }

  std::vector<int> run() {
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      tell_loads();
      for (auto& [holders, group] : groups_) level(holders, group);
    }
    return tell_owners();
  }

 private:
  /// Each rank adds up what it was given and tells its neighbours its load.
  void tell_loads() {
    std::map<int, std::vector<std::int64_t>> gifts;
    for (const auto& [holders, group] : groups_) {
      for (std::size_t h = 0; h < holders.size(); ++h) {
        std::vector<std::int64_t>& gift = gifts[holders[h]];
        gift.resize(1, 0);
        gift[0] += group.given[h];
      }
    }
    Real load = own_load_;
    for (const auto& [rank, gift] : sparse_exchange(comm_, gifts)) load += static_cast<Real>(gift[0]);
    std::map<int, std::vector<Real>> told;
    for (const int rank : neighbours_) told[rank] = {load};
    loads_.clear();
    for (const auto& [rank, heard] : sparse_exchange(comm_, told)) loads_[rank] = heard[0];
  }

  /// Nodes from the holder with most to do, of those that have any, to the one with least.
  void level(const std::vector<int>& holders, Group& group) {
    for (std::size_t step = 0; step + 1 < holders.size(); ++step) {
      std::size_t most = holders.size();
      std::size_t least = 0;
      for (std::size_t h = 0; h < holders.size(); ++h) {
        if (group.given[h] > 0 && (most == holders.size() || loads_[holders[h]] > loads_[holders[most]])) most = h;
        if (loads_[holders[h]] < loads_[holders[least]]) least = h;
      }
      if (most == holders.size()) return;
      const Real excess = 0.5 * damping * (loads_[holders[most]] - loads_[holders[least]]);
      const auto moved = std::min(group.given[most], static_cast<std::int64_t>(std::max(0.0, std::round(excess))));
      if (moved == 0) return;
      group.given[most] -= moved;
      group.given[least] += moved;
      loads_[holders[most]] -= static_cast<Real>(moved);
      loads_[holders[least]] += static_cast<Real>(moved);
    }
  }

  /// Puts a number and its owner down for the other holders.
  void tell(const std::vector<int>& holders, std::initializer_list<GlobalId> owner,
            std::map<int, std::vector<GlobalId>>& told) const {
    for (const int rank : holders) {
      if (rank != comm_.rank()) told[rank].insert(told[rank].end(), owner);
    }
  }

  std::vector<int> tell_owners() const {
    std::vector<int> owners(shared_.numbers.size(), -1);
    std::map<int, std::vector<GlobalId>> told;  // pairs: number, owner
    for (const auto& [holders, group] : groups_) {
      std::size_t next = 0;
      for (std::size_t h = 0; h < holders.size(); ++h) {
        for (std::int64_t n = 0; n < group.given[h]; ++n) {
          owners[group.nodes[next]] = holders[h];
          tell(holders, {shared_.numbers[group.nodes[next++]], holders[h]}, told);
        }
      }
    }
    std::vector<std::pair<GlobalId, std::size_t>> places;
    for (std::size_t i = 0; i < owners.size(); ++i) places.emplace_back(shared_.numbers[i], i);
    std::sort(places.begin(), places.end());
    for (const auto& [rank, pairs] : sparse_exchange(comm_, told)) {
      for (std::size_t i = 0; i < pairs.size(); i += 2) {
        const auto found = std::lower_bound(places.begin(), places.end(), std::pair(pairs[i], std::size_t{0}));
        check(found != places.end() && found->first == pairs[i], "owners are told to holders only");
        owners[found->second] = static_cast<int>(pairs[i + 1]);
      }
    }
    check(std::find(owners.begin(), owners.end(), -1) == owners.end(), "each shared node has an owner");
    return owners;
  }

  const Communicator& comm_;
  const SharedNodes& shared_;
  Real own_load_;
  std::set<int> neighbours_;  ///< this rank among them, if it shares anything
  std::map<std::vector<int>, Group> groups_;
  std::map<int, Real> loads_;
};

}  // namespace

std::vector<int> choose_node_owners(const Communicator& comm, const SharedNodes& shared, Real load) {
  if (comm.size() == 1) return {};
  return OwnerChoice(comm, shared, load).run();
}

}  // namespace malleus
