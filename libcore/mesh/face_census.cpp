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

/// A face and its sense in the lowest bit of the last number.
FaceNumbers with_sense(FaceNumbers face, bool sense) {
  face[2] = 2 * face[2] + (sense ? 1 : 0);
  return face;
}

/// Counts faces with senses. Refers to the faces that were added.
class FaceTable {
 public:
  explicit FaceTable(std::size_t faces) {
    std::size_t size = 16;
    while (size < faces + faces / 4) size *= 2;
    slots_.resize(size);
  }
  void add(const FaceNumbers& face) {
    Slot& slot = slot_of(face);
    slot.face = &face;
    ++slot.count[sense_of(face)];
  }
  FaceCount count(const FaceNumbers& face) {
    const auto& count = slot_of(face).count;
    return {count[0] + count[1], count[sense_of(face)]};
  }

 private:
  struct Slot {
    const FaceNumbers* face = nullptr;
    std::array<std::int32_t, 2> count = {0, 0};
  };

  static std::size_t sense_of(const FaceNumbers& face) { return static_cast<std::size_t>(face[2] & 1); }
  static bool are_equal(const FaceNumbers& a, const FaceNumbers& b) {
    return a[0] == b[0] && a[1] == b[1] && a[2] >> 1 == b[2] >> 1;
  }
  Slot& slot_of(const FaceNumbers& face) {
    std::uint64_t hash = 0;
    for (const GlobalId number : {face[0], face[1], face[2] >> 1})
      hash = (hash ^ static_cast<std::uint64_t>(number)) * 0x9E3779B97F4A7C15ULL;
    std::size_t at = static_cast<std::size_t>(hash >> 20) & (slots_.size() - 1);
    while (slots_[at].face != nullptr && !are_equal(*slots_[at].face, face)) at = (at + 1) & (slots_.size() - 1);
    return slots_[at];
  }

  std::vector<Slot> slots_;
};

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

std::vector<FaceCount> count_equal_faces(const Communicator& comm, std::span<const FaceNumbers> faces,
                                         std::span<const std::uint8_t> senses) {
  std::map<int, std::vector<FaceNumbers>> sent;
  std::map<int, std::vector<std::size_t>> places;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const int rank = rendezvous_rank(lowest(faces[i]), comm.size());
    sent[rank].push_back(with_sense(faces[i], !senses.empty() && senses[i] != 0));
    places[rank].push_back(i);
  }
  const auto received = sparse_exchange(comm, std::move(sent));
  std::size_t all = 0;
  for (const auto& [rank, keys] : received) all += keys.size();
  FaceTable table(all);
  for (const auto& [rank, keys] : received) {
    for (const FaceNumbers& key : keys) table.add(key);
  }
  std::map<int, std::vector<FaceCount>> answers;
  for (const auto& [rank, keys] : received) {
    answers[rank].reserve(keys.size());
    for (const FaceNumbers& key : keys) answers[rank].push_back(table.count(key));
  }
  std::vector<FaceCount> result(faces.size());
  for (const auto& [rank, counts] : sparse_exchange(comm, answers)) {
    const std::vector<std::size_t>& asked = places.at(rank);
    for (std::size_t i = 0; i < asked.size(); ++i) result[asked[i]] = counts[i];
  }
  return result;
}

}  // namespace malleus
