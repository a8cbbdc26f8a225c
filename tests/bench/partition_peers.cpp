/// Runs a parallel partitioner of others on a graph that scripts/bench-partition wrote, to compare with.
///
///   mpiexec -n RANKS partition_peers GRAPH METHOD SEED OUT
///
/// METHOD: pt-scotch, zoltan-rib, or zoltan-graph (PHG on the graph; from the parts of the file where it holds some).
/// OUT gets a part a line; processor seconds of the rank that used most go to standard output.

#include <mpi.h>
#include <zoltan.h>
// Its header wants these first.
#include <cstdint>
#include <cstdio>
extern "C" {
#include <ptscotch.h>
}

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

namespace {

constexpr double tolerance = 0.03;

struct Problem {
  std::int64_t elements = 0;
  std::int64_t edges = 0;
  std::int64_t parts = 0;
  std::vector<std::int32_t> start;
  std::vector<std::int32_t> neighbours;
  std::vector<std::int32_t> weights;
  std::vector<double> speeds;      ///< [part]
  std::vector<double> centres;     ///< [element][3]
  std::vector<std::int32_t> from;  ///< [element] present part, -1 without

  bool has_start() const { return from.front() >= 0; }
};

template <class T>
void read_list(std::ifstream& file, std::vector<T>& list, std::int64_t size) {
  list.resize(static_cast<std::size_t>(size));
  file.read(reinterpret_cast<char*>(list.data()), static_cast<std::streamsize>(list.size() * sizeof(T)));
}

Problem read_problem(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  Problem p;
  for (std::int64_t* count : {&p.elements, &p.edges, &p.parts}) file.read(reinterpret_cast<char*>(count), 8);
  read_list(file, p.start, p.elements + 1);
  read_list(file, p.neighbours, p.edges);
  read_list(file, p.weights, p.elements);
  read_list(file, p.speeds, p.parts);
  read_list(file, p.centres, 3 * p.elements);
  read_list(file, p.from, p.elements);
  if (!file) {
    std::cerr << "partition_peers: " << path << " is no graph\n";
    MPI_Abort(MPI_COMM_WORLD, 2);
  }
  return p;
}

/// The elements of this rank: a block, or those of its share of the present parts.
struct Share {
  const Problem* problem = nullptr;
  int rank = 0;
  int ranks = 1;
  std::vector<std::int32_t> mine;

