#pragma once

/// Measuring the machine that the program runs on: speeds of the processors and bandwidths of the links.

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "mesh/node_owners.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

struct ProbeOptions {
  Real seconds = 0.5;  ///< spent on the speed of each processor, all at once, as in a run
  Real node_weight =
      node_work_in_elements;  ///< work per node in the WorkModel that the file is for: it gives bandwidths their unit
};

/// What was measured; complete on the root, which writes it.
struct MachineProbe {
  std::vector<Real> products;  ///< [rank] nodes per second of a sparse product of 4 x 4 blocks, best of the repetitions
  std::vector<Real> spread;    ///< [rank] median over best time: above about 1.3 something else was running
  std::vector<Real> speed;     ///< [rank] s_p, the fastest 1; differences below 5 % are taken for noise
  std::vector<int> computer;   ///< [rank] number of the computer (shared memory) it is on
  Real latency = 0;            ///< s, median over the links
  Real inner = 0;              ///< v_pq on one computer, work per datum; 0 where there is no such link
  Real outer = 0;              ///< v_pq between computers; 0 where there is no such link
  std::map<std::pair<int, int>, Real> odd_links;  ///< more than a factor of two from these
};

/// Speeds: every rank multiplies a matrix larger than its cache at the same time. Links: all pairs in rounds of
/// disjoint pairs, messages of 8 bytes and 64 KiB. Collective.
MachineProbe probe_machine(const Communicator& comm, const ProbeOptions& options);

/// The text of an architecture file, with what was measured in its comments.
std::string architecture_text(const MachineProbe& probe);

}  // namespace malleus
