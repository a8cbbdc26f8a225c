#include "mesh/soundness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mesh/face_census.hpp"
#include "mesh/faces.hpp"
#include "mesh/proximity.hpp"
#include "mesh/simplex.hpp"
#include "mesh/space_filling_curve.hpp"

namespace malleus {
namespace {

/// Below this quality an element is flat to roundoff.
constexpr Real flat_quality = 1e-10;
/// Nodes nearer than this share of the mesh's diagonal coincide.
constexpr Real coincidence = 1e-10;

class ProblemList {
 public:
  void add(GlobalId count, const char* kind, const std::string& what, bool is_fault = true) {
    if (count > 0) problems_.push_back({kind, fmt::format("{} {}", count, what), count, is_fault});
  }
  std::vector<MeshProblem> take() { return std::move(problems_); }

 private:
  std::vector<MeshProblem> problems_;
};

std::string place_text(const Findings& findings) {
  return fmt::format("(one at {:.6g} {:.6g} {:.6g} m)", findings.place[0], findings.place[1], findings.place[2]);
}

void add_reported(const DistributedPiece& distributed, ProblemList& problems) {
  const DistributionReport& report = distributed.report;
  const bool is_3d = distributed.piece.dim == 3;
  problems.add(report.repeated_nodes, "repeated nodes", "node numbers are given twice");
  problems.add(report.unused_nodes, "unused nodes", "nodes belong to no element");
  problems.add(report.repeated_elements, "repeated elements", "elements have the nodes of an earlier one");
  problems.add(report.inverted_elements, "inverted elements",
               "elements have negative volume (they are turned on reading)");
  problems.add(report.repeated_facets, "repeated facets",
               "boundary elements are given twice or are in several groups (the first group holds)", false);
  for (std::size_t g = 0; g < report.loose_facets.size(); ++g) {
    problems.add(report.loose_facets[g], "loose facets",
                 fmt::format("{} of group '{}' are no {}", is_3d ? "triangles" : "lines",
                             distributed.piece.group_names[g], is_3d ? "face of a tetrahedron" : "edge of a triangle"));
  }
}

GlobalId count_flat(const MeshPiece& piece) {
  return with_dim(piece.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    GlobalId flat = 0;
    for (LocalId e = 0; e < piece.elements(); ++e) {
      SimplexPoints<D> points;
      for (int i = 0; i <= D; ++i) {
        const LocalId node = piece.element_nodes[static_cast<std::size_t>(e) * (D + 1) + static_cast<std::size_t>(i)];
        points.col(i) = Eigen::Map<const Point<D>>(piece.coordinates.data() + static_cast<std::size_t>(node) * D);
      }
      if (std::abs(simplex_quality<D>(points)) < flat_quality) ++flat;
    }
    return flat;
  });
}

/// Signed volume of an element [m^dim].
Real signed_volume(const MeshPiece& piece, LocalId e) {
  return with_dim(piece.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    SimplexPoints<D> points;
    for (int i = 0; i <= D; ++i) {
      const LocalId node = piece.element_nodes[static_cast<std::size_t>(e) * (D + 1) + static_cast<std::size_t>(i)];
      points.col(i) = Eigen::Map<const Point<D>>(piece.coordinates.data() + static_cast<std::size_t>(node) * D);
    }
    return simplex_volume<D>(points);
  });
}

/// Whether the order of a face's nodes is an odd permutation of the increasing one.
bool is_odd(std::span<const GlobalId> nodes) {
  bool odd = false;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t j = i + 1; j < nodes.size(); ++j) odd = odd != (nodes[i] > nodes[j]);
  }
  return odd;
}

/// In which sense each element sees each of its faces once all elements are turned to positive volume: the two at a
/// face see it in opposite ones. [element][face] 0 or 1.
std::vector<std::uint8_t> senses_of_faces(const MeshPiece& piece, std::span<const GlobalId> element_nodes) {
  const auto corners = static_cast<std::size_t>(piece.dim) + 1;
  std::vector<std::uint8_t> senses;
  senses.reserve(element_nodes.size());
  for (LocalId e = 0; e < piece.elements(); ++e) {
    const bool is_turned = signed_volume(piece, e) < 0;
    for (int f = 0; f <= piece.dim; ++f) {
      std::array<GlobalId, 3> nodes = {};
      for (int k = 0; k < piece.dim; ++k) {
        nodes[static_cast<std::size_t>(k)] =
            element_nodes[static_cast<std::size_t>(e) * corners + static_cast<std::size_t>(face_node(piece.dim, f, k))];
      }
      const bool odd = is_odd(std::span(nodes).first(static_cast<std::size_t>(piece.dim)));
      senses.push_back(odd != is_turned ? 1 : 0);
    }
  }
  return senses;
}

