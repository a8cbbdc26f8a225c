#include "mesh/medit_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>

#include "base/error.hpp"

namespace malleus {
namespace {

namespace fs = std::filesystem;

/// Sections by their binary code; reals come first in a record, then integers.
struct Section {
  const char* name;
  int code;
  int integers;  ///< nodes and reference
};
constexpr int vertices_code = 4;
constexpr int end_code = 54;
constexpr int solution_code = 62;
constexpr std::array<Section, 6> sections = {{{"Vertices", vertices_code, 1},
                                              {"Edges", 5, 3},
                                              {"Triangles", 6, 4},
                                              {"Tetrahedra", 8, 5},
                                              {"Corners", 13, 1},
                                              {"Ridges", 14, 1}}};

bool is_binary(const fs::path& path) {
  const std::string ending = path.extension().string();
  return ending == ".meshb" || ending == ".solb";
}

std::string read_all(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("{}: cannot be read", path.string()));
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// What both forms of file are read through: numbers in order, sections by name or code.
class Source {
 public:
  virtual ~Source() = default;
  /// Moves to the next section; returns its code, 0 for one that is skipped, end_code at the end.
  virtual int next_section() = 0;
  virtual std::int64_t integer() = 0;
  virtual std::int64_t count() = 0;
  virtual Real real() = 0;
  /// Of the file, not read yet: no section has more entries.
  virtual std::size_t bytes_left() const = 0;
};

class AsciiSource : public Source {
 public:
  explicit AsciiSource(const fs::path& path) : path_(path), text_(read_all(path)) { at_ = text_.c_str(); }

  int next_section() override {
    const std::string word = next_word();
    if (word.empty() || word == "End") return end_code;
    if (word == "Dimension") return 3;
    if (word == "SolAtVertices") return solution_code;
    for (const auto& section : sections) {
      if (word == section.name) return section.code;
    }
    return 0;
  }
  std::int64_t integer() override {
    skip_blank();
    char* end = nullptr;
    const long long value = std::strtoll(at_, &end, 10);
    accept(end);
    return value;
  }
  std::int64_t count() override { return integer(); }
  Real real() override {
    skip_blank();
    char* end = nullptr;
    const Real value = std::strtod(at_, &end);
    accept(end);
    return value;
  }
  std::size_t bytes_left() const override { return static_cast<std::size_t>(text_.c_str() + text_.size() - at_); }

 private:
  void skip_blank() {
    while (*at_ != 0) {
      if (*at_ == '#') {
        while (*at_ != 0 && *at_ != '\n') ++at_;
      } else if (std::isspace(static_cast<unsigned char>(*at_)) != 0) {
        ++at_;
      } else {
        return;
      }
    }
  }
  void accept(const char* end) {
    const bool ends_well = *end == 0 || *end == '#' || std::isspace(static_cast<unsigned char>(*end)) != 0;
    if (end == at_ || !ends_well) {
      const auto line = 1 + std::count(text_.c_str(), at_, '\n');
      throw InputError(fmt::format("{}:{}: a number was expected", path_.string(), line));
    }
    at_ = end;
  }
  /// The next word that begins with a letter; numbers of skipped sections are passed over.
  std::string next_word() {
    while (true) {
      skip_blank();
      if (*at_ == 0) return {};
      const char* begin = at_;
      while (*at_ != 0 && std::isspace(static_cast<unsigned char>(*at_)) == 0) ++at_;
      if (std::isalpha(static_cast<unsigned char>(*begin)) != 0) return {begin, at_};
    }
  }

  fs::path path_;
  std::string text_;
  const char* at_ = nullptr;
};

class BinarySource : public Source {
 public:
  explicit BinarySource(const fs::path& path) : path_(path), bytes_(read_all(path)) {
    if (take<std::int32_t>() != 1)
      throw InputError(fmt::format("{}: no binary Medit file of this machine's byte order", path_.string()));
    version_ = take<std::int32_t>();
    if (version_ < 1 || version_ > 4)
      throw InputError(fmt::format("{}: Medit version {} is none of 1 to 4", path_.string(), version_));
    next_ = at_;
  }

