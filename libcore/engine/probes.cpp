#include "engine/probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>

#include "base/error.hpp"
#include "base/log.hpp"
#include "engine/history.hpp"
#include "field/point_locator.hpp"
#include "parallel/agreement.hpp"
#include "storage/atomic_file.hpp"

namespace malleus {
namespace {

/// One line "x,y,z" of a file of points; nothing for a header or an empty line.
std::vector<Real> parse_point(const std::string& line, const std::filesystem::path& file, int number, int dim) {
  std::vector<Real> point;
  const char* at = line.data();
  const char* end = at + line.size();
  while (at < end) {
    while (at < end && (*at == ',' || *at == ' ' || *at == '\t' || *at == '\r')) ++at;
    if (at == end) break;
    Real value = 0;
    const auto parsed = std::from_chars(at, end, value);
    if (parsed.ec != std::errc() || !std::isfinite(value)) {
      if (number == 1) return {};
      throw InputError(
          fmt::format("{}:{}: expected {} numbers separated by commas, found '{}'", file.string(), number, dim, line));
    }
    point.push_back(value);
    at = parsed.ptr;
  }
  if (point.empty()) return {};
  if (static_cast<int>(point.size()) < dim) {
    throw InputError(fmt::format("{}:{}: a point has {} coordinates here", file.string(), number, dim));
  }
  point.resize(static_cast<std::size_t>(dim));
  return point;
}

std::vector<Real> read_points(const std::filesystem::path& file, int dim) {
  std::ifstream stream(file);
  if (!stream) throw InputError(fmt::format("{}: cannot be opened: {}", file.string(), std::strerror(errno)));
  std::vector<Real> points;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::vector<Real> point = parse_point(line, file, number, dim);
    points.insert(points.end(), point.begin(), point.end());
  }
  if (points.empty()) throw InputError(fmt::format("{}: holds no points", file.string()));
  return points;
}

std::vector<Real> points_of(const Communicator& comm, const ProbeSettings& settings, int dim) {
  if (settings.point) return {settings.point->begin(), settings.point->begin() + dim};
  std::vector<Real> points;
  on_root(comm, [&] { points = read_points(settings.file, dim); });
  auto count = static_cast<GlobalId>(points.size());
  comm.broadcast(std::span(&count, 1));
  points.resize(static_cast<std::size_t>(count));
  comm.broadcast(std::span(points));
  return points;
}

void add_columns(const FieldSpec& spec, int dim, std::vector<std::string>& columns) {
  constexpr std::array<const char*, 3> axes = {"x", "y", "z"};
  for (int c = 0; c < spec.components; ++c) {
    if (spec.components == 1) {
      columns.push_back(spec.name);
    } else if (spec.components == dim) {
      columns.push_back(fmt::format("{}_{}", spec.name, axes[static_cast<std::size_t>(c)]));
    } else {
      columns.push_back(fmt::format("{}_{}", spec.name, c));
    }
  }
}

void append_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream stream(file, std::ios::app | std::ios::binary);
  stream << text << std::flush;
  if (!stream) throw StorageError(fmt::format("{}: cannot be written", file.string()));
}

/// The whole rows of a file, without its header, that were written until that time; empty where there is no file.
std::string rows_until(Real time, const std::filesystem::path& file) {
  std::string kept;
  if (!std::filesystem::exists(file)) return kept;
  const std::vector<std::string> lines = read_whole_lines(file);
  for (std::size_t i = 1; i < lines.size(); ++i) {
    Real row_time = 0;
    const auto parsed = std::from_chars(lines[i].data(), lines[i].data() + lines[i].size(), row_time);
    if (parsed.ec == std::errc() && row_time <= time * (1 + 1e-12)) kept += lines[i] + "\n";
  }
  return kept;
}

/// points: [point][dim]. Cells of points outside the mesh stay empty.
std::string rows_at(Real time, const std::vector<Real>& points, const PointValues& values, std::size_t dim) {
  const std::size_t count = values.found.size();
  const std::size_t width = count > 0 ? values.values.size() / count : 0;
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    text += fmt::format("{},{}", history_text(time), i);
    for (std::size_t c = 0; c < 3; ++c) text += "," + history_text(c < dim ? points[i * dim + c] : 0.0);
    for (std::size_t c = 0; c < width; ++c) {
      text += "," + (values.found[i] != 0 ? history_text(values.values[i * width + c]) : "");
    }
    text += "\n";
  }
  return text;
}

}  // namespace

