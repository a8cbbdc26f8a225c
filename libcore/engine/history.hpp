#pragma once

/// history.csv: one row per increment, flushed.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/process.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// Appends rows on the root. Calls are collective; failures are StorageErrors on all ranks.
class History {
 public:
  /// A new file; or, to go on after a restart, the rows of the old one up to an increment kept. InputError where its
  /// columns are others: the case has changed.
  static History anew(const Communicator& comm, const std::filesystem::path& path, std::vector<std::string> columns);
  static History resumed(const Communicator& comm, const std::filesystem::path& path, std::vector<std::string> columns,
                         GlobalId last_increment);

  /// StorageError too where the file has gone meanwhile.
  void append(const std::vector<HistoryCell>& row);
  /// Makes the rows so far survive a power cut.
  void flush_to_disk();
  const std::vector<std::string>& columns() const noexcept { return columns_; }
  const std::vector<HistoryCell>& last_row() const noexcept { return last_row_; }

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  History(const Communicator& comm, std::filesystem::path path, std::vector<std::string> columns);
  std::string header() const;
  std::string rows_up_to(GlobalId last_increment);

  const Communicator* comm_;
  std::filesystem::path path_;
  std::vector<std::string> columns_;
  std::vector<HistoryCell> last_row_;
  std::unique_ptr<std::FILE, CloseFile> file_;
};

/// Shortest text that reads back to the same number; empty for an empty cell.
std::string history_text(const HistoryCell& cell);

}  // namespace malleus
