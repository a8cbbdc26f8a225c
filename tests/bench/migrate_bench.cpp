/// Measures migrations of a box mesh with 8 values a node and 2 an element, as a simulation holds.
///
///   mpiexec -n RANKS migrate_bench CELLS REPEATS
///
/// CELLS along each axis, of six tetrahedra. Every element goes to the next rank and, as another migration, a tenth of
/// them. A line of JSON: of the quickest repeat seconds of the clock and of the processor, of the rank that took most,
/// per million elements held by a rank, and bytes per element that moved.

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <nlohmann/json.hpp>

#include "parallel/session.hpp"
#include "partition/migrate.hpp"
#include "support/box_mesh.hpp"

namespace {

using namespace malleus;

struct Measured {
  Real seconds = 0;
  Real processor_seconds = 0;
  Real bytes = 0;
};

/// Moves the first of so many stretches of each rank to the next one.
Measured measure(const Communicator& comm, Mesh& mesh, FieldStore& fields, int stretches, int repeats) {
  Measured least;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    std::vector<int> destinations(static_cast<std::size_t>(mesh.elements()), comm.rank());
    for (LocalId e = 0; e < mesh.elements(); ++e) {
      if (e < mesh.elements() / stretches) destinations[static_cast<std::size_t>(e)] = (comm.rank() + 1) % comm.size();
    }
    comm.barrier();
    const std::clock_t processor = std::clock();
    const auto start = std::chrono::steady_clock::now();
    const MigrationReport report = migrate(comm, mesh, fields, destinations);
    const Real seconds = comm.max(std::chrono::duration<Real>(std::chrono::steady_clock::now() - start).count());
    const Real used = comm.max(static_cast<Real>(std::clock() - processor) / CLOCKS_PER_SEC);
    if (repeat > 0 && seconds >= least.seconds) continue;
    const auto moved = static_cast<Real>(std::max<GlobalId>(1, report.moved_elements));
    least = {seconds, used, static_cast<Real>(report.sent_bytes) / moved};
  }
  return least;
}

int run(const Communicator& comm, int cells, int repeats) {
  Mesh mesh = test::box_mesh(comm, {.dim = 3, .cells = {cells, cells, cells}});
  FieldStore fields;
  fields.declare(mesh, {"velocity", "m/s", Support::node, 3});
  fields.declare(mesh, {"place before", "m", Support::node, 3});
  fields.declare(mesh, {"pressure", "Pa", Support::node, 1});
  fields.declare(mesh, {"temperature", "K", Support::node, 1});
  fields.declare(mesh, {"strain", "1", Support::element, 1});
  fields.declare(mesh, {"viscosity", "Pa.s", Support::element, 1});
  const Real held = static_cast<Real>(mesh.total_elements) / comm.size() / 1e6;
  nlohmann::json rows = nlohmann::json::array();
  for (const auto& [share, stretches] : {std::pair("all", 1), std::pair("a tenth", 10)}) {
    const Measured measured = measure(comm, mesh, fields, stretches, repeats);
    rows.push_back({{"moved", share},
                    {"ranks", comm.size()},
                    {"elements", mesh.total_elements},
                    {"seconds", measured.seconds},
                    {"seconds_per_million_held", measured.seconds / held},
                    {"processor_seconds_per_million_held", measured.processor_seconds / held},
                    {"bytes_per_element", measured.bytes}});
  }
  if (comm.rank() == 0) std::cout << rows.dump() << '\n';
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const malleus::Session session(argc, argv);
  if (argc != 3 || std::atoi(argv[1]) < 1 || std::atoi(argv[2]) < 1) {
    std::cerr << "usage: migrate_bench CELLS REPEATS\n";
    return 2;
  }
  const int cells = std::atoi(argv[1]);
  const int repeats = std::atoi(argv[2]);
  return run(session.world(), cells, repeats);
}
