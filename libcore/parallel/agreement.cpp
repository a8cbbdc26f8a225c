#include "parallel/agreement.hpp"

#include <new>
#include <source_location>
#include <string>

#include "base/error.hpp"
#include "parallel/fault.hpp"

namespace malleus {
namespace {

constexpr int no_error = -1;

struct Caught {
  int code = no_error;
  std::string message;
};

Caught run_and_catch(const std::function<void()>& work) {
  try {
    pass_fault_point("agreement");
    work();
  } catch (const Error& error) {
    return {error.code(), error.what()};
  } catch (const std::bad_alloc&) {
    return {exit_code::defect, "out of memory"};
  } catch (const std::exception& error) {
    return {exit_code::defect, error.what()};
  }
  return {};
}

[[noreturn]] void throw_of_kind(int code, const std::string& message) {
  switch (code) {
    case exit_code::defect:
      throw Defect(message, std::source_location::current());
    case exit_code::wrong_input:
      throw InputError(message);
    case exit_code::numerics:
      throw NumericsError(message);
    case exit_code::storage:
      throw StorageError(message);
    default:
      throw Error(code, message);
  }
}

}  // namespace

void agree(const Communicator& comm, const std::function<void()>& work) {
  Caught caught = run_and_catch(work);
  const GlobalId nobody = comm.size();
  const GlobalId first = comm.min(caught.code == no_error ? nobody : static_cast<GlobalId>(comm.rank()));
  if (first == nobody) return;
  const int root = static_cast<int>(first);
  GlobalId code = caught.code;
  comm.broadcast(std::span(&code, 1), root);
  comm.broadcast(caught.message, root);
  throw_of_kind(static_cast<int>(code), caught.message);
}

void on_root(const Communicator& comm, const std::function<void()>& work) {
  agree(comm, [&] {
    if (comm.is_root()) work();
  });
}

}  // namespace malleus