  Share(const Problem& p, int rank_, int ranks_) : problem(&p), rank(rank_), ranks(ranks_) {
    for (std::int32_t e = 0; e < p.elements; ++e) {
      if (holder(e) == rank) mine.push_back(e);
    }
  }
  int holder(std::int32_t e) const {
    const Problem& p = *problem;
    return static_cast<int>(p.has_start() ? p.from[static_cast<std::size_t>(e)] * std::int64_t{ranks} / p.parts
                                          : e * std::int64_t{ranks} / p.elements);
  }
  std::int32_t degree(std::size_t e) const { return problem->start[e + 1] - problem->start[e]; }
};

/// [element of this rank] its part; elements in blocks.
std::vector<std::int32_t> by_ptscotch(const Share& share, int seed) {
  const Problem& p = *share.problem;
  std::vector<SCOTCH_Num> start = {0};
  std::vector<SCOTCH_Num> neighbours;
  std::vector<SCOTCH_Num> weights;
  for (const auto e : share.mine) {
    const auto i = static_cast<std::size_t>(e);
    neighbours.insert(neighbours.end(), p.neighbours.begin() + p.start[i], p.neighbours.begin() + p.start[i + 1]);
    start.push_back(static_cast<SCOTCH_Num>(neighbours.size()));
    weights.push_back(p.weights[i]);
  }
  SCOTCH_randomSeed(seed);
  SCOTCH_randomReset();
  SCOTCH_Dgraph graph;
  SCOTCH_Strat strategy;
  SCOTCH_Arch machine;
  SCOTCH_dgraphInit(&graph, MPI_COMM_WORLD);
  const auto n = static_cast<SCOTCH_Num>(share.mine.size());
  const auto m = static_cast<SCOTCH_Num>(neighbours.size());
  SCOTCH_dgraphBuild(&graph, 0, n, n, start.data(), nullptr, weights.data(), nullptr, m, m, neighbours.data(), nullptr,
                     nullptr);
  SCOTCH_stratInit(&strategy);
  SCOTCH_stratDgraphMapBuild(&strategy, SCOTCH_STRATDEFAULT, share.ranks, static_cast<SCOTCH_Num>(p.parts), tolerance);
  SCOTCH_archInit(&machine);
  std::vector<SCOTCH_Num> loads;
  for (const double speed : p.speeds) loads.push_back(static_cast<SCOTCH_Num>(2 * speed + 0.5));
  SCOTCH_archCmpltw(&machine, static_cast<SCOTCH_Num>(p.parts), loads.data());
  std::vector<SCOTCH_Num> parts(share.mine.size());
  SCOTCH_dgraphMap(&graph, &machine, &strategy, parts.data());
  SCOTCH_archExit(&machine);
  SCOTCH_stratExit(&strategy);
  SCOTCH_dgraphExit(&graph);
  return {parts.begin(), parts.end()};
}

const Share& of(void* data) {
  return *static_cast<const Share*>(data);
}

void set_queries(Zoltan_Struct* zoltan, Share& share) {
  Zoltan_Set_Num_Obj_Fn(
      zoltan, [](void* data, int*) { return static_cast<int>(of(data).mine.size()); }, &share);
  Zoltan_Set_Obj_List_Fn(
      zoltan,
      [](void* data, int, int, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR local, int, float* weights, int*) {
        for (std::size_t i = 0; i < of(data).mine.size(); ++i) {
          global[i] = static_cast<ZOLTAN_ID_TYPE>(of(data).mine[i]);
          local[i] = static_cast<ZOLTAN_ID_TYPE>(i);
          weights[i] = static_cast<float>(of(data).problem->weights[global[i]]);
        }
      },
      &share);
  Zoltan_Set_Num_Geom_Fn(
      zoltan, [](void*, int*) { return 3; }, &share);
  Zoltan_Set_Geom_Multi_Fn(
      zoltan,
      [](void* data, int, int, int n, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR, int, double* points, int*) {
        for (int i = 0; i < n; ++i)
          std::copy_n(of(data).problem->centres.data() + 3 * std::size_t{global[i]}, 3, points + 3 * i);
      },
      &share);
  Zoltan_Set_Num_Edges_Multi_Fn(
      zoltan,
      [](void* data, int, int, int n, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR, int* counts, int*) {
        for (int i = 0; i < n; ++i) counts[i] = of(data).degree(global[i]);
      },
      &share);
  Zoltan_Set_Edge_List_Multi_Fn(
      zoltan,
      [](void* data, int, int, int n, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR, int*, ZOLTAN_ID_PTR neighbours, int* holders,
         int, float*, int*) {
        const Problem& p = *of(data).problem;
        for (int i = 0; i < n; ++i) {
          for (std::int32_t j = p.start[global[i]]; j < p.start[global[i] + 1]; ++j) {
            const std::int32_t other = p.neighbours[static_cast<std::size_t>(j)];
            *neighbours++ = static_cast<ZOLTAN_ID_TYPE>(other);
            *holders++ = of(data).holder(other);
          }
        }
      },
      &share);
  Zoltan_Set_Part_Multi_Fn(
      zoltan,
      [](void* data, int, int, int n, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR, int* parts, int*) {
        for (int i = 0; i < n; ++i) parts[i] = std::max(0, of(data).problem->from[global[i]]);
      },
      &share);
}

std::vector<std::int32_t> by_zoltan(Share& share, bool is_geometric, int seed) {
  const Problem& p = *share.problem;
  Zoltan_Struct* zoltan = Zoltan_Create(MPI_COMM_WORLD);
  const std::map<std::string, std::string> settings = {{"DEBUG_LEVEL", "0"},
                                                       {"NUM_GID_ENTRIES", "1"},
                                                       {"NUM_LID_ENTRIES", "1"},
                                                       {"RETURN_LISTS", "PARTS"},
                                                       {"OBJ_WEIGHT_DIM", "1"},
                                                       {"EDGE_WEIGHT_DIM", "0"},
                                                       {"CHECK_GRAPH", "0"},
                                                       {"GRAPH_PACKAGE", "PHG"},
                                                       {"LB_METHOD", is_geometric ? "RIB" : "GRAPH"},
                                                       {"REMAP", "1"},
                                                       {"SEED", std::to_string(seed)},
                                                       {"NUM_GLOBAL_PARTS", std::to_string(p.parts)},
                                                       {"IMBALANCE_TOL", std::to_string(1 + tolerance)},
                                                       {"LB_APPROACH", p.has_start() ? "REPARTITION" : "PARTITION"}};
  for (const auto& [name, value] : settings) Zoltan_Set_Param(zoltan, name.c_str(), value.c_str());
  set_queries(zoltan, share);
  std::vector<int> numbers;
  std::vector<int> components(p.speeds.size(), 0);
  std::vector<float> sizes(p.speeds.begin(), p.speeds.end());
  for (std::size_t part = 0; part < p.speeds.size(); ++part) numbers.push_back(static_cast<int>(part));
  Zoltan_LB_Set_Part_Sizes(zoltan, 1, static_cast<int>(p.parts), numbers.data(), components.data(), sizes.data());
  int changes = 0, global_size = 0, local_size = 0, imports = 0, exports = 0;
  ZOLTAN_ID_PTR import_global = nullptr, import_local = nullptr, export_global = nullptr, export_local = nullptr;
  int *import_ranks = nullptr, *import_parts = nullptr, *export_ranks = nullptr, *export_parts = nullptr;
  if (Zoltan_LB_Partition(zoltan, &changes, &global_size, &local_size, &imports, &import_global, &import_local,
                          &import_ranks, &import_parts, &exports, &export_global, &export_local, &export_ranks,
                          &export_parts) != ZOLTAN_OK) {
    std::cerr << "partition_peers: Zoltan failed\n";
    MPI_Abort(MPI_COMM_WORLD, 3);
  }
  std::vector<std::int32_t> parts(share.mine.size());
  for (int i = 0; i < exports; ++i) parts[export_local[i]] = export_parts[i];
  Zoltan_LB_Free_Part(&import_global, &import_local, &import_ranks, &import_parts);
  Zoltan_LB_Free_Part(&export_global, &export_local, &export_ranks, &export_parts);
  Zoltan_Destroy(&zoltan);
  return parts;
}

void write_parts(const Share& share, const std::vector<std::int32_t>& mine, const std::string& path) {
  const Problem& p = *share.problem;
  std::vector<std::int32_t> parts(static_cast<std::size_t>(p.elements), 0);
  for (std::size_t i = 0; i < mine.size(); ++i) parts[static_cast<std::size_t>(share.mine[i])] = mine[i];
  std::vector<std::int32_t> all(parts.size());
  MPI_Reduce(parts.data(), all.data(), static_cast<int>(p.elements), MPI_INT32_T, MPI_SUM, 0, MPI_COMM_WORLD);
  if (share.rank != 0) return;
  std::ofstream file(path);
  for (const auto part : all) file << part << '\n';
}

}  // namespace

