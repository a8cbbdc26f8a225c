#include "parallel/fault.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <new>
#include <string>

#include "base/error.hpp"

namespace malleus {
namespace {

struct Fault {
  int rank = -1;
  std::string phase;
  int call = 0;
  std::string kind;
};

int to_int(std::string_view text) {
  int value = -1;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// Takes the text up to the next colon off the front.
std::string_view next_part(std::string_view& text) {
  const std::size_t colon = text.find(':');
  const std::string_view part = text.substr(0, colon);
  text.remove_prefix(colon == std::string_view::npos ? text.size() : colon + 1);
  return part;
}

Fault asked_for() {
  const char* text = std::getenv("MALLEUS_FAIL_AT");
  if (text == nullptr) return {};
  std::string_view rest(text);
  Fault fault;
  fault.rank = to_int(next_part(rest));
  fault.phase = next_part(rest);
  fault.call = to_int(next_part(rest));
  fault.kind = rest;
  return fault;
}

int this_rank = -1;

[[noreturn]] void fail(const Fault& fault) {
  const std::string message =
      fmt::format("a failure asked for by MALLEUS_FAIL_AT: rank {}, {} {}", fault.rank, fault.phase, fault.call);
  if (fault.kind == "input") throw InputError(message);
  if (fault.kind == "defect") throw Defect(message, std::source_location::current());
  if (fault.kind == "memory") throw std::bad_alloc();
  throw StorageError(message);
}

}  // namespace

void set_fault_rank(int rank) {
  this_rank = rank;
}

void pass_fault_point(std::string_view phase) {
  static const Fault fault = asked_for();
  if (fault.rank != this_rank || fault.rank < 0 || phase != fault.phase) return;
  static int calls = 0;
  if (++calls == fault.call) fail(fault);
}

}  // namespace malleus
