#include "mesh/node_directory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "base/error.hpp"
#include "parallel/agreement.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus {
namespace {

constexpr int block_bits = 10;

/// Positions in a list of numbers, by the rank to which they go.
std::map<int, std::vector<std::size_t>> positions_by_rank(std::span<const GlobalId> numbers, int ranks) {
  std::map<int, std::vector<std::size_t>> positions;
  for (std::size_t i = 0; i < numbers.size(); ++i) positions[rendezvous_rank(numbers[i], ranks)].push_back(i);
  return positions;
}

}  // namespace

int rendezvous_rank(GlobalId number, int ranks) {
  std::uint64_t mixed = (static_cast<std::uint64_t>(number) >> block_bits) * 0x9E3779B97F4A7C15ULL;
  mixed ^= mixed >> 32;
  return static_cast<int>(mixed % static_cast<std::uint64_t>(ranks));
}

NodeDirectory::NodeDirectory(const Communicator& comm, std::string source, int dim, std::span<const GlobalId> numbers,
                             std::span<const Real> coordinates)
    : source_(std::move(source)), dim_(dim) {
  check(numbers.size() * static_cast<std::size_t>(dim) == coordinates.size(), "each node has its coordinates");
  const auto width = static_cast<std::size_t>(dim);
  std::map<int, std::vector<GlobalId>> sent_numbers;
  std::map<int, std::vector<Real>> sent_points;
  for (const auto& [rank, positions] : positions_by_rank(numbers, comm.size())) {
    for (const std::size_t i : positions) {
      sent_numbers[rank].push_back(numbers[i]);
      const auto point = coordinates.subspan(i * width, width);
      sent_points[rank].insert(sent_points[rank].end(), point.begin(), point.end());
    }
  }
  const auto received_numbers = sparse_exchange(comm, sent_numbers);
  sent_numbers.clear();
  const auto received_points = sparse_exchange(comm, sent_points);
  sent_points.clear();
  agree(comm, [&] {
    for (const auto& [rank, list] : received_numbers) {
      const std::vector<Real>& points = received_points.at(rank);
      for (std::size_t i = 0; i < list.size(); ++i) add(list[i], points.data() + i * width);
    }
  });
  was_fetched_.assign(static_cast<std::size_t>(table_.size()), 0);
}

void NodeDirectory::add(GlobalId number, const Real* point) {
  const LocalId known = table_.size();
  const LocalId index = table_.insert(number);
  if (index == known) {
    coordinates_.insert(coordinates_.end(), point, point + dim_);
    return;
  }
  if (!std::equal(point, point + dim_, coordinates_.begin() + static_cast<std::ptrdiff_t>(index) * dim_)) {
    throw InputError(fmt::format("{}: node {} is given twice, at two places", source_, number));
  }
  ++repeated_;
}

std::vector<Real> NodeDirectory::fetch(const Communicator& comm, std::span<const GlobalId> numbers) {
  const auto width = static_cast<std::size_t>(dim_);
  const auto positions = positions_by_rank(numbers, comm.size());
  std::map<int, std::vector<GlobalId>> questions;
  for (const auto& [rank, list] : positions) {
    for (const std::size_t i : list) questions[rank].push_back(numbers[i]);
  }
  const auto asked = sparse_exchange(comm, questions);
  std::map<int, std::vector<Real>> answers;
  agree(comm, [&] {
    for (const auto& [rank, list] : asked) {
      std::vector<Real>& answer = answers[rank];
      for (const GlobalId number : list) {
        const LocalId index = table_.find(number);
        if (index < 0)
          throw InputError(fmt::format("{}: an element uses node {}, which is not given", source_, number));
        was_fetched_[static_cast<std::size_t>(index)] = 1;
        const Real* point = coordinates_.data() + static_cast<std::size_t>(index) * width;
        answer.insert(answer.end(), point, point + dim_);
      }
    }
  });
  std::vector<Real> result(numbers.size() * width);
  for (const auto& [rank, answer] : sparse_exchange(comm, answers)) {
    const std::vector<std::size_t>& list = positions.at(rank);
    for (std::size_t i = 0; i < list.size(); ++i) {
      std::copy_n(answer.data() + i * width, width, result.data() + list[i] * width);
    }
  }
  return result;
}

GlobalId NodeDirectory::never_fetched() const {
  return std::count(was_fetched_.begin(), was_fetched_.end(), char{0});
}

}  // namespace malleus
