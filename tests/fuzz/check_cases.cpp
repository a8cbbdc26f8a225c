/// Answers many cases as `forge --check` or `inject --check` do, one after the other in the same process:
///
///     mpirun -n 3 check_cases forge DIRECTORY FIRST LAST
///
/// asks for DIRECTORY/N.ini, N from FIRST to before LAST, and prints a line for each: N, the exit code and what an
/// error says, on one line. Ends by SIGALRM where an answer takes longer than a minute, on any rank.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "engine/run_guarded.hpp"
#include "engine/simulator.hpp"
#include "forge/assemble.hpp"
#include "inject/assemble.hpp"
#include "parallel/petsc_session.hpp"

namespace malleus {
namespace {

constexpr unsigned patience_s = 60;

struct Answer {
  int code = exit_code::done;
  std::string words;
};

std::unique_ptr<Simulator> make_simulator(std::string_view program) {
  if (program == "forge") return std::make_unique<forge::ForgeSimulator>();
  return std::make_unique<inject::InjectSimulator>();
}

/// On this rank; another rank may come to another answer, which is a defect.
Answer ask(const Communicator& comm, std::string_view program, const std::string& path) {
  const std::unique_ptr<Simulator> simulator = make_simulator(program);
  try {
    return {answer(comm, *simulator, {"--quiet", "--check", path}), ""};
  } catch (const Error& error) {
    return {error.code(), error.what()};
  } catch (const std::exception& error) {
    return {exit_code::defect, error.what()};
  }
}

int answer_all(const Communicator& comm, const std::vector<std::string>& arguments) {
  const int first = std::stoi(arguments.at(2));
  const int last = std::stoi(arguments.at(3));
  for (int number = first; number < last; ++number) {
    alarm(patience_s);
    Answer given = ask(comm, arguments.at(0), fmt::format("{}/{}.ini", arguments.at(1), number));
    const GlobalId code = given.code;
    if (comm.min(code) != comm.max(code)) given = {exit_code::defect, "ranks answer differently"};
    alarm(0);
    std::replace(given.words.begin(), given.words.end(), '\n', ' ');
    if (comm.is_root()) fmt::print("{} {} {}\n", number, given.code, given.words);
    std::fflush(stdout);
  }
  return exit_code::done;
}

}  // namespace
}  // namespace malleus

int main(int argc, char** argv) {
  return malleus::run_guarded(argc, argv, malleus::answer_all, malleus::start_petsc);
}
