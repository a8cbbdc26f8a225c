#pragma once

/// Bands of vertices on their way to the rank that solves a pair's problem, and the answers.

#include <cstdint>
#include <vector>

#include "parallel/byte_stream.hpp"
#include "partition/pair_problem.hpp"

namespace malleus {

/// Vertices of one pair's band, as one rank sends them, with all edges inside the band.
struct BandPiece {
  std::vector<GlobalId> numbers;
  std::vector<Real> weights;
  std::vector<std::uint8_t> sides;
  std::vector<std::array<Real, 2>> outside;
  std::vector<Real> third;
  std::vector<std::int32_t> degrees;  ///< [vertex] edges inside the band
  /// By place in this piece, counted down from -1, or by number where the vertex is another rank's.
  std::vector<GlobalId> neighbours;
  std::vector<std::int32_t> edge_weights;

  /// Of a vertex with that many edges in a message, lengths of lists apart.
  static Real bytes_of(std::size_t edges) { return 37.0 + 12.0 * static_cast<Real>(edges); }

  static GlobalId here(LocalId place) { return -1 - GlobalId{place}; }
  static LocalId place_of(GlobalId neighbour) { return static_cast<LocalId>(-1 - neighbour); }

  void reserve(std::size_t vertices, std::size_t edges);
  void put(ByteWriter& writer) const;
  static BandPiece get(ByteReader& reader);
};

/// The problem of a band whose pieces, at least one, came from several ranks; numbers: of its vertices, in order.
PairProblem join_band(std::vector<BandPiece> pieces, std::vector<GlobalId>& numbers);

}  // namespace malleus
