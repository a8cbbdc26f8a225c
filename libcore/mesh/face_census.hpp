#pragma once

/// How often each face occurs in the whole mesh. Made for checking: all faces travel to a directory, nothing is taken
/// for granted.

#include <array>
#include <span>
#include <vector>

#include "parallel/communicator.hpp"

namespace malleus {

/// Node numbers of a face, increasing; in 2D the first is -1. The numbers agree between ranks.
using FaceNumbers = std::array<GlobalId, 3>;

/// Sorted face of dim nodes.
FaceNumbers face_numbers(std::span<const GlobalId> nodes);

/// The faces of elements, [element][dim+1], face f being opposite node f. element_nodes: [element][dim+1].
std::vector<FaceNumbers> faces_of_elements(int dim, std::span<const GlobalId> element_nodes);

/// How many of the faces that all ranks gave are equal to one, itself included; and how many of them have its sense.
struct FaceCount {
  std::int32_t all = 0;
  std::int32_t alike = 0;
};

/// senses: [face] 0 or 1, or empty for all 0. Collective.
std::vector<FaceCount> count_equal_faces(const Communicator& comm, std::span<const FaceNumbers> faces,
                                         std::span<const std::uint8_t> senses = {});

}  // namespace malleus
