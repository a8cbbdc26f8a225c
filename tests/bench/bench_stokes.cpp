/// Measures the Stokes linear solver on lid cavities: iterations, seconds, matrix products, bytes; with m < 1 Newton's
/// method on a cube between platens that stick.
///
/// usage: bench_stokes [name=value]... [-- PETSC OPTIONS]
///   cells=33 (along each axis; 33, 50, 66, 96: 39k, 133k, 301k, 913k nodes)  dim=3  jitter=0.2  tolerance=1e-6
///   spheres=0 inside=1 (their viscosity; < 1 soft)  disjoint=0  aspect=1 (of flattened elements)
///   open=0 (1: free sides, pressed from above)  penalty=0 (of contacts on one of them, dimensionless)
///   m=1 (rate sensitivity)  cut_off=0.01 (over speed / height)  forcing=0.05 (loosest linear tolerance)
///   free=0 (1: the matrix by its products alone)  json=0
/// Times are processor seconds, which a busy machine changes least.

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <map>
#include <string>

#include "parallel/petsc_session.hpp"
#include "parallel/session.hpp"
#include "solvers/newton.hpp"
#include "solvers/petsc_objects.hpp"
#include "solvers/stokes_linear_solver.hpp"
#include "support/sticking_block.hpp"
#include "support/stokes_cavity.hpp"