  int next_section() override {
    at_ = next_;
    if (at_ + 4 > bytes_.size()) return end_code;
    const auto code = take<std::int32_t>();
    if (code == end_code) return end_code;
    const auto after = version_ >= 3 ? take<std::int64_t>() : take<std::int32_t>();
    next_ = after > static_cast<std::int64_t>(at_) ? static_cast<std::size_t>(after) : bytes_.size();
    if (code == 3 || code == solution_code) return code;
    for (const auto& section : sections) {
      if (code == section.code) return code;
    }
    return 0;
  }
  std::int64_t integer() override { return version_ >= 4 ? take<std::int64_t>() : take<std::int32_t>(); }
  std::int64_t count() override { return integer(); }
  Real real() override { return version_ >= 2 ? take<double>() : static_cast<Real>(take<float>()); }
  std::size_t bytes_left() const override { return bytes_.size() - at_; }
  std::int32_t small_integer() { return take<std::int32_t>(); }

 private:
  template <class T>
  T take() {
    if (at_ + sizeof(T) > bytes_.size()) throw InputError(fmt::format("{}: the file is cut off", path_.string()));
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

  fs::path path_;
  std::string bytes_;
  int version_ = 0;
  std::size_t at_ = 0;
  std::size_t next_ = 0;
};

std::unique_ptr<Source> open_source(const fs::path& path) {
  if (is_binary(path)) return std::make_unique<BinarySource>(path);
  return std::make_unique<AsciiSource>(path);
}

/// Integers of fixed size in binary files whatever the version: dimension and kinds of solutions.
std::int32_t small_integer(Source& source) {
  if (auto* binary = dynamic_cast<BinarySource*>(&source)) return binary->small_integer();
  return static_cast<std::int32_t>(source.integer());
}

std::size_t checked_count(Source& source, const fs::path& path) {
  const std::int64_t n = source.count();
  if (n < 0 || n > 2000000000)
    throw InputError(fmt::format("{}: a section of {} entries is out of range", path.string(), n));
  if (static_cast<std::size_t>(n) > source.bytes_left())
    throw InputError(fmt::format("{}: a section of {} entries: the file is cut off", path.string(), n));
  return static_cast<std::size_t>(n);
}

/// A node from 0 on; -1 where the number is none that a file can have.
LocalId node_number(Source& source) {
  const std::int64_t number = source.integer();
  return number < 1 || number > std::numeric_limits<LocalId>::max() ? -1 : static_cast<LocalId>(number - 1);
}

/// References are labels: those beyond 32 bits are refused rather than cut.
std::int32_t reference(Source& source, const fs::path& path) {
  const std::int64_t value = source.integer();
  if (value < std::numeric_limits<std::int32_t>::min() || value > std::numeric_limits<std::int32_t>::max())
    throw InputError(fmt::format("{}: the reference {} is out of range", path.string(), value));
  return static_cast<std::int32_t>(value);
}

Real finite_number(Source& source, const fs::path& path) {
  const Real value = source.real();
  if (!std::isfinite(value)) throw InputError(fmt::format("{}: a coordinate or a size is not finite", path.string()));
  return value;
}

void read_vertices(Source& source, std::size_t n, const fs::path& path, MeditMesh& mesh) {
  mesh.coordinates.reserve(n * static_cast<std::size_t>(mesh.dimension));
  mesh.node_reference.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < mesh.dimension; ++k) mesh.coordinates.push_back(finite_number(source, path));
    mesh.node_reference.push_back(reference(source, path));
  }
}

void read_entities(Source& source, std::size_t n, int nodes, const fs::path& path, std::vector<LocalId>& numbers,
                   std::vector<std::int32_t>* references) {
  numbers.reserve(n * static_cast<std::size_t>(nodes));
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < nodes; ++k) numbers.push_back(node_number(source));
    if (references != nullptr) references->push_back(reference(source, path));
  }
}

