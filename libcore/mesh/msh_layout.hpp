#pragma once

/// Where the nodes and elements of an MSH file stand, found by one look over the file, so that every rank can read
/// its share of them. MSH 2.2 and 4.1: gmsh reference manual, section "MSH file format".

#include <map>
#include <string>
#include <vector>

#include "base/types.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// Element types of MSH that are read.
namespace msh_type {
inline constexpr std::int32_t line = 1;
inline constexpr std::int32_t triangle = 2;
inline constexpr std::int32_t tetrahedron = 4;
inline constexpr std::int32_t point = 15;
inline constexpr std::int32_t any = 0;  ///< each record names its own
}  // namespace msh_type

/// Nodes of one of the read types; 0 for any other.
int msh_node_count(std::int32_t type);
/// Why a type is not read: its name and the remedy.
std::string msh_type_refusal(std::int32_t type);

/// Consecutive node records. Offsets are in bytes, lines count from 1 (ASCII only).
struct MshNodeStretch {
  GlobalId count = 0;
  GlobalId tags_at = 0;
  GlobalId tags_line = 0;
  GlobalId points_at = 0;  ///< equal to tags_at in MSH 2: number and point in one record
  GlobalId points_line = 0;
  std::int64_t parameters = 0;  ///< values behind each point, passed over
};

/// Consecutive element records of one form.
struct MshElementStretch {
  GlobalId count = 0;
  GlobalId at = 0;
  GlobalId line = 0;
  std::int32_t type = msh_type::any;
  std::int32_t physical = 0;      ///< MSH 4: first physical tag of the entity, 0 = none
  std::int32_t tags = 0;          ///< MSH 2 binary: tags in each record
  std::int32_t header_bytes = 0;  ///< MSH 2 binary: bytes before each record
};

struct MshLayout {
  bool binary = false;
  int version = 4;                                   ///< 2 or 4
  std::map<std::pair<int, int>, std::string> names;  ///< (dimension, physical tag) -> name
  std::vector<MshNodeStretch> nodes;
  std::vector<MshElementStretch> elements;
  std::vector<GlobalId> line_index;  ///< ASCII: offsets as FileReader::index_lines() keeps them
};

/// The root looks over the file and tells all ranks. Checked here: the format and its version, the sections and their
/// ends, that counts fit the file, element types in binary files and MSH 4, and that the file is not partitioned.
/// InputError with the line or byte. Collective.
MshLayout find_msh_layout(const Communicator& comm, const std::string& path);

}  // namespace malleus
