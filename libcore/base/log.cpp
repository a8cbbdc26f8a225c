#include "base/log.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

#include "base/error.hpp"

namespace malleus::log {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

struct State {
  bool speaks = true;
  Level level = Level::normal;
  std::unique_ptr<std::FILE, CloseFile> file;
  std::vector<std::string> warnings;
  int silences = 0;
};

State& state() {
  static State instance;
  return instance;
}

void put(std::FILE* target, const std::string& line) {
  std::fwrite(line.data(), 1, line.size(), target);
  std::fputc('\n', target);
  std::fflush(target);
}

void write(const std::string& line, Level least, std::FILE* terminal) {
  State& log = state();
  if (!log.speaks || log.silences > 0) return;
  if (log.level >= least) put(terminal, line);
  if (log.file != nullptr) put(log.file.get(), line);
}

}  // namespace

void start(bool speaks, Level level) {
  state().speaks = speaks;
  state().level = level;
}

void open_file(const std::filesystem::path& path, bool append) {
  State& log = state();
  if (!log.speaks) return;
  log.file.reset(std::fopen(path.c_str(), append ? "a" : "w"));
  if (log.file == nullptr) {
    throw StorageError(fmt::format("{}: cannot be opened for writing: {}", path.string(), std::strerror(errno)));
  }
  for (const std::string& warning : log.warnings) put(log.file.get(), "warning: " + warning);
}

void close_file() {
  state().file.reset();
}

void say(const std::string& text) {
  write(text, Level::normal, stdout);
}
void detail(const std::string& text) {
  write(text, Level::verbose, stdout);
}

void warn(const std::string& text) {
  if (state().silences > 0) return;
  std::vector<std::string>& known = state().warnings;
  if (std::find(known.begin(), known.end(), text) != known.end()) return;
  known.push_back(text);
  write("warning: " + text, Level::quiet, stderr);
}

Silence::Silence() {
  ++state().silences;
}
Silence::~Silence() {
  --state().silences;
}

const std::vector<std::string>& warnings() {
  return state().warnings;
}

}  // namespace malleus::log