void read_section(Source& source, int code, const fs::path& path, MeditMesh& mesh) {
  const std::size_t n = checked_count(source, path);
  if (code == vertices_code) read_vertices(source, n, path, mesh);
  if (code == 5) read_entities(source, n, 2, path, mesh.edges, &mesh.edge_reference);
  if (code == 6) read_entities(source, n, 3, path, mesh.triangles, &mesh.triangle_reference);
  if (code == 8) read_entities(source, n, 4, path, mesh.tetrahedra, &mesh.tetrahedron_reference);
  if (code == 13) read_entities(source, n, 1, path, mesh.corners, nullptr);
  if (code == 14) read_entities(source, n, 1, path, mesh.ridges, nullptr);
}

void check_nodes(const fs::path& path, const std::vector<LocalId>& numbers, LocalId limit, const char* what) {
  for (const LocalId number : numbers) {
    if (number < 0 || number >= limit)
      throw InputError(fmt::format("{}: {} names number {}, of {}", path.string(), what, number + 1, limit));
  }
}

void set_dimension(Source& source, const fs::path& path, int& dimension) {
  dimension = small_integer(source);
  if (dimension != 2 && dimension != 3)
    throw InputError(fmt::format("{}: dimension {} is neither 2 nor 3", path.string(), dimension));
}

/// What both forms of file are written through.
class Sink {
 public:
  Sink(const fs::path& path, int dimension) : path_(path), binary_(is_binary(path)), file_(path, std::ios::binary) {
    if (!file_) throw StorageError(fmt::format("{}: cannot be written", path_.string()));
    if (binary_) {
      put<std::int32_t>(1);
      put<std::int32_t>(3);
      put<std::int32_t>(3);
      put<std::int64_t>(8 + 4 + 8 + 4);
      put<std::int32_t>(dimension);
    } else {
      text_ = fmt::format("MeshVersionFormatted 2\n\nDimension {}\n", dimension);
    }
  }
  /// reals and integers: how many of them the section holds in all.
  void section(const char* name, int code, std::size_t n, std::size_t bytes) {
    if (binary_) {
      flush();
      put<std::int32_t>(code);
      put<std::int64_t>(static_cast<std::int64_t>(file_.tellp()) +
                        static_cast<std::int64_t>(text_.size() + 12 + bytes));
      put<std::int32_t>(static_cast<std::int32_t>(n));
    } else {
      text_ += fmt::format("\n{}\n{}\n", name, n);
    }
  }
  void real(Real value) {
    if (binary_) {
      put(value);
    } else {
      fmt::format_to(std::back_inserter(text_), "{:.17g} ", value);
    }
  }
  void integer(std::int64_t value) {
    if (binary_) {
      put(static_cast<std::int32_t>(value));
    } else {
      fmt::format_to(std::back_inserter(text_), "{} ", value);
    }
  }
  void end_record() {
    if (!binary_) text_ += '\n';
    if (text_.size() > (1U << 20)) flush();
  }
  void finish() {
    if (binary_) {
      put<std::int32_t>(end_code);
      put<std::int64_t>(0);
    } else {
      text_ += "\nEnd\n";
    }
    flush();
    file_.close();
    if (!file_) throw StorageError(fmt::format("{}: writing failed", path_.string()));
  }

 private:
  template <class T>
  void put(T value) {
    const auto* bytes = reinterpret_cast<const char*>(&value);
    text_.append(bytes, sizeof(T));
  }
  void flush() {
    file_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
    text_.clear();
  }

  fs::path path_;
  bool binary_;
  std::ofstream file_;
  std::string text_;
};

void write_entities(Sink& sink, const Section& section, const std::vector<LocalId>& numbers,
                    const std::vector<std::int32_t>* references) {
  const auto nodes = static_cast<std::size_t>(section.integers) - (references != nullptr ? 1U : 0U);
  const std::size_t n = numbers.size() / nodes;
  if (n == 0) return;
  sink.section(section.name, section.code, n, n * 4 * static_cast<std::size_t>(section.integers));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < nodes; ++k) sink.integer(numbers[i * nodes + k] + 1);
    if (references != nullptr) sink.integer((*references)[i]);
    sink.end_record();
  }
}

}  // namespace

