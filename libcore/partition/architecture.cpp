#include "partition/architecture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>
#include <optional>
#include <sstream>

#include "base/error.hpp"
#include "base/text.hpp"
#include "case/case_file.hpp"
#include "parallel/agreement.hpp"

namespace malleus {
namespace {

[[noreturn]] void refuse(const CaseEntry& entry, const std::string& why) {
  throw InputError(fmt::format("{}: [architecture] {} = {}: {}", entry.place.text(), entry.key, entry.value, why));
}

std::vector<Real> read_numbers(const CaseEntry& entry, std::string_view text) {
  std::vector<Real> numbers;
  for (text = trim(text); !text.empty(); text = trim(text)) {
    const std::optional<Real> number = take_real(text);
    if (!number) refuse(entry, "numbers are wanted");
    numbers.push_back(*number);
  }
  return numbers;
}

Real read_positive(const CaseEntry& entry) {
  const std::vector<Real> numbers = read_numbers(entry, entry.value);
  if (numbers.size() != 1 || !(numbers[0] > 0)) refuse(entry, "one number > 0 is wanted");
  return numbers[0];
}

std::vector<Real> read_speeds(const CaseEntry& entry, int parts) {
  std::vector<Real> speeds = read_numbers(entry, entry.value);
  if (speeds.size() == 1) speeds.assign(static_cast<std::size_t>(parts), speeds[0]);
  if (speeds.size() != static_cast<std::size_t>(parts)) {
    refuse(entry, fmt::format("{} speeds for {} parts; give one a part, or one for all", speeds.size(), parts));
  }
  for (const Real speed : speeds) {
    if (!(speed > 0)) refuse(entry, "a processor's speed is > 0; leave out a processor that is to do nothing");
  }
  return speeds;
}

std::vector<int> read_clusters(const CaseEntry& entry, int parts) {
  const std::vector<Real> numbers = read_numbers(entry, entry.value);
  if (numbers.size() != static_cast<std::size_t>(parts)) {
    refuse(entry, fmt::format("{} clusters for {} parts; give one a part", numbers.size(), parts));
  }
  std::vector<int> clusters;
  for (const Real number : numbers) {
    if (number < 0 || number > parts || number != std::floor(number)) {
      refuse(entry, "a cluster is a whole number from 0 to the count of parts");
    }
    clusters.push_back(static_cast<int>(number));
  }
  return clusters;
}

/// The matrix of bandwidths, as links where it differs from the default of the first pair.
void read_matrix(const CaseEntry& entry, const std::filesystem::path& folder, Architecture& architecture) {
  const std::filesystem::path path = folder / std::string(without_quotes(entry.value));
  std::ifstream file(path);
  if (!file) refuse(entry, fmt::format("neither a number > 0 nor a file that can be read ({})", path.string()));
  std::ostringstream text;
  text << file.rdbuf();
  const std::vector<Real> matrix = read_numbers(entry, text.str());
  const int parts = architecture.parts();
  const auto n = static_cast<std::size_t>(parts);
  if (matrix.size() != n * n) {
    refuse(entry, fmt::format("the matrix holds {} numbers; {} x {} are wanted", matrix.size(), parts, parts));
  }
  if (parts > 1) architecture.bandwidth = matrix[1];
  for (int p = 0; p < parts; ++p) {
    for (int q = p + 1; q < parts; ++q) {
      const Real value = matrix[static_cast<std::size_t>(p) * n + static_cast<std::size_t>(q)];
      const Real other = matrix[static_cast<std::size_t>(q) * n + static_cast<std::size_t>(p)];
      if (!(value > 0)) refuse(entry, fmt::format("the bandwidth {}-{} is {}; it must be > 0", p, q, value));
      if (value != other) refuse(entry, fmt::format("the matrix is not symmetric at {}-{}", p, q));
      if (value != architecture.bandwidth) architecture.links[{p, q}] = value;
    }
  }
}

void read_link(const CaseEntry& entry, Architecture& architecture) {
  int p = -1;
  int q = -1;
  int read = 0;
  const bool is_pair = std::sscanf(entry.key.c_str(), "link.%d-%d%n", &p, &q, &read) == 2 &&
                       static_cast<std::size_t>(read) == entry.key.size();
  if (!is_pair || p < 0 || q < 0 || p == q || std::max(p, q) >= architecture.parts()) {
    refuse(entry, fmt::format("a link is named link.P-Q, two different parts from 0 to {}", architecture.parts() - 1));
  }
  architecture.links[std::minmax(p, q)] = read_positive(entry);
}

void refuse_strangers(const CaseFile& file) {
  const std::vector<std::string> known = {"speed", "bandwidth", "cluster", "cluster_bandwidth", "link.0-1"};
  for (const CaseSection& section : file.sections()) {
    if (section.title() != "architecture") {
      throw InputError(fmt::format("{}: unknown section [{}]; an architecture file holds [architecture]",
                                   section.place.text(), section.title()));
    }
    for (const CaseEntry& entry : section.entries) {
      if (entry.key.starts_with("link.")) continue;
      if (std::find(known.begin(), known.end(), entry.key) != known.end()) continue;
      throw InputError(fmt::format("{}: [architecture] has no key '{}'{}; its keys are {}", entry.place.text(),
                                   entry.key, did_you_mean(entry.key, known), join(known)));
    }
  }
}

Architecture parse(const CaseFile& file, int parts) {
  file.mistakes().throw_if_any(file.path());
  refuse_strangers(file);
  const CaseSection* section = file.find("architecture");
  if (section == nullptr) throw InputError(fmt::format("{}: holds no section [architecture]", file.path().string()));
  Architecture architecture = equal_architecture(parts);
  const auto entry = [&](std::string_view key) { return file.find_entry("architecture", "", key); };
  if (entry("speed") != nullptr) architecture.speed = read_speeds(*entry("speed"), parts);
  if (const CaseEntry* bandwidth = entry("bandwidth")) {
    std::string_view text = bandwidth->value;
    if (take_real(text) && trim(text).empty()) {
      architecture.bandwidth = read_positive(*bandwidth);
    } else {
      read_matrix(*bandwidth, file.path().parent_path(), architecture);
    }
  }
  if (entry("cluster") != nullptr) architecture.cluster = read_clusters(*entry("cluster"), parts);
  architecture.cluster_bandwidth = architecture.bandwidth;
  if (entry("cluster_bandwidth") != nullptr)
    architecture.cluster_bandwidth = read_positive(*entry("cluster_bandwidth"));
  for (const CaseEntry& given : section->entries) {
    if (given.key.starts_with("link.")) read_link(given, architecture);
  }
  return architecture;
}

}  // namespace

Real Architecture::total_speed() const {
  return std::accumulate(speed.begin(), speed.end(), Real{0});
}

Real Architecture::link(int p, int q) const {
  if (!links.empty()) {
    const auto found = links.find(std::minmax(p, q));
    if (found != links.end()) return found->second;
  }
  if (cluster.empty()) return bandwidth;
  const bool is_inner = cluster[static_cast<std::size_t>(p)] == cluster[static_cast<std::size_t>(q)];
  return is_inner ? bandwidth : cluster_bandwidth;
}

bool Architecture::has_equal_speeds() const {
  return std::all_of(speed.begin(), speed.end(), [&](Real s) { return s == speed.front(); });
}

bool Architecture::are_alike(int p, int q) const {
  if (p == q) return true;
  if (!links.empty() || speed[static_cast<std::size_t>(p)] != speed[static_cast<std::size_t>(q)]) return false;
  return cluster.empty() || cluster[static_cast<std::size_t>(p)] == cluster[static_cast<std::size_t>(q)];
}

Architecture equal_architecture(int parts) {
  check(parts > 0, "there is at least one part");
  Architecture architecture;
  architecture.speed.assign(static_cast<std::size_t>(parts), 1);
  return architecture;
}

Architecture read_architecture(const Communicator& comm, const std::filesystem::path& path, int parts) {
  const CaseFile file = CaseFile::read(comm, path);
  Architecture architecture;
  agree(comm, [&] { architecture = parse(file, parts); });
  return architecture;
}

}  // namespace malleus