Probes::Probes(const Communicator& comm, const Mesh& mesh, const std::vector<ProbeSettings>& settings)
    : comm_(comm), dim_(mesh.dim) {
  for (const ProbeSettings& probe : settings) probes_.push_back({probe, points_of(comm, probe, dim_)});
}

bool Probes::any_moves() const {
  return std::any_of(probes_.begin(), probes_.end(),
                     [](const Probe& probe) { return probe.settings.motion == ProbeMotion::with_material; });
}

std::vector<const Field*> Probes::fields_of(const Probe& probe, const FieldStore& fields) const {
  if (probe.settings.fields.empty()) return fields.all();
  std::vector<const Field*> chosen;
  for (const std::string& name : probe.settings.fields) {
    if (fields.has(name)) chosen.push_back(&fields[name]);
  }
  return chosen;
}

std::filesystem::path Probes::file_of(const Probe& probe) const {
  return directory_ / fmt::format("probe-{}.csv", probe.settings.name);
}

std::string Probes::header(const Probe& probe, const FieldStore& fields) const {
  std::vector<std::string> columns = {"time_s", "point", "x", "y", "z"};
  for (const Field* field : fields_of(probe, fields)) add_columns(field->spec(), dim_, columns);
  return fmt::format("{}\n", fmt::join(columns, ","));
}

void Probes::start_anew(const std::filesystem::path& directory, const FieldStore& fields) {
  directory_ = directory;
  on_root(comm_, [&] {
    for (const Probe& probe : probes_) write_file_atomically(file_of(probe), header(probe, fields));
  });
}

void Probes::resume(const std::filesystem::path& directory, const FieldStore& fields, Real time) {
  directory_ = directory;
  on_root(comm_, [&] {
    for (const Probe& probe : probes_) {
      write_file_atomically(file_of(probe), header(probe, fields) + rows_until(time, file_of(probe)));
    }
  });
}

/// Once for each probe: its cells stay empty.
void Probes::warn_of_points_outside(const Probe& probe, const std::vector<char>& found) {
  const auto outside = std::count(found.begin(), found.end(), 0);
  if (outside == 0 || !warned_of_.insert(probe.settings.name).second) return;
  log::warning("[probe.{}]: outside the mesh: {} of {} points; their cells are left empty", probe.settings.name,
               outside, found.size());
}

void Probes::record(Real time, const Mesh& mesh, const FieldStore& fields) {
  for (const Probe& probe : probes_) {
    const std::vector<const Field*> chosen = fields_of(probe, fields);
    const PointValues values = values_at_points(comm_, mesh, chosen, probe.points);
    warn_of_points_outside(probe, values.found);
    on_root(comm_,
            [&] { append_text(file_of(probe), rows_at(time, probe.points, values, static_cast<std::size_t>(dim_))); });
  }
}

void Probes::move(Real dt, const Mesh& mesh, const FieldStore& fields) {
  for (Probe& probe : probes_) {
    if (probe.settings.motion != ProbeMotion::with_material) continue;
    const std::vector<const Field*> velocity = {&fields["velocity"]};
    std::vector<Real> middle = probe.points;
    const PointValues first = values_at_points(comm_, mesh, velocity, probe.points);
    for (std::size_t i = 0; i < middle.size(); ++i) middle[i] += 0.5 * dt * first.values[i];
    const PointValues second = values_at_points(comm_, mesh, velocity, middle);
    for (std::size_t i = 0; i < middle.size(); ++i) {
      const bool is_inside = second.found[i / static_cast<std::size_t>(dim_)] != 0;
      probe.points[i] += dt * (is_inside ? second.values[i] : first.values[i]);
    }
  }
}

std::vector<std::vector<Real>> Probes::places() const {
  std::vector<std::vector<Real>> all;
  for (const Probe& probe : probes_) all.push_back(probe.points);
  return all;
}

void Probes::set_places(const std::vector<std::vector<Real>>& places) {
  check(places.size() == probes_.size(), "each probe has its places");
  for (std::size_t i = 0; i < places.size(); ++i) probes_[i].points = places[i];
}

Outcome TracerMotion::advance(const Increment& increment) {
  before_ = probes_.places();
  probes_.move(increment.dt, mesh_, fields_);
  return Outcome::done();
}

}  // namespace malleus
