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

PairProblem join_band(const std::vector<const BandPiece*>& pieces, std::vector<GlobalId>& numbers) {
  PairProblem problem;
  problem.start.assign(1, 0);
  std::size_t vertices = 0;
  for (const BandPiece* piece : pieces) vertices += piece->numbers.size();
  NumberTable table(vertices);
  for (const BandPiece* piece : pieces) {
    for (const GlobalId number : piece->numbers) table.insert(number);
    append(problem.weights, piece->weights);
    append(problem.sides, piece->sides);
    append(problem.outside, piece->outside);
    append(problem.third, piece->third);
    append(problem.edge_weights, piece->edge_weights);
    for (const std::int32_t degree : piece->degrees) problem.start.push_back(problem.start.back() + degree);
  }
  problem.neighbours.reserve(problem.edge_weights.size());
  for (const BandPiece* piece : pieces) {
    for (const GlobalId number : piece->neighbours) problem.neighbours.push_back(table.find(number));
  }
  check(static_cast<std::size_t>(table.size()) == vertices, "a vertex is in a band once");
  numbers = std::move(table).take_numbers();
  return problem;
}

}  // namespace malleus
