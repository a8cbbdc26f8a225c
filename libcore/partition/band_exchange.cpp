#include "partition/band_exchange.hpp"

#include "base/error.hpp"
#include "mesh/number_table.hpp"

namespace malleus {
namespace {

template <class T>
void append(std::vector<T>& target, const std::vector<T>& more) {
  target.insert(target.end(), more.begin(), more.end());
}

}  // namespace

void BandPiece::reserve(std::size_t vertices, std::size_t edges) {
  numbers.reserve(vertices);
  weights.reserve(vertices);
  sides.reserve(vertices);
  outside.reserve(vertices);
  third.reserve(vertices);
  degrees.reserve(vertices);
  neighbours.reserve(edges);
  edge_weights.reserve(edges);
}

void BandPiece::put(ByteWriter& writer) const {
  writer.put_list<GlobalId>(numbers);
  writer.put_list<Real>(weights);
  writer.put_list<std::uint8_t>(sides);
  writer.put_list<std::array<Real, 2>>(outside);
  writer.put_list<Real>(third);
  writer.put_list<std::int32_t>(degrees);
  writer.put_list<GlobalId>(neighbours);
  writer.put_list<std::int32_t>(edge_weights);
}

BandPiece BandPiece::get(ByteReader& reader) {
  BandPiece piece;
  piece.numbers = reader.get_list<GlobalId>();
  piece.weights = reader.get_list<Real>();
  piece.sides = reader.get_list<std::uint8_t>();
  piece.outside = reader.get_list<std::array<Real, 2>>();
  piece.third = reader.get_list<Real>();
  piece.degrees = reader.get_list<std::int32_t>();
  piece.neighbours = reader.get_list<GlobalId>();
  piece.edge_weights = reader.get_list<std::int32_t>();
  return piece;
}

namespace {

/// Neighbours on other ranks by number; places in the pieces count on from piece to piece.
void join_neighbours(const std::vector<BandPiece>& pieces, std::span<const GlobalId> numbers, PairProblem& problem) {
  NumberTable table(pieces.size() > 1 ? numbers.size() : 0);
  if (pieces.size() > 1) {
    for (const GlobalId number : numbers) table.insert(number);
    check(static_cast<std::size_t>(table.size()) == numbers.size(), "a vertex is in a band once");
  }
  problem.neighbours.reserve(problem.edge_weights.size());
  LocalId first = 0;
  for (const BandPiece& piece : pieces) {
    for (const GlobalId neighbour : piece.neighbours) {
      problem.neighbours.push_back(neighbour < 0 ? first + BandPiece::place_of(neighbour) : table.find(neighbour));
    }
    first += static_cast<LocalId>(piece.numbers.size());
  }
}

}  // namespace

PairProblem join_band(std::vector<BandPiece> pieces, std::vector<GlobalId>& numbers) {
  PairProblem problem;
  BandPiece& first = pieces.front();
  numbers = first.numbers;
  problem.weights = std::move(first.weights);
  problem.sides = std::move(first.sides);
  problem.outside = std::move(first.outside);
  problem.third = std::move(first.third);
  problem.edge_weights = std::move(first.edge_weights);
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    append(numbers, pieces[i].numbers);
    append(problem.weights, pieces[i].weights);
    append(problem.sides, pieces[i].sides);
    append(problem.outside, pieces[i].outside);
    append(problem.third, pieces[i].third);
    append(problem.edge_weights, pieces[i].edge_weights);
  }
  problem.start.reserve(numbers.size() + 1);
  problem.start.push_back(0);
  for (const BandPiece& piece : pieces) {
    for (const std::int32_t degree : piece.degrees) problem.start.push_back(problem.start.back() + degree);
  }
  join_neighbours(pieces, numbers, problem);
  return problem;
}

}  // namespace malleus
