#pragma once

/// What the program says: the terminal and run.log, from the root rank alone. Call alike on all ranks; texts of other
/// ranks are dropped.

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <vector>

namespace malleus::log {

enum class Level { quiet, normal, verbose };

/// Sets what reaches the terminal; run.log gets everything. speaks: true on the root rank alone.
void start(bool speaks, Level level);
/// From now on everything also goes to that file, after the warnings so far; append keeps what stands there.
/// StorageError. Local.
void open_file(const std::filesystem::path& path, bool append);
void close_file();

void say(const std::string& text);     ///< one line of the report; not on the terminal of a quiet run
void detail(const std::string& text);  ///< on the terminal only of a verbose run
void warn(const std::string& text);    ///< with "warning: "; also kept for the summary; once per text
const std::vector<std::string>& warnings();

/// While it lives nothing is said or kept: for trials beside the run, on all ranks alike.
class Silence {
 public:
  Silence();
  ~Silence();
  Silence(const Silence&) = delete;
  Silence& operator=(const Silence&) = delete;
};

template <class... Arguments>
void info(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
  say(fmt::format(text, std::forward<Arguments>(arguments)...));
}
template <class... Arguments>
void debug(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
  detail(fmt::format(text, std::forward<Arguments>(arguments)...));
}
template <class... Arguments>
void warning(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
  warn(fmt::format(text, std::forward<Arguments>(arguments)...));
}

}  // namespace malleus::log
