#include "mesh/face_census.hpp"

#include <algorithm>
#include <map>

#include "mesh/faces.hpp"
#include "mesh/node_directory.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

GlobalId lowest(const FaceNumbers& face) {
  return *std::find_if(face.begin(), face.end() - 1, [](GlobalId number) { return number >= 0; });
}

}  // namespace

FaceNumbers face_numbers(std::span<const GlobalId> nodes) {
  FaceNumbers face = {-1, -1, -1};
  for (std::size_t k = 0; k < std::min(nodes.size(), face.size()); ++k) face[k] = nodes[k];
  std::sort(face.begin(), face.end());
  return face;
}

std::vector<FaceNumbers> faces_of_elements(int dim, std::span<const GlobalId> element_nodes) {
  const auto n = static_cast<std::size_t>(dim) + 1;
  std::vector<FaceNumbers> faces;
  faces.reserve(element_nodes.size());
  for (std::size_t slot = 0; slot < element_nodes.size(); ++slot) {
    const auto element = element_nodes.subspan(slot / n * n, n);
    FaceNumbers nodes = {-1, -1, -1};
    for (int k = 0; k < dim; ++k) {
      const int corner = face_node(dim, static_cast<int>(slot % n), k);
      nodes[static_cast<std::size_t>(k)] = element[static_cast<std::size_t>(corner)];
    }
    faces.push_back(face_numbers(std::span(nodes).first(static_cast<std::size_t>(dim))));
  }
  return faces;
}

std::vector<std::int32_t> count_equal_faces(const Communicator& comm, std::span<const FaceNumbers> faces) {
  std::map<int, std::vector<FaceNumbers>> sent;
  std::map<int, std::vector<std::size_t>> places;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const int rank = rendezvous_rank(lowest(faces[i]), comm.size());
    sent[rank].push_back(faces[i]);
    places[rank].push_back(i);
  }
  const auto received = sparse_exchange(comm, sent);
  std::vector<FaceNumbers> sorted;
  for (const auto& [rank, keys] : received) sorted.insert(sorted.end(), keys.begin(), keys.end());
  std::sort(sorted.begin(), sorted.end());
  std::map<int, std::vector<std::int32_t>> answers;
  for (const auto& [rank, keys] : received) {
    for (const FaceNumbers& key : keys) {
      const auto range = std::equal_range(sorted.begin(), sorted.end(), key);
      answers[rank].push_back(static_cast<std::int32_t>(range.second - range.first));
    }
  }
  std::vector<std::int32_t> result(faces.size(), 0);
  for (const auto& [rank, counts] : sparse_exchange(comm, answers)) {
    const std::vector<std::size_t>& asked = places.at(rank);
    for (std::size_t i = 0; i < asked.size(); ++i) result[asked[i]] = counts[i];
  }
  return result;
}

}  // namespace malleus
