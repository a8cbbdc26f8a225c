#include "engine/history.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <sstream>

#include "base/error.hpp"
#include "parallel/agreement.hpp"
#include "storage/atomic_file.hpp"

namespace malleus {

std::string history_text(const HistoryCell& cell) {
  if (!cell || !std::isfinite(*cell)) return "";
  if (*cell == std::floor(*cell) && std::abs(*cell) < 1e15) return fmt::format("{}", static_cast<GlobalId>(*cell));
  return fmt::format("{}", *cell);
}

History::History(const Communicator& comm, std::filesystem::path path, std::vector<std::string> columns)
    : comm_(&comm), path_(std::move(path)), columns_(std::move(columns)) {}

std::string History::header() const {
  return fmt::format("{}\n", fmt::join(columns_, ","));
}

History History::anew(const Communicator& comm, const std::filesystem::path& path, std::vector<std::string> columns) {
  History history(comm, path, std::move(columns));
  on_root(comm, [&] {
    write_file_atomically(path, history.header());
    history.file_.reset(std::fopen(path.c_str(), "a"));
    if (history.file_ == nullptr) throw StorageError(fmt::format("{}: {}", path.string(), std::strerror(errno)));
  });
  return history;
}

History History::resumed(const Communicator& comm, const std::filesystem::path& path, std::vector<std::string> columns,
                         GlobalId last_increment) {
  History history(comm, path, std::move(columns));
  on_root(comm, [&] {
    std::string kept = history.header();
    if (std::filesystem::exists(path)) {
      std::istringstream lines(read_text_file(path));
      std::string line;
      std::getline(lines, line);
      while (std::getline(lines, line)) {
        GlobalId increment = 0;
        const auto parsed = std::from_chars(line.data(), line.data() + line.size(), increment);
        if (parsed.ec == std::errc() && increment <= last_increment) kept += line + "\n";
      }
    }
    write_file_atomically(path, kept);
    history.file_.reset(std::fopen(path.c_str(), "a"));
    if (history.file_ == nullptr) throw StorageError(fmt::format("{}: {}", path.string(), std::strerror(errno)));
  });
  return history;
}

void History::append(const std::vector<HistoryCell>& row) {
  check(row.size() == columns_.size(), "a history row has a cell for each column");
  last_row_ = row;
  on_root(*comm_, [&] {
    std::vector<std::string> cells;
    for (const HistoryCell& cell : row) cells.push_back(history_text(cell));
    const std::string line = fmt::format("{}\n", fmt::join(cells, ","));
    const bool is_written =
        std::fwrite(line.data(), 1, line.size(), file_.get()) == line.size() && std::fflush(file_.get()) == 0;
    if (!is_written) throw StorageError(fmt::format("{}: cannot be written: {}", path_.string(), std::strerror(errno)));
  });
}

}  // namespace malleus
