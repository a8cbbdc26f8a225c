#pragma once

/// The ways in which a run ends early, and the exit codes that users' scripts rely on.

#include <source_location>
#include <stdexcept>
#include <string>

namespace malleus {

namespace exit_code {
inline constexpr int done = 0;
inline constexpr int defect = 1;         ///< broken invariant of ours
inline constexpr int wrong_input = 2;    ///< command line, case, mesh or architecture file
inline constexpr int numerics = 3;       ///< diverged; the last good state is on disk
inline constexpr int storage = 4;        ///< disk or file system
inline constexpr int checkpointed = 85;  ///< stopped on a signal or a limit; run again with --restart
}  // namespace exit_code

/// Any foreseen end of the run. what() is the text for the user: complete, without an "error:" prefix.
class Error : public std::runtime_error {
 public:
  Error(int code, const std::string& message) : std::runtime_error(message), code_(code) {}
  int code() const noexcept { return code_; }

 private:
  int code_;
};

/// The user's mistake: the message names file, line, section and key, what was found and what is allowed.
class InputError : public Error {
 public:
  explicit InputError(const std::string& message) : Error(exit_code::wrong_input, message) {}
};

/// The numerics failed (divergence, elements that no repair could turn).
class NumericsError : public Error {
 public:
  explicit NumericsError(const std::string& message) : Error(exit_code::numerics, message) {}
};

/// The disk or the file system failed while writing, or one of our own files is damaged.
class StorageError : public Error {
 public:
  explicit StorageError(const std::string& message) : Error(exit_code::storage, message) {}
};

/// A broken invariant: a defect of the program, with its place. Ends all ranks with exit code 1.
class Defect : public std::logic_error {
 public:
  Defect(const std::string& message, const std::source_location& place);
};

/// Throws Defect unless the promise holds. For O(1) tests that stay on in every build.
inline void check(bool promise, const char* message,
                  const std::source_location& place = std::source_location::current()) {
  if (!promise) throw Defect(message, place);
}

}  // namespace malleus
