#include "mesh/msh_scanner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace malleus {
namespace {

constexpr GlobalId node2_bytes = 4 + 3 * 8;

/// The values of one header: a line of text, or bytes in a row.
class Header {
 public:
  Header(FileReader& file, bool binary, const char* what) : file_(file) {
    if (binary) return;
    if (file.at_end()) file.fail_at_line(file.line_number(), fmt::format("the file ends where {} was expected", what));
    const GlobalId line = file.line_number();
    fields_.emplace(file, line, file.read_line(), what);
  }
  template <class T>
  T get() {
    return fields_ ? fields_->get<T>() : file_.read_value<T>();
  }
  GlobalId get_count() {
    const GlobalId at = file_.position();
    const auto count = get<std::int64_t>();
    if (count >= 0 && count <= file_.size()) return count;
    const std::string what = fmt::format("{} cannot be a count in a file of {} bytes", count, file_.size());
    if (fields_) fields_->fail(what);
    file_.fail_at_byte(at, what);
  }

 private:
  FileReader& file_;
  std::optional<LineFields> fields_;
};

class Scanner {
 public:
  explicit Scanner(const std::string& path) : file_(path) { file_.index_lines(); }

  MshLayout scan() {
    read_format();
    while (const auto name = next_section()) {
      if (*name == "PhysicalNames") {
        read_names();
      } else if (*name == "Entities" && layout_.version == 4) {
        read_entities();
      } else if (*name == "PartitionedEntities") {
        fail(
            "the mesh was partitioned by gmsh, which is not read: save it unpartitioned (it is divided anew when "
            "read)");
      } else if (*name == "Nodes") {
        begin_once(has_nodes_, "Nodes");
        layout_.version == 2 ? scan_nodes2() : scan_nodes4();
      } else if (*name == "Elements") {
        begin_once(has_elements_, "Elements");
        layout_.version == 2 ? scan_elements2() : scan_elements4();
      } else {
        skip_section(*name);
        continue;
      }
      expect_end(*name);
    }
    if (!has_nodes_) fail("the file has no section $Nodes");
    if (!has_elements_) fail("the file has no section $Elements");
    resolve_physicals();
    if (!layout_.binary) layout_.line_index = file_.take_line_index();
    return std::move(layout_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { fail_at(file_.position(), file_.line_number(), what); }
  [[noreturn]] void fail_at(GlobalId byte, GlobalId line, const std::string& what) const {
    if (layout_.binary) file_.fail_at_byte(byte, what);
    file_.fail_at_line(line, what);
  }
  Header header(const char* what) { return Header(file_, layout_.binary, what); }
  Header text_header(const char* what) { return Header(file_, false, what); }

  void begin_once(bool& seen, const char* name) {
    if (seen) fail(fmt::format("a second section ${}", name));
    seen = true;
  }

  /// The next line that is not blank, without blanks at its end; none at the end of the file.
  std::optional<std::string> next_text() {
    while (!file_.at_end()) {
      std::string_view line = file_.read_line();
      while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.remove_suffix(1);
      if (!line.empty()) return std::string(line.substr(0, 80));
    }
    return std::nullopt;
  }

  std::optional<std::string> next_section() {
    const std::optional<std::string> text = next_text();
    if (!text) return std::nullopt;
    if (text->front() != '$') fail_before("expected the start of a section, such as $Nodes");
    return text->substr(1);
  }
  /// For the line just read.
  [[noreturn]] void fail_before(const std::string& what) const {
    fail_at(file_.position(), file_.line_number() - 1, what);
  }

  void expect_end(const std::string& name) {
    const std::optional<std::string> text = next_text();
    if (!text) fail(fmt::format("the file ends before $End{}: it is not complete", name));
    if (*text != "$End" + name) {
      fail_before(fmt::format("expected $End{} here: the announced counts do not fit the section", name));
    }
  }

  void skip_section(const std::string& name) {
    const std::string end = "$End" + name;
    if (layout_.binary) {
      if (file_.skip_behind(end)) return;
    } else {
      while (const auto text = next_text()) {
        if (*text == end) return;
      }
    }
    fail(fmt::format("the file ends before {}: it is not complete", end));
  }

  void read_format();
  void read_names();
  void read_entities();
  void scan_nodes2();
  /// How many blocks a section of version 4.1 has, and how many nodes or elements in all.
  struct BlockCounts {
    GlobalId blocks;
    GlobalId announced;
  };
  BlockCounts block_counts(const char* what);
  void scan_nodes4();
  void scan_elements2();
  void scan_elements2_binary(GlobalId count);
  void scan_elements4();
  void skip_records(GlobalId count, GlobalId bytes_each, GlobalId lines_each);
  void resolve_physicals();

  FileReader file_;
  MshLayout layout_;
  bool has_nodes_ = false;
  bool has_elements_ = false;
  std::map<std::pair<int, int>, int> physical_of_entity_;  ///< (dimension, entity) -> first physical tag
  std::vector<std::pair<int, int>> entity_of_stretch_;
};

void Scanner::read_format() {
  if (next_text() != "$MeshFormat") file_.fail_at_line(1, "is not a gmsh mesh: it does not begin with $MeshFormat");
  Header format = text_header("the format");
  const auto version = format.get<double>();
  const auto kind = format.get<std::int32_t>();
  const auto data_size = format.get<std::int32_t>();
  const bool is_known = (version >= 2.0 && version <= 2.2) || version == 4.1;
  if (!is_known) {
    fail_before(fmt::format("MSH version {} is not read; 2.2 and 4.1 are (gmsh: Mesh.MshFileVersion = 4.1)", version));
  }
  if (kind != 0 && kind != 1) fail_before(fmt::format("file type {} is neither 0 (ASCII) nor 1 (binary)", kind));
  if (data_size != 8) fail_before(fmt::format("numbers of {} bytes are not read, of 8 are", data_size));
  layout_.version = version < 3 ? 2 : 4;
  if (kind == 1) {
    layout_.binary = true;
    if (file_.read_value<std::int32_t>() != 1) fail("the file was written on a machine of other byte order");
  }
  expect_end("MeshFormat");
}

void Scanner::read_names() {
  const GlobalId count = text_header("the number of names").get_count();
  for (GlobalId i = 0; i < count; ++i) {
    const GlobalId line_number = file_.line_number();
    if (file_.at_end()) fail("the file ends within $PhysicalNames");
    LineFields fields(file_, line_number, file_.read_line(), "a physical name");
    const auto dim = fields.get<std::int32_t>();
    const auto tag = fields.get<std::int32_t>();
    fields.has_more();
    const std::string_view rest = fields.rest();
    const std::size_t close = rest.rfind('"');
    if (rest.empty() || rest.front() != '"' || close == 0) fields.fail("a physical name must stand in quotes");
    if (close == 1) fields.fail("a physical name is empty");
    layout_.names[{dim, tag}] = std::string(rest.substr(1, close - 1));
  }
}

void Scanner::read_entities() {
  std::array<GlobalId, 4> counts{};
  Header sizes = header("the numbers of entities");
  for (GlobalId& count : counts) count = sizes.get_count();
  for (int dim = 0; dim < 4; ++dim) {
    for (GlobalId i = 0; i < counts[static_cast<std::size_t>(dim)]; ++i) {
      Header entity = header("an entity");
      const auto tag = entity.get<std::int32_t>();
      for (int k = 0; k < (dim == 0 ? 3 : 6); ++k) entity.get<double>();
      const GlobalId physicals = entity.get_count();
      for (GlobalId k = 0; k < physicals; ++k) {
        const auto physical = entity.get<std::int32_t>();
        if (k == 0) physical_of_entity_[{dim, tag}] = physical;
      }
      if (dim == 0) continue;
      const GlobalId bounding = entity.get_count();
      for (GlobalId k = 0; k < bounding; ++k) entity.get<std::int32_t>();
    }
  }
}

/// Goes over the records of a section whose count was announced.
void Scanner::skip_records(GlobalId count, GlobalId bytes_each, GlobalId lines_each) {
  if (layout_.binary) {
    if (count > file_.remaining() / bytes_each) {
      fail(fmt::format("{} records are announced, but the file ends: it is not complete", count));
    }
    file_.seek(file_.position() + count * bytes_each);
  } else if (!file_.skip_lines(count * lines_each)) {
    fail(fmt::format("{} records are announced, but the file ends: it is not complete", count));
  }
}

void Scanner::scan_nodes2() {
  MshNodeStretch stretch;
  stretch.count = text_header("the number of nodes").get_count();
  stretch.tags_at = stretch.points_at = file_.position();
  stretch.tags_line = stretch.points_line = file_.line_number();
  skip_records(stretch.count, node2_bytes, 1);
  layout_.nodes.push_back(stretch);
}

Scanner::BlockCounts Scanner::block_counts(const char* what) {
  Header sizes = header(what);
  const GlobalId blocks = sizes.get_count();
  const GlobalId announced = sizes.get_count();
  sizes.get<std::int64_t>();
  sizes.get<std::int64_t>();
  return {blocks, announced};
}

void Scanner::scan_nodes4() {
  const auto [blocks, announced] = block_counts("the header of $Nodes");
  GlobalId found = 0;
  for (GlobalId b = 0; b < blocks; ++b) {
    Header block = header("the header of a block of nodes");
    const auto dim = block.get<std::int32_t>();
    block.get<std::int32_t>();
    const auto parametric = block.get<std::int32_t>();
    MshNodeStretch stretch;
    stretch.count = block.get_count();
    if (dim < 0 || dim > 3) fail(fmt::format("a block of nodes of dimension {}", dim));
    stretch.parameters = parametric != 0 ? dim : 0;
    stretch.tags_at = file_.position();
    stretch.tags_line = file_.line_number();
    skip_records(stretch.count, 8, 1);
    stretch.points_at = file_.position();
    stretch.points_line = file_.line_number();
    skip_records(stretch.count, 8 * (3 + stretch.parameters), 1);
    found += stretch.count;
    if (stretch.count > 0) layout_.nodes.push_back(stretch);
  }
  if (found != announced) fail(fmt::format("$Nodes announces {} nodes and holds {}", announced, found));
}

void Scanner::scan_elements2() {
  const GlobalId count = text_header("the number of elements").get_count();
  if (layout_.binary) {
    scan_elements2_binary(count);
    return;
  }
  MshElementStretch stretch;
  stretch.count = count;
  stretch.at = file_.position();
  stretch.line = file_.line_number();
  skip_records(count, 1, 1);
  layout_.elements.push_back(stretch);
}

/// gmsh writes a header before each element; stretches of such single elements are joined.
void Scanner::scan_elements2_binary(GlobalId count) {
  constexpr std::int32_t header_bytes = 12;
  for (GlobalId found = 0; found < count;) {
    const GlobalId header_at = file_.position();
    MshElementStretch block;
    block.type = file_.read_value<std::int32_t>();
    block.count = file_.read_value<std::int32_t>();
    block.tags = file_.read_value<std::int32_t>();
    if (msh_node_count(block.type) == 0) file_.fail_at_byte(header_at, msh_type_refusal(block.type));
    if (block.count <= 0 || block.count > count - found) {
      file_.fail_at_byte(header_at, fmt::format("a block of {} elements, {} remain", block.count, count - found));
    }
    if (block.tags < 0 || block.tags > 1000) {
      file_.fail_at_byte(header_at, fmt::format("{} tags for an element", block.tags));
    }
    block.at = file_.position();
    skip_records(block.count, 4 * (1 + block.tags + msh_node_count(block.type)), 0);
    found += block.count;
    if (block.count == 1) {
      block.at = header_at;
      block.header_bytes = header_bytes;
      MshElementStretch* last = layout_.elements.empty() ? nullptr : &layout_.elements.back();
      if (last != nullptr && last->header_bytes > 0 && last->type == block.type && last->tags == block.tags) {
        ++last->count;
        continue;
      }
    }
    layout_.elements.push_back(block);
  }
}

void Scanner::scan_elements4() {
  const auto [blocks, announced] = block_counts("the header of $Elements");
  GlobalId found = 0;
  for (GlobalId b = 0; b < blocks; ++b) {
    const GlobalId header_at = file_.position();
    const GlobalId header_line = file_.line_number();
    Header block = header("the header of a block of elements");
    const auto dim = block.get<std::int32_t>();
    const auto entity = block.get<std::int32_t>();
    MshElementStretch stretch;
    stretch.type = block.get<std::int32_t>();
    stretch.count = block.get_count();
    if (msh_node_count(stretch.type) == 0) fail_at(header_at, header_line, msh_type_refusal(stretch.type));
    stretch.at = file_.position();
    stretch.line = file_.line_number();
    skip_records(stretch.count, 8 * (1 + msh_node_count(stretch.type)), 1);
    found += stretch.count;
    if (stretch.count == 0) continue;
    layout_.elements.push_back(stretch);
    entity_of_stretch_.emplace_back(dim, entity);
  }
  if (found != announced) fail(fmt::format("$Elements announces {} elements and holds {}", announced, found));
}

void Scanner::resolve_physicals() {
  for (std::size_t i = 0; i < entity_of_stretch_.size(); ++i) {
    const auto found = physical_of_entity_.find(entity_of_stretch_[i]);
    if (found != physical_of_entity_.end()) layout_.elements[i].physical = found->second;
  }
}

}  // namespace

MshLayout scan_msh(const std::string& path) {
  return Scanner(path).scan();
}

}  // namespace malleus