int main(int argc, char** argv) {
  setenv("SCOTCH_PTHREAD_NUMBER", "1", 1);  // with more threads two runs differ
  MPI_Init(&argc, &argv);
  float version = 0;
  Zoltan_Initialize(argc, argv, &version);
  if (argc != 5) {
    std::cerr << "usage: partition_peers GRAPH pt-scotch|zoltan-rib|zoltan-graph SEED OUT\n";
    MPI_Abort(MPI_COMM_WORLD, 2);
  }
  const Problem problem = read_problem(argv[1]);
  int rank = 0;
  int ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  Share share(problem, rank, ranks);
  const std::string method = argv[2];
  const int seed = std::atoi(argv[3]);
  MPI_Barrier(MPI_COMM_WORLD);
  const std::clock_t begin = std::clock();
  const std::vector<std::int32_t> parts =
      method == "pt-scotch" ? by_ptscotch(share, seed) : by_zoltan(share, method == "zoltan-rib", seed);
  const double mine = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  double seconds = 0;
  MPI_Reduce(&mine, &seconds, 1, MPI_DOUBLE, MPI_MAX, 0, MPI_COMM_WORLD);
  write_parts(share, parts, argv[4]);
  if (rank == 0) std::cout << seconds << '\n';
  MPI_Finalize();
  return 0;
}