MeditMesh read_medit(const fs::path& path) {
  const auto source = open_source(path);
  MeditMesh mesh;
  for (int code = source->next_section(); code != end_code; code = source->next_section()) {
    if (code == 3) {
      if (!mesh.coordinates.empty()) throw InputError(fmt::format("{}: Dimension comes after Vertices", path.string()));
      set_dimension(*source, path, mesh.dimension);
    } else if (code != 0 && code != solution_code) {
      read_section(*source, code, path, mesh);
    }
  }
  check_nodes(path, mesh.tetrahedra, mesh.nodes(), "a tetrahedron");
  check_nodes(path, mesh.triangles, mesh.nodes(), "a triangle");
  check_nodes(path, mesh.edges, mesh.nodes(), "an edge");
  check_nodes(path, mesh.corners, mesh.nodes(), "a corner");
  check_nodes(path, mesh.ridges, static_cast<LocalId>(mesh.edge_reference.size()), "a ridge");
  if (mesh.coordinates.empty()) throw InputError(fmt::format("{}: no vertices", path.string()));
  if (mesh.dimension == 2 && !mesh.tetrahedra.empty())
    throw InputError(fmt::format("{}: tetrahedra in a file of Dimension 2", path.string()));
  return mesh;
}

MeditSolution read_medit_solution(const fs::path& path) {
  const auto source = open_source(path);
  MeditSolution solution;
  solution.components = 0;
  for (int code = source->next_section(); code != end_code; code = source->next_section()) {
    if (code == 3) {
      if (solution.components != 0)
        throw InputError(fmt::format("{}: Dimension comes after SolAtVertices", path.string()));
      set_dimension(*source, path, solution.dimension);
    }
    if (code != solution_code) continue;
    const std::size_t n = checked_count(*source, path);
    const int fields = small_integer(*source);
    const int kind = fields == 1 ? small_integer(*source) : 0;
    if (kind != 1 && kind != 3)
      throw InputError(fmt::format("{}: one scalar or one symmetric tensor per node is expected", path.string()));
    solution.components = kind == 1 ? 1 : solution.dimension * (solution.dimension + 1) / 2;
    solution.values.resize(n * static_cast<std::size_t>(solution.components));
    for (Real& value : solution.values) value = finite_number(*source, path);
  }
  if (solution.components == 0) throw InputError(fmt::format("{}: no section SolAtVertices", path.string()));
  return solution;
}

void write_medit(const fs::path& path, const MeditMesh& mesh) {
  Sink sink(path, mesh.dimension);
  const auto d = static_cast<std::size_t>(mesh.dimension);
  const auto n = static_cast<std::size_t>(mesh.nodes());
  sink.section("Vertices", vertices_code, n, n * (8 * d + 4));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < d; ++k) sink.real(mesh.coordinates[i * d + k]);
    sink.integer(mesh.node_reference.empty() ? 0 : mesh.node_reference[i]);
    sink.end_record();
  }
  write_entities(sink, sections[1], mesh.edges, &mesh.edge_reference);
  write_entities(sink, sections[2], mesh.triangles, &mesh.triangle_reference);
  write_entities(sink, sections[3], mesh.tetrahedra, &mesh.tetrahedron_reference);
  write_entities(sink, sections[4], mesh.corners, nullptr);
  write_entities(sink, sections[5], mesh.ridges, nullptr);
  sink.finish();
}

void write_medit_solution(const fs::path& path, const MeditSolution& solution) {
  Sink sink(path, solution.dimension);
  const auto components = static_cast<std::size_t>(solution.components);
  const std::size_t n = solution.values.size() / components;
  sink.section("SolAtVertices", solution_code, n, 8 + 8 * solution.values.size());
  sink.integer(1);
  sink.integer(components == 1 ? 1 : 3);
  sink.end_record();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < components; ++k) sink.real(solution.values[i * components + k]);
    sink.end_record();
  }
  sink.finish();
}

}  // namespace malleus
