#pragma once

/// The machine as the partitioner sees it: speeds s_p of the processors and bandwidths v_pq of the links between them.

#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// One processor a part. Work w takes w / s_p on processor p; data of amount d takes d / v_pq between p and q.
struct Architecture {
  std::vector<Real> speed;     ///< s_p > 0, [part]
  Real bandwidth = 1;          ///< v_pq > 0 unless said otherwise below; infinite = communication is free
  std::vector<int> cluster;    ///< [part], or empty: all in one
  Real cluster_bandwidth = 1;  ///< v_pq > 0 between different clusters
  std::map<std::pair<int, int>, Real> links;  ///< exceptions: (p < q) -> v_pq > 0

  int parts() const noexcept { return static_cast<int>(speed.size()); }
  Real total_speed() const;
  Real link(int p, int q) const;                                    ///< v_pq, p != q
  Real inverse_link(int p, int q) const { return 1 / link(p, q); }  ///< time per unit of data
  Real relative_link(int p, int q) const { return link(p, q) / bandwidth; }
  bool has_equal_links() const { return links.empty() && cluster.empty(); }
  bool has_equal_speeds() const;
  /// Whether p and q can be exchanged without changing any cost, as far as speeds and clusters tell.
  bool are_alike(int p, int q) const;
};

/// Equal processors, links of bandwidth 1. Local.
Architecture equal_architecture(int parts);

/// Reads an architecture file:
///     [architecture]
///     speed = 1 1 1.5 1.5     ; a number per part; a single one is for all
///     bandwidth = 10          ; or the name of a file with the matrix v_pq, parts x parts numbers
///     link.0-1 = 100          ; symmetric exceptions
///     cluster = 0 0 1 1       ; parts between which the default is cluster_bandwidth instead
///     cluster_bandwidth = 1
/// InputError where a speed or bandwidth is not > 0, or a count is not that of the parts. Collective.
Architecture read_architecture(const Communicator& comm, const std::filesystem::path& path, int parts);

}  // namespace malleus