namespace malleus {
namespace {

/// A line of /proc/self/status, in bytes.
Real status_bytes(const std::string& name) {
  std::ifstream file("/proc/self/status");
  std::string word;
  Real kibibytes = 0;
  while (file >> word) {
    if (word == name + ":") file >> kibibytes;
  }
  return 1024 * kibibytes;
}

/// Of this process: on a busy machine steadier than the wall's.
Real processor_seconds() {
  return static_cast<Real>(std::clock()) / CLOCKS_PER_SEC;
}

using Values = std::map<std::string, Real>;

test::BoxMeshOptions box_of(const Values& values) {
  const int cells = static_cast<int>(values.at("cells"));
  return {.dim = static_cast<int>(values.at("dim")), .cells = {cells, cells, cells}, .jitter = values.at("jitter")};
}

int run_nonlinear(const Communicator& comm, const Values& values) {
  test::StickingBlock block(comm, box_of(values), values.at("m"), values.at("cut_off"));
  StokesState state = block.op.start_state();
  StokesLinearSolver linear;
  const NewtonSolver newton(
      {.tolerance = values.at("tolerance"), .largest_forcing = values.at("forcing"), .start_shear_rate = 1});
  const Real start = processor_seconds();
  const NewtonOutcome outcome = newton.solve(block.op, linear, state);
  const Real processor = comm.max(processor_seconds() - start);
  if (comm.is_root() && values.at("json") > 0) {
    fmt::print("{{\"nodes\": {}, \"ranks\": {}, \"converged\": {}, \"nonlinear\": {}, \"iterations\": {}}}\n",
               block.mesh.total_nodes(), comm.size(), outcome.converged, outcome.iterations(),
               outcome.linear_iterations);
  } else if (comm.is_root()) {
    fmt::print("nodes {} ranks {} m {} cut-off {:.0e} tolerance {:.0e}: {} {} nonlinear, {} linear iterations\n",
               block.mesh.total_nodes(), comm.size(), values.at("m"), values.at("cut_off"), values.at("tolerance"),
               outcome.converged ? "converged," : "FAILED,", outcome.iterations(), outcome.linear_iterations);
    for (const NewtonIteration& step : outcome.history) {
      fmt::print("  {:>7} residual {:.2e} step {:.3f} linear iterations {:3} to {:.1e}\n",
                 step.newton ? "Newton" : "Picard", step.residual, step.step, step.linear_iterations,
                 step.linear_residual);
    }
    fmt::print("  wall: assembly {:.2f} s, set-up {:.2f} s, solve {:.2f} s; processor {:.2f} s\n",
               outcome.assembly_seconds, outcome.setup_seconds, outcome.solve_seconds, processor);
  }
  return outcome.converged ? 0 : 3;
}

/// Processor seconds, the largest of the ranks', and bytes, their sum.
struct Figures {
  GlobalId nodes = 0;
  Real product = 0;   ///< of the matrix with a vector
  Real assembly = 0;  ///< of residual and matrix
  Real setup = 0;
  Real solve = 0;
  Real over_mesh = 0;  ///< bytes at the peak without those of the mesh and of the empty program
  LinearOutcome outcome;
};

Real seconds_of_product(Mat matrix) {
  constexpr int products = 10;
  PetscVector x, y;
  petsc_call(MatCreateVecs(matrix, x.out(), y.out()));
  petsc_call(VecSet(x.get(), 1.0));
  petsc_call(MatMult(matrix, x.get(), y.get()));
  const Real start = processor_seconds();
  for (int i = 0; i < products; ++i) petsc_call(MatMult(matrix, x.get(), y.get()));
  return (processor_seconds() - start) / products;
}

/// Bytes that this process has allocated and not freed.
Real live_bytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<Real>(info.uordblks + info.hblkhd);
}

Real mesh_bytes(const Communicator& comm, const test::BoxMeshOptions& box) {
  const Real before = live_bytes();
  const Mesh mesh = test::box_mesh(comm, box);
  return live_bytes() - before;
}

Real assemble_again(StokesOperator& equations) {
  const StokesState state = equations.start_state();
  LinearVector unused;
  const Real start = processor_seconds();
  equations.residual(state, unused);
  equations.tangent(state, Tangent::picard);
  return processor_seconds() - start;
}

/// The first solve, to a loose tolerance, makes the set-up; what it took beyond its iterations is the set-up's.
void solve_twice(const test::StokesCavity& cavity, Real tolerance, Figures& figures) {
  constexpr Real loose = 0.3;
  StokesLinearSolver solver;
  LinearVector solution;
  const Real start = processor_seconds();
  const LinearOutcome first = solver.solve(cavity.system(), cavity.right_side(), loose, solution);
  const Real middle = processor_seconds();
  solution = {};
  figures.outcome = solver.solve(cavity.system(), cavity.right_side(), tolerance, solution);
  figures.solve = processor_seconds() - middle;
  const Real of_iterations = figures.solve * first.iterations / std::max(1, figures.outcome.iterations);
  figures.setup = middle - start - of_iterations;
}

Figures measure(const Communicator& comm, const Values& values) {
  test::CavityOptions options;
  options.box = box_of(values);
  options.spheres = test::spread_spheres(static_cast<int>(values.at("spheres")), values.at("disjoint") > 0);
  options.inside = values.at("inside");
  options.is_open = values.at("open") > 0;
  options.aspect = values.at("aspect");
  options.penalty = values.at("penalty");
  options.matrix_free = values.at("free") > 0;
  Figures figures;
  const Real empty = status_bytes("VmRSS") + mesh_bytes(comm, options.box);
  test::StokesCavity cavity(comm, options);
  figures.nodes = cavity.mesh().total_nodes();
  figures.assembly = comm.max(assemble_again(cavity.equations()));
  figures.product = comm.max(seconds_of_product(cavity.system().matrix));
  solve_twice(cavity, values.at("tolerance"), figures);
  figures.setup = comm.max(figures.setup);
  figures.solve = comm.max(figures.solve);
  figures.over_mesh = comm.sum(status_bytes("VmHWM") - empty);
  return figures;
}

int run_linear(const Communicator& comm, const Values& values) {
  const Figures figures = measure(comm, values);
  const LinearOutcome& outcome = figures.outcome;
  if (!comm.is_root()) return outcome.converged ? 0 : 3;
  const auto nodes = static_cast<Real>(figures.nodes);
  if (values.at("json") > 0) {
    fmt::print(
        "{{\"nodes\": {}, \"ranks\": {}, \"converged\": {}, \"iterations\": {}, \"residual\": {:.3e}, "
        "\"fallbacks\": {}, \"assembly_s\": {:.4f}, \"setup_s\": {:.4f}, \"solve_s\": {:.4f}, \"product_s\": {:.6f}, "
        "\"bytes_per_node\": {:.0f}}}\n",
        figures.nodes, comm.size(), outcome.converged, outcome.iterations, outcome.residual, outcome.fallbacks,
        figures.assembly, figures.setup, figures.solve, figures.product, figures.over_mesh / nodes);
  } else {
    fmt::print("nodes {} ranks {}: {} {} iterations, {} fallbacks, residual {:.2e}\n", figures.nodes, comm.size(),
               outcome.converged ? "converged," : "FAILED,", outcome.iterations, outcome.fallbacks, outcome.residual);
    fmt::print("  processor seconds (largest rank): assembly {:.2f}, set-up {:.2f}, solve {:.2f}\n", figures.assembly,
               figures.setup, figures.solve);
    fmt::print("  in matrix products of {:.2f} ms: {:.0f}, {:.0f}, {:.0f}\n", 1e3 * figures.product,
               figures.assembly / figures.product, figures.setup / figures.product, figures.solve / figures.product);
    fmt::print("  memory over the mesh at the peak: {:.0f} bytes/node\n", figures.over_mesh / nodes);
  }
  return outcome.converged ? 0 : 3;
}

}  // namespace
}  // namespace malleus

int main(int argc, char** argv) {
  std::map<std::string, malleus::Real> values = {
      {"cells", 33},   {"dim", 3},  {"jitter", 0.2},  {"tolerance", 1e-6}, {"spheres", 0}, {"inside", 1},
      {"disjoint", 0}, {"open", 0}, {"m", 1},         {"cut_off", 0.01},   {"aspect", 1},  {"penalty", 0},
      {"json", 0},     {"free", 0}, {"forcing", 0.05}};
  std::vector<std::string> petsc_options;
  bool is_for_petsc = false;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const std::size_t equals = word.find('=');
    if (is_for_petsc) {
      petsc_options.push_back(word);
    } else if (word == "--") {
      is_for_petsc = true;
    } else if (equals == std::string::npos || values.count(word.substr(0, equals)) == 0) {
      fmt::print(stderr, "bench_stokes: unknown argument '{}'\n", word);
      return 2;
    } else {
      values[word.substr(0, equals)] = std::stod(word.substr(equals + 1));
    }
  }
  const malleus::Session session(argc, argv);
  const malleus::PetscSession petsc("bench_stokes", petsc_options);
  return values.at("m") == 1 ? malleus::run_linear(session.world(), values)
                             : malleus::run_nonlinear(session.world(), values);
}
