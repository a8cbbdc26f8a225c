#include "meshtool/cad.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "base/error.hpp"
#include "meshtool/cad_mesher.hpp"
#include "parallel/agreement.hpp"

namespace malleus::meshtool {
namespace {

constexpr std::array cad_endings = {".step", ".stp", ".brep", ".geo"};

/// The function that the module offers; the module stays loaded.
CadMesher* load_mesher() {
  void* module = dlopen(cad_module, RTLD_NOW | RTLD_LOCAL);
  void* entry = module != nullptr ? dlsym(module, cad_mesher_name) : nullptr;
  if (entry == nullptr)
    throw InputError(fmt::format("{}, which meshes CAD files and lies beside meshtool, cannot be loaded: {}",
                                 cad_module, dlerror()));
  return reinterpret_cast<decltype(&malleus_cad_mesher)>(entry)();
}

void mesh_on_root(const std::string& path, Real size, Real length_unit, MeshChunk& chunk) {
  if (!std::filesystem::is_regular_file(path)) throw InputError(fmt::format("{}: there is no such file", path));
  const std::string refusal = load_mesher()(path, size, length_unit, chunk);
  if (!refusal.empty()) throw InputError(refusal);
}

}  // namespace

bool is_cad_file(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  return std::find(cad_endings.begin(), cad_endings.end(), ending) != cad_endings.end();
}

MeshChunk mesh_cad_file(const Communicator& comm, const std::string& path, Real size, Real length_unit) {
  MeshChunk chunk;
  chunk.source = path;
  on_root(comm, [&] { mesh_on_root(path, size, length_unit, chunk); });
  share_head(comm, chunk);
  return chunk;
}

}  // namespace malleus::meshtool
