#include "engine/history.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <sstream>

#include "base/error.hpp"
#include "parallel/agreement.hpp"
#include "storage/atomic_file.hpp"

namespace malleus {

namespace {

std::vector<HistoryCell> parse_row(const std::string& line) {
  std::vector<HistoryCell> row;
  std::istringstream cells(line + ",");
  for (std::string cell; std::getline(cells, cell, ',');) {
    Real value = 0;
    const auto parsed = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    row.push_back(parsed.ec == std::errc() ? HistoryCell(value) : std::nullopt);
  }
  return row;
}

}  // namespace

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

/// The last cells of the rows that are kept, and their text. On the root.
std::string History::rows_up_to(GlobalId last_increment) {
  std::string kept;
  const std::vector<std::string> lines = read_whole_lines(path_);
  if (!lines.empty() && lines.front() + "\n" != header()) {
    throw InputError(
        fmt::format("--restart: {} has other columns than this case writes; go on with the case that began "
                    "the run, or start anew without --restart",
                    path_.string()));
  }
  for (std::size_t i = 1; i < lines.size(); ++i) {
    GlobalId increment = 0;
    const auto parsed = std::from_chars(lines[i].data(), lines[i].data() + lines[i].size(), increment);
    if (parsed.ec != std::errc() || increment > last_increment) continue;
    kept += lines[i] + "\n";
    last_row_ = parse_row(lines[i]);
  }
  return kept;
}

History History::resumed(const Communicator& comm, const std::filesystem::path& path, std::vector<std::string> columns,
                         GlobalId last_increment) {
  History history(comm, path, std::move(columns));
  on_root(comm, [&] {
    const std::string rows = std::filesystem::exists(path) ? history.rows_up_to(last_increment) : "";
    if (history.last_row_.size() != history.columns_.size()) history.last_row_.clear();
    write_file_atomically(path, history.header() + rows);
    history.file_.reset(std::fopen(path.c_str(), "a"));
    if (history.file_ == nullptr) throw StorageError(fmt::format("{}: {}", path.string(), std::strerror(errno)));
  });
  return history;
}

void History::flush_to_disk() {
  on_root(*comm_, [&] {
    if (::fsync(fileno(file_.get())) != 0 && errno != EINVAL) {
      throw StorageError(fmt::format("{}: cannot be flushed to the disk: {}", path_.string(), std::strerror(errno)));
    }
  });
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
    std::error_code error;
    if (is_written && !std::filesystem::exists(path_, error)) {
      throw StorageError(fmt::format("{}: has gone: was the output directory removed?", path_.string()));
    }
    if (!is_written) throw StorageError(fmt::format("{}: cannot be written: {}", path_.string(), std::strerror(errno)));
  });
}

}  // namespace malleus