std::vector<GlobalId> numbers_of(const MeshPiece& piece, std::span<const LocalId> nodes) {
  std::vector<GlobalId> numbers;
  numbers.reserve(nodes.size());
  for (const LocalId node : nodes) numbers.push_back(piece.node_numbers[static_cast<std::size_t>(node)]);
  return numbers;
}

/// Edges of exterior faces (in 2D their end nodes) at which not two but more of them meet, each once over all ranks.
GlobalId count_branching(const Communicator& comm, int dim, std::span<const FaceNumbers> exterior) {
  std::vector<FaceNumbers> ridges;
  for (const FaceNumbers& face : exterior) {
    for (std::size_t skipped = dim == 3 ? 0 : 1; skipped < 3; ++skipped) {
      FaceNumbers ridge = {-1, -1, -1};
      for (std::size_t k = 0; k < 3; ++k) {
        if (k != skipped && face[k] >= 0) ridge[k] = face[k];
      }
      std::sort(ridge.begin(), ridge.end());
      ridges.push_back(ridge);
    }
  }
  Real branching = 0;
  for (const FaceCount& count : count_equal_faces(comm, ridges)) branching += count.all > 2 ? 1.0 / count.all : 0.0;
  return std::llround(comm.sum(branching));
}

void add_face_problems(const Communicator& comm, const MeshPiece& piece, ProblemList& problems) {
  const std::vector<GlobalId> element_numbers = numbers_of(piece, piece.element_nodes);
  const std::vector<FaceNumbers> faces = faces_of_elements(piece.dim, element_numbers);
  const std::vector<FaceCount> elements_of_face =
      count_equal_faces(comm, faces, senses_of_faces(piece, element_numbers));
  std::vector<char> is_exterior(faces.size(), 0);
  std::vector<FaceNumbers> exterior;
  Real crowded = 0;
  Real folds = 0;  // faces whose two elements lie on the same side of them
  for (std::size_t slot = 0; slot < faces.size(); ++slot) {
    const FaceCount& count = elements_of_face[slot];
    if (count.all > 2) crowded += 1.0 / count.all;
    if (count.all == 2 && count.alike == 2) folds += 0.5;
    if (count.all != 1) continue;
    is_exterior[slot] = 1;
    exterior.push_back(faces[slot]);
  }
  problems.add(std::llround(comm.sum(crowded)), "crowded faces",
               "faces belong to more than two elements: the mesh is not manifold");
  problems.add(std::llround(comm.sum(folds)), "folds",
               "faces have both their elements on the same side: the mesh is folded over (meshtool refine repairs it)");
  problems.add(count_branching(comm, piece.dim, exterior), "branching boundary",
               piece.dim == 3 ? "edges have more than two boundary faces: the boundary is not manifold"
                              : "nodes have more than two boundary edges: the boundary is not manifold");
  const Findings hanging = find_hanging_nodes(comm, piece, is_exterior);
  problems.add(
      hanging.count, "hanging nodes",
      fmt::format("nodes hang in a face of another element {}: the mesh is not conforming", place_text(hanging)));

  // Each exterior facet with a group is listed on the rank that has its face.
  const auto mine = static_cast<GlobalId>(exterior.size());
  const std::vector<GlobalId> facet_numbers = numbers_of(piece, piece.facet_nodes);
  const auto n = static_cast<std::size_t>(piece.dim);
  std::sort(exterior.begin(), exterior.end());
  GlobalId named = 0;
  for (std::size_t f = 0; f < piece.facet_group.size(); ++f) {
    const FaceNumbers facet = face_numbers(std::span(facet_numbers).subspan(f * n, n));
    if (std::binary_search(exterior.begin(), exterior.end(), facet)) ++named;
  }
  problems.add(comm.sum(mine - named), "untagged boundary",
               fmt::format("of {} boundary facets are in no named group", comm.sum(mine)));
}

}  // namespace

std::vector<MeshProblem> find_problems(const Communicator& comm, const DistributedPiece& distributed) {
  const MeshPiece& piece = distributed.piece;
  ProblemList problems;
  add_reported(distributed, problems);
  problems.add(comm.sum(count_flat(piece)), "flat elements", "elements have no volume");
  const Box box = bounding_box(comm, piece.coordinates, piece.dim);
  Real diagonal = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(piece.dim); ++c) {
    diagonal = std::hypot(diagonal, std::max(box.high[c] - box.low[c], 0.0));
  }
  if (diagonal > 0) {
    const Findings coincident = find_coincident_nodes(comm, piece, coincidence * diagonal);
    problems.add(coincident.count, "coincident nodes",
                 fmt::format("nodes coincide with another of their region {}", place_text(coincident)));
  }
  add_face_problems(comm, piece, problems);
  return problems.take();
}

}  // namespace malleus
