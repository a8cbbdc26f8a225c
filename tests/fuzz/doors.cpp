#include "doors.hpp"

#include <algorithm>
#include <array>
#include <cfenv>
#include <fstream>

#include "base/error.hpp"
#include "case/case_file.hpp"
#include "case/expression.hpp"
#include "case/schema.hpp"
#include "engine/load_mesh.hpp"
#include "forge/forge_case.hpp"
#include "forge/surface_file.hpp"
#include "inject/sections.hpp"
#include "mesh/medit_io.hpp"
#include "mesh/msh_reader.hpp"
#include "parallel/agreement.hpp"

namespace malleus::fuzz {
namespace {

/// A file of the bytes, the same for all ranks.
std::string write_file(const Communicator& comm, std::string_view bytes, const std::string& path) {
  on_root(comm, [&] {
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  });
  return path;
}

/// Reads a case; one that is taken must be taken again as it was resolved.
template <class Case>
void read_case(const Communicator& comm, std::string_view text, const std::string& scratch) {
  const auto read = [&](std::string_view content) {
    CaseReader reader(comm, CaseFile::parse(content, scratch + "/case.ini", {}));
    Case scene;
    scene.describe(reader);
    reader.finish();
    reader.check_mesh({2, {"part", "cavity"}, {"left", "right", "top", "bottom"}});
    return reader.resolved(scratch);
  };
  std::string resolved;
  try {
    resolved = read(text);
  } catch (const InputError&) {
    return;
  }
  try {
    read(resolved);
  } catch (const InputError& error) {
    throw Defect(std::string("a resolved case is refused: ") + error.what() + "\n" + resolved,
                 std::source_location::current());
  }
}

void enter_case(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  write_file(comm, "", scratch + "/part.msh");
  read_case<forge::ForgeCase>(comm, bytes, scratch);
  read_case<inject::InjectCase>(comm, bytes, scratch);
}

void enter_expression(const Communicator&, std::string_view bytes, const std::string&) {
  try {
    const Expression formula = Expression::parse(bytes);
    const std::array<Real, 6> points = {0, 0, 0, 0.5, -2, 1e3};
    std::array<Real, 2> values{};
    formula.evaluate(points, 3, 0.25, values);
    formula.evaluate_finite(points, 3, 0.25, values);
  } catch (const InputError&) {
  }
}

void enter_mesh(const Communicator& comm, std::string_view bytes, const std::string& path) {
  write_file(comm, bytes, path);
  try {
    FieldStore fields;
    load_mesh(comm, path, 1, fields);
  } catch (const InputError&) {
  }
}

void enter_msh(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  enter_mesh(comm, bytes, scratch + "/mesh.msh");
}
void enter_medit(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  enter_mesh(comm, bytes, scratch + "/mesh.mesh");
}
void enter_meditb(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  enter_mesh(comm, bytes, scratch + "/mesh.meshb");
}
void enter_h5(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  enter_mesh(comm, bytes, scratch + "/mesh.h5");
}

/// The size field of a metric, in both forms.
void enter_sol(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  for (const char* ending : {".sol", ".solb"}) {
    const std::string path = write_file(comm, bytes, scratch + "/size" + ending);
    agree(comm, [&] {
      try {
        read_medit_solution(path);
      } catch (const InputError&) {
      }
    });
  }
}

void enter_stl(const Communicator&, std::string_view bytes, const std::string&) {
  try {
    forge::parse_stl(std::string(bytes), "tool.stl", 1e-3);
  } catch (const InputError&) {
  }
}

void enter_msh_surface(const Communicator& comm, std::string_view bytes, const std::string& scratch) {
  const std::string path = write_file(comm, bytes, scratch + "/tool.msh");
  agree(comm, [&] {
    for (const int dim : {2, 3}) {
      try {
        forge::read_surface_file(path, dim, 1e-3);
      } catch (const InputError&) {
      }
    }
  });
}

constexpr std::array<NamedDoor, 9> all_doors = {{{"case", enter_case},
                                                 {"expression", enter_expression},
                                                 {"msh", enter_msh},
                                                 {"medit", enter_medit},
                                                 {"meditb", enter_meditb},
                                                 {"sol", enter_sol},
                                                 {"stl", enter_stl},
                                                 {"msh_surface", enter_msh_surface},
                                                 {"h5", enter_h5}}};

}  // namespace

std::span<const NamedDoor> doors() {
  return all_doors;
}

Door find_door(std::string_view name) {
  const auto found =
      std::find_if(all_doors.begin(), all_doors.end(), [&](const NamedDoor& d) { return d.name == name; });
  return found == all_doors.end() ? nullptr : found->enter;
}

}  // namespace malleus::fuzz
