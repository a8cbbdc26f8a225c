#include "meshtool/element_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "base/error.hpp"
#include "base/text.hpp"
#include "mesh/ordered_file.hpp"
#include "parallel/agreement.hpp"
#include "parallel/sparse_exchange.hpp"

namespace malleus::meshtool {
namespace {

/// Deals lines 0, 1, ... of a file to the ranks in equal stretches.
class LineBlocks {
 public:
  LineBlocks(const Communicator& comm, const Mesh& mesh) : ranks_(comm.size()) {
    GlobalId highest = -1;
    for (const GlobalId id : mesh.element_ids) highest = std::max(highest, id);
    lines_ = comm.max(highest) + 1;
  }
  GlobalId lines() const { return lines_; }
  GlobalId first(int rank) const { return lines_ / ranks_ * rank + lines_ % ranks_ * rank / ranks_; }
  int rank_of(GlobalId line) const {
    int rank = static_cast<int>(std::min<GlobalId>(ranks_ - 1, line * ranks_ / std::max<GlobalId>(1, lines_)));
    while (rank > 0 && first(rank) > line) --rank;
    while (rank + 1 < ranks_ && first(rank + 1) <= line) ++rank;
    return rank;
  }

 private:
  int ranks_;
  GlobalId lines_;
};

template <class T>
struct Line {
  GlobalId line;
  T value;
};

/// The bytes from the first line that starts in this rank's share of the file to the end of its last such line.
std::string read_share(const Communicator& comm, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("{}: cannot be read", path));
  file.seekg(0, std::ios::end);
  const auto size = static_cast<GlobalId>(file.tellg());
  const GlobalId first = size / comm.size() * comm.rank();
  const GlobalId last = comm.rank() + 1 == comm.size() ? size : size / comm.size() * (comm.rank() + 1);
  const GlobalId start = std::max<GlobalId>(0, first - 1);
  file.seekg(start);
  std::string text(static_cast<std::size_t>(last - start), '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (first > 0) {
    const std::size_t end = text.find('\n');  // the line before belongs to a lower rank, if only by its last byte
    text.erase(0, end == std::string::npos ? text.size() : end + 1);
  }
  if (!text.empty() && text.back() != '\n') {
    std::string rest;
    std::getline(file, rest);
    text += rest;
  }
  return text;
}

std::vector<Real> parse_lines(const std::string& path, std::string_view text) {
  std::vector<Real> values;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = trim(text.substr(0, end));
    text.remove_prefix(std::min(text.size(), end + 1));
    if (line.empty() && text.empty()) break;
    const std::string_view whole = line;
    const auto value = take_real(line);
    if (!value || !trim(line).empty()) {
      throw InputError(fmt::format("{}: '{}' is no number; a number a line is wanted", path, whole));
    }
    values.push_back(*value);
  }
  return values;
}

template <class T>
std::vector<T> to_blocks(const Communicator& comm, const LineBlocks& blocks,
                         const std::map<int, std::vector<Line<T>>>& outgoing, T missing) {
  const GlobalId first = blocks.first(comm.rank());
  std::vector<T> block(static_cast<std::size_t>(blocks.first(comm.rank() + 1) - first), missing);
  for (const auto& [rank, lines] : sparse_exchange(comm, outgoing)) {
    for (const Line<T>& line : lines) block[static_cast<std::size_t>(line.line - first)] = line.value;
  }
  return block;
}

}  // namespace

std::vector<Real> read_element_list(const Communicator& comm, const Mesh& mesh, const std::string& path) {
  const LineBlocks blocks(comm, mesh);
  std::vector<Real> read;
  agree(comm, [&] { read = parse_lines(path, read_share(comm, path)); });
  const GlobalId total = comm.sum(static_cast<GlobalId>(read.size()));
  if (total != blocks.lines()) {
    throw InputError(fmt::format("{}: holds {} numbers, but the mesh has {} elements", path, total, blocks.lines()));
  }
  std::map<int, std::vector<Line<Real>>> outgoing;
  GlobalId line = comm.sum_of_lower_ranks(static_cast<GlobalId>(read.size()));
  for (const Real value : read) {
    outgoing[blocks.rank_of(line)].push_back({line, value});
    ++line;
  }
  const std::vector<Real> block = to_blocks<Real>(comm, blocks, outgoing, 0);

  std::map<int, std::vector<GlobalId>> wanted;
  std::map<int, std::vector<std::size_t>> places;
  for (std::size_t e = 0; e < mesh.element_ids.size(); ++e) {
    const int rank = blocks.rank_of(mesh.element_ids[e]);
    wanted[rank].push_back(mesh.element_ids[e]);
    places[rank].push_back(e);
  }
  std::map<int, std::vector<Real>> answers;
  for (const auto& [rank, lines] : sparse_exchange(comm, wanted)) {
    for (const GlobalId asked : lines) {
      answers[rank].push_back(block[static_cast<std::size_t>(asked - blocks.first(comm.rank()))]);
    }
  }
  std::vector<Real> values(mesh.element_ids.size());
  for (const auto& [rank, list] : sparse_exchange(comm, answers)) {
    for (std::size_t i = 0; i < list.size(); ++i) values[places[rank][i]] = list[i];
  }
  return values;
}

void write_element_list(const Communicator& comm, const Mesh& mesh, const std::string& path,
                        std::span<const int> values) {
  check(values.size() == mesh.element_ids.size(), "one value an element");
  const LineBlocks blocks(comm, mesh);
  std::map<int, std::vector<Line<int>>> outgoing;
  for (std::size_t e = 0; e < values.size(); ++e) {
    outgoing[blocks.rank_of(mesh.element_ids[e])].push_back({mesh.element_ids[e], values[e]});
  }
  std::string text;
  for (const int value : to_blocks<int>(comm, blocks, outgoing, -1)) text += fmt::format("{}\n", value);
  OrderedFile file(comm, path);
  file.append(text);
  file.close();
}

}  // namespace malleus::meshtool
