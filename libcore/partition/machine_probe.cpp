#include "partition/machine_probe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>

#include "parallel/gather.hpp"

namespace malleus {
namespace {

constexpr int probe_tag = 77;
constexpr std::size_t block = 4;             ///< velocity and pressure of a node
constexpr std::size_t nodes = 16384;         ///< so that the matrix, 31 MB, is in memory rather than in caches
constexpr std::size_t blocks_per_node = 15;  ///< neighbours of a node of a tetrahedral mesh, itself included
/// Products that an iteration of the linear solver costs, its preconditioner included.
constexpr Real products_per_iteration = 10;
/// Nodes in a message between neighbours, over which its latency is shared out.
constexpr Real nodes_per_message = 500;
constexpr Real equal_speeds = 0.05;

Real now() {
  return std::chrono::duration<Real>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A sparse matrix of blocks on a band of random columns.
class BlockProduct {
 public:
  BlockProduct() : values_(nodes * blocks_per_node * block * block, 1e-3), x_(nodes * block, 1), y_(nodes * block) {
    constexpr std::int64_t band = 2048;
    std::uint32_t state = 1;
    for (std::size_t row = 0; row < nodes; ++row) {
      for (std::size_t k = 0; k < blocks_per_node; ++k) {
        state = state * 1664525U + 1013904223U;
        const std::int64_t column = static_cast<std::int64_t>(row) + (state >> 8) % (2 * band) - band;
        columns_.push_back(static_cast<LocalId>(std::clamp<std::int64_t>(column, 0, nodes - 1)));
      }
    }
  }

  /// Seconds of one product.
  Real run() {
    const Real start = now();
    const Real* value = values_.data();
    for (std::size_t row = 0; row < nodes; ++row) {
      std::array<Real, block> sum = {0, 0, 0, 0};
      for (std::size_t k = 0; k < blocks_per_node; ++k) {
        const Real* x = x_.data() + static_cast<std::size_t>(columns_[row * blocks_per_node + k]) * block;
        for (std::size_t i = 0; i < block; ++i) {
          for (std::size_t j = 0; j < block; ++j) sum[i] += *value++ * x[j];
        }
      }
      std::copy(sum.begin(), sum.end(), y_.begin() + static_cast<std::ptrdiff_t>(row * block));
    }
    std::swap(x_, y_);
    return now() - start;
  }

 private:
  std::vector<LocalId> columns_;
  std::vector<Real> values_;
  std::vector<Real> x_;
  std::vector<Real> y_;
};

void probe_speeds(const Communicator& comm, const ProbeOptions& options, MachineProbe& probe) {
  BlockProduct product;
  product.run();
  std::vector<Real> times;
  comm.barrier();
  for (const Real end = now() + options.seconds; times.size() < 3 || now() < end;) times.push_back(product.run());
  std::sort(times.begin(), times.end());
  probe.products = comm.gather_to_all(static_cast<Real>(nodes) / times.front());
  probe.spread = comm.gather_to_all(times[times.size() / 2] / times.front());
  const Real fastest = *std::max_element(probe.products.begin(), probe.products.end());
  for (const Real rate : probe.products) {
    const Real speed = rate / fastest;
    probe.speed.push_back(speed > 1 - equal_speeds ? 1 : std::round(speed * 1000) / 1000);
  }
}

/// Best seconds for a message of that size to a partner, half of a ping-pong.
Real ping_pong(const Communicator& comm, int partner, int bytes, int repetitions) {
  std::vector<char> buffer(static_cast<std::size_t>(bytes));
  const bool is_first = comm.rank() < partner;
  Real best = 1e300;
  for (int i = 0; i < repetitions; ++i) {
    const Real start = now();
    const auto send = [&] { MPI_Send(buffer.data(), bytes, MPI_CHAR, partner, probe_tag, comm.raw()); };
    const auto receive = [&] {
      MPI_Recv(buffer.data(), bytes, MPI_CHAR, partner, probe_tag, comm.raw(), MPI_STATUS_IGNORE);
    };
    if (is_first) send();
    receive();
    if (!is_first) send();
    best = std::min(best, (now() - start) / 2);
  }
  return best;
}

/// Partner of a rank in a round of a tournament of an even number of players; may be itself or out of range.
int partner_in_round(int rank, int round, int players) {
  const int last = players - 1;
  if (rank == last) return round;
  if (rank == round) return last;
  return (2 * round - rank + 2 * last) % last;
}

struct LinkTime {
  int p, q;
  Real latency;
  Real per_byte;
};

std::vector<LinkTime> probe_links(const Communicator& comm) {
  constexpr int small = 8;
  constexpr int large = 65536;
  const int players = comm.size() + comm.size() % 2;
  std::vector<LinkTime> links;
  for (int round = 0; round + 1 < players; ++round) {
    const int partner = partner_in_round(comm.rank(), round, players);
    if (partner < comm.size() && partner != comm.rank()) {
      ping_pong(comm, partner, small, 5);
      const Real latency = ping_pong(comm, partner, small, 50);
      const Real long_one = ping_pong(comm, partner, large, 20);
      if (comm.rank() < partner) {
        links.push_back({comm.rank(), partner, latency, std::max(1e-13, (long_one - latency) / large)});
      }
    }
    comm.barrier();
  }
  return gather_lists<LinkTime>(comm, links);
}

/// The lowest rank that shares this rank's memory.
std::vector<int> find_computers(const Communicator& comm) {
  MPI_Comm together = MPI_COMM_NULL;
  MPI_Comm_split_type(comm.raw(), MPI_COMM_TYPE_SHARED, comm.rank(), MPI_INFO_NULL, &together);
  int lowest = comm.rank();
  MPI_Bcast(&lowest, 1, MPI_INT, 0, together);
  MPI_Comm_free(&together);
  std::vector<int> computers;
  for (const GlobalId rank : comm.gather_to_all(static_cast<GlobalId>(lowest)))
    computers.push_back(static_cast<int>(rank));
  std::vector<int> distinct = computers;
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  for (int& computer : computers) {
    computer = static_cast<int>(std::lower_bound(distinct.begin(), distinct.end(), computer) - distinct.begin());
  }
  return computers;
}

Real median(std::vector<Real> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace

MachineProbe probe_machine(const Communicator& comm, const ProbeOptions& options) {
  MachineProbe probe;
  probe_speeds(comm, options, probe);
  probe.computer = find_computers(comm);
  const std::vector<LinkTime> links = probe_links(comm);
  // An iteration works products_per_iteration on a node and sends its 4 numbers once over each link: the work that is
  // done while they travel is node_weight * (their time) / (the node's time).
  const Real fastest = *std::max_element(probe.products.begin(), probe.products.end());
  const Real node_seconds = products_per_iteration / fastest;
  const auto bandwidth = [&](const LinkTime& link) {
    const Real seconds = link.latency / nodes_per_message + link.per_byte * block * sizeof(Real);
    return node_seconds / (options.node_weight * seconds);
  };
  std::vector<Real> inner;
  std::vector<Real> outer;
  std::vector<Real> latencies;
  const auto is_inner = [&](const LinkTime& link) {
    return probe.computer[static_cast<std::size_t>(link.p)] == probe.computer[static_cast<std::size_t>(link.q)];
  };
  for (const LinkTime& link : links) {
    (is_inner(link) ? inner : outer).push_back(bandwidth(link));
    latencies.push_back(link.latency);
  }
  probe.inner = median(inner);
  probe.outer = median(outer);
  probe.latency = median(latencies);
  for (const LinkTime& link : links) {
    const Real usual = is_inner(link) ? probe.inner : probe.outer;
    const Real own = bandwidth(link);
    if (own < usual / 2 || own > usual * 2) probe.odd_links[{link.p, link.q}] = own;
  }
  return probe;
}

std::string architecture_text(const MachineProbe& probe) {
  std::string text = "; measured: rank, nodes per second of a sparse product, median over best time, computer\n";
  std::string speeds;
  std::string clusters;
  for (std::size_t r = 0; r < probe.speed.size(); ++r) {
    text += fmt::format(";   {} {:.4g} {:.2f} {}\n", r, probe.products[r], probe.spread[r], probe.computer[r]);
    speeds += fmt::format(" {:g}", probe.speed[r]);
    clusters += fmt::format(" {}", probe.computer[r]);
  }
  if (probe.latency > 0) text += fmt::format("; latency of a message {:.3g} us (median)\n", probe.latency * 1e6);
  text += "\n[architecture]\n";
  text += fmt::format("speed ={}               ; s_p, relative\n", speeds);
  const Real usual = probe.inner > 0 ? probe.inner : probe.outer > 0 ? probe.outer : 1;
  text += fmt::format("bandwidth = {:.4g}      ; v_pq, work per datum\n", usual);
  if (probe.inner > 0 && probe.outer > 0) {
    text += fmt::format("cluster ={}\ncluster_bandwidth = {:.4g}\n", clusters, probe.outer);
  }
  for (const auto& [pair, value] : probe.odd_links) {
    text += fmt::format("link.{}-{} = {:.4g}\n", pair.first, pair.second, value);
  }
  return text;
}

}  // namespace malleus
