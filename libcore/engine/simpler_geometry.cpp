#include "engine/simpler_geometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/index.hpp"
#include "engine/boundary_shape.hpp"

namespace malleus {
namespace {

constexpr Real moment_tolerance = 3e-4;  ///< of area and half the largest extent
constexpr Real scalar_tolerance = 1e-3;  ///< of half the largest extent
constexpr Real turn_tolerance = 0.12;    ///< rms of the normals' tangential part: a regular polygon of 16 sides has .11
constexpr Real flat = 1e-6;
constexpr Real rounding = 1e-9;
constexpr std::size_t odd_moments = 7;
constexpr std::size_t turn_moments = 7;
constexpr int sampled_places = 48;

/// Those that vanish where a boundary is its own mirror image about u = 0.
std::array<Real, odd_moments> odd_in(Real u, Real v, Real w) {
  return {u, u * v, u * w, u * v * w, u * u * u, u * v * v, u * w * w};
}

/// Sums over the boundary, and what planes of symmetry tell.
struct BoundarySums {
  std::vector<Real> odd;                                     ///< [class][axis][moment]
  std::vector<Real> areas;                                   ///< [class]
  std::array<bool, 3> is_prism = {true, true, true};         ///< [axis]
  std::array<std::array<bool, 2>, 3> is_symmetric_end = {};  ///< [axis][low, high] a plane of symmetry is there

  explicit BoundarySums(std::size_t classes) : odd(classes * 3 * odd_moments, 0), areas(classes, 0) {}

  std::size_t classes() const { return areas.size(); }
  void add(const ClassedFacet& classed, const BoundingFrame& frame);
};

void BoundarySums::add(const ClassedFacet& classed, const BoundingFrame& frame) {
  areas[classed.kind] += classed.facet.area;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Real* sums = odd.data() + (classed.kind * 3 + axis) * odd_moments;
    for (const auto& [at, weight] : classed.facet.points) {
      const auto odds = odd_in(at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]);
      for (std::size_t i = 0; i < odd_moments; ++i) sums[i] += weight * odds[i];
    }
    const Real along = std::abs(classed.facet.normal[axis]);
    const Real place = classed.facet.points[0].first[axis];
    const bool is_end =
        classed.is_symmetry && along > 1 - flat && std::abs(std::abs(place) - frame.half[axis] / frame.length) < flat;
    if (is_end) is_symmetric_end[axis][place > 0 ? 1 : 0] = true;
    is_prism[axis] = is_prism[axis] && (is_end || (!classed.is_symmetry && along < flat));
  }
}

BoundarySums sums_of_boundary(const Communicator& comm, const Mesh& mesh, const SceneParts& parts,
                              const BoundingFrame& frame) {
  BoundarySums sums(classes_of(mesh, parts));
  for_each_boundary_facet(mesh, parts, frame, [&](const ClassedFacet& classed) { sums.add(classed, frame); });
  comm.sum_in_place(sums.odd);
  comm.sum_in_place(sums.areas);
  for (bool& is_prism : sums.is_prism) is_prism = comm.all(is_prism);
  for (auto& ends : sums.is_symmetric_end) {
    for (bool& is_symmetric : ends) is_symmetric = comm.any(is_symmetric);
  }
  return sums;
}

/// The van der Corput sequence in a base: places spread evenly, always the same ones.
Real spread(int number, int base) {
  Real value = 0;
  Real digit = 1;
  for (int rest = number; rest > 0; rest /= base) {
    digit /= base;
    value += digit * (rest % base);
  }
  return value;
}

std::vector<Position> places_around(const BoundingFrame& frame, int dim) {
  std::vector<Position> places;
  const std::array<int, 3> bases = {2, 3, 5};
  for (int i = 1; i <= sampled_places; ++i) {
    Position place = frame.middle;
    for (int c = 0; c < dim; ++c) {
      place[index(c)] += 1.2 * frame.half[index(c)] * (2 * spread(i, bases[index(c)]) - 1);
    }
    places.push_back(place);
  }
  return places;
}

bool are_alike(const SceneParts& parts, const BoundingFrame& frame, int dim,
               const std::function<Position(const Position&)>& moved) {
  const auto is_alike = [&](const SceneParts::ScalarOfPlace& scalar, const Position& place) {
    const Real here = scalar(place);
    const Real there = scalar(moved(place));
    return std::isfinite(here) && std::isfinite(there) && std::abs(here - there) <= scalar_tolerance * frame.length;
  };
  for (const Position& place : places_around(frame, dim)) {
    for (const auto& scalar : parts.scalars) {
      if (!is_alike(scalar, place)) return false;
    }
  }
  return true;
}

bool is_mirrored(const SceneParts& parts, const BoundarySums& sums, const BoundingFrame& frame, int dim,
                 std::size_t axis) {
  for (const auto& vector : parts.vectors) {
    if (vector[axis] != 0) return false;
  }
  for (std::size_t kind = 0; kind < sums.classes(); ++kind) {
    for (std::size_t i = 0; i < odd_moments; ++i) {
      const Real moment = sums.odd[(kind * 3 + axis) * odd_moments + i];
      if (std::abs(moment) > moment_tolerance * sums.areas[kind]) return false;
    }
  }
  return are_alike(parts, frame, dim, [&](Position place) {
    place[axis] = 2 * frame.middle[axis] - place[axis];
    return place;
  });
}

/// Of a facet at v, w from a line: first and second moments, the turn of the normal about the line, the area.
void add_turn(const ClassedFacet& classed, const Position& line, std::size_t axis, Real* sums) {
  const std::size_t b = (axis + 1) % 3;
  const std::size_t c = (axis + 2) % 3;
  for (const auto& [at, weight] : classed.facet.points) {
    const Real v = at[b] - line[b];
    const Real w = at[c] - line[c];
    sums[0] += weight * v;
    sums[1] += weight * w;
    sums[2] += weight * v * w;
    sums[3] += weight * v * v;
    sums[4] += weight * w * w;
    const Real radius = std::hypot(v, w);
    const Real turn = classed.facet.normal[c] * v - classed.facet.normal[b] * w;
    if (radius > flat) sums[5] += weight * std::pow(turn / radius, 2);
    sums[6] += weight;
  }
}

/// All around a line as on it: no first moments, equal second ones; of a quarter equal ones in both directions.
bool is_even(const Real* moments, bool is_quarter) {
  const Real most = moment_tolerance * moments[6];
  const bool is_centred =
      is_quarter ? std::abs(moments[0] - moments[1]) <= most
                 : std::abs(moments[0]) <= most && std::abs(moments[1]) <= most && std::abs(moments[2]) <= most;
  return is_centred && std::abs(moments[3] - moments[4]) <= most;
}

/// line: in the units of the frame. Collective.
bool is_surface_of_revolution(const Communicator& comm, const Mesh& mesh, const SceneParts& parts,
                              const BoundingFrame& frame, const Position& line, std::size_t axis, bool is_quarter) {
  const std::size_t classes = classes_of(mesh, parts);
  std::vector<Real> moments(classes * turn_moments, 0);
  for_each_boundary_facet(mesh, parts, frame, [&](const ClassedFacet& classed) {
    const bool is_meridian = is_quarter && classed.is_symmetry && std::abs(classed.facet.normal[axis]) < flat;
    if (!is_meridian) add_turn(classed, line, axis, moments.data() + classed.kind * turn_moments);
  });
  comm.sum_in_place(moments);
  for (std::size_t kind = 0; kind < classes; ++kind) {
    const Real* of_kind = moments.data() + kind * turn_moments;
    if (!is_even(of_kind, is_quarter) || of_kind[5] > turn_tolerance * turn_tolerance * of_kind[6]) return false;
  }
  return true;
}

/// Whether vectors and scalars do not change with the angle about a line.
bool are_revolved(const SceneParts& parts, const BoundingFrame& frame, const AxisLine& line) {
  const std::size_t b = (line.axis + 1) % 3;
  const std::size_t c = (line.axis + 2) % 3;
  for (const auto& vector : parts.vectors) {
    if (vector[b] != 0 || vector[c] != 0) return false;
  }
  return std::ranges::all_of(std::array<Real, 2>{1.0, 2.3}, [&](Real angle) {
    return are_alike(parts, frame, 3, [&](Position place) {
      const Real v = place[b] - line.through[b];
      const Real w = place[c] - line.through[c];
      place[b] = line.through[b] + std::cos(angle) * v - std::sin(angle) * w;
      place[c] = line.through[c] + std::sin(angle) * v + std::cos(angle) * w;
      return place;
    });
  });
}

/// Lines along an axis in the units of the frame: the middle one, then those where two planes of symmetry meet.
std::vector<Position> possible_lines(const BoundarySums& sums, const BoundingFrame& frame, std::size_t axis) {
  const std::size_t b = (axis + 1) % 3;
  const std::size_t c = (axis + 2) % 3;
  std::vector<Position> lines = {Position{}};
  for (const std::size_t at_b : {0U, 1U}) {
    for (const std::size_t at_c : {0U, 1U}) {
      if (!sums.is_symmetric_end[b][at_b] || !sums.is_symmetric_end[c][at_c]) continue;
      Position line = {};
      line[b] = (at_b == 1 ? 1 : -1) * frame.half[b] / frame.length;
      line[c] = (at_c == 1 ? 1 : -1) * frame.half[c] / frame.length;
      lines.push_back(line);
    }
  }
  return lines;
}

std::vector<AxisLine> find_revolutions(const Communicator& comm, const Mesh& mesh, const SceneParts& parts,
                                       const BoundarySums& sums, const BoundingFrame& frame) {
  std::vector<AxisLine> found;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    bool is_quarter = false;  // all lines after the first are edges of a quarter
    for (const Position& line : possible_lines(sums, frame, axis)) {
      AxisLine about = {axis, frame.middle};
      for (std::size_t c = 0; c < 3; ++c) {
        about.through[c] += line[c] * frame.length;
        if (std::abs(about.through[c]) < rounding * frame.length) about.through[c] = 0;
      }
      if (is_surface_of_revolution(comm, mesh, parts, frame, line, axis, is_quarter) &&
          are_revolved(parts, frame, about)) {
        found.push_back(about);
      }
      is_quarter = true;
    }
  }
  return found;
}

bool is_extruded(const SceneParts& parts, const BoundarySums& sums, const BoundingFrame& frame, std::size_t axis) {
  if (!sums.is_prism[axis]) return false;
  for (const auto& vector : parts.vectors) {
    if (vector[axis] != 0) return false;
  }
  return are_alike(parts, frame, 3, [&](Position place) {
    place[axis] += 0.7 * frame.half[axis];
    return place;
  });
}

constexpr std::array<const char*, 3> axis_names = {"x", "y", "z"};

}  // namespace

SimplerGeometry find_simpler_geometry(const Communicator& comm, const Mesh& mesh, Geometry geometry,
                                      const SceneParts& parts) {
  const BoundingFrame frame = bounding_frame(comm, mesh);
  const BoundarySums sums = sums_of_boundary(comm, mesh, parts, frame);
  SimplerGeometry found;
  for (std::size_t c = 0; c < 3; ++c) {
    found.middle[c] = std::abs(frame.middle[c]) < rounding * frame.length ? 0 : frame.middle[c];
  }
  for (std::size_t axis = 0; axis < index(mesh.dim); ++axis) {
    const bool is_radius = geometry == Geometry::axisymmetric && axis == 0;
    found.is_mirrored[axis] = !is_radius && is_mirrored(parts, sums, frame, mesh.dim, axis);
    if (mesh.dim < 3) continue;
    found.is_extruded[axis] = is_extruded(parts, sums, frame, axis);
  }
  if (mesh.dim == 3) found.revolutions = find_revolutions(comm, mesh, parts, sums, frame);
  return found;
}

std::vector<std::string> SimplerGeometry::suggestions(const std::string& symmetry_section) const {
  std::vector<std::string> lines;
  for (const AxisLine& line : revolutions) {
    const std::size_t b = (line.axis + 1) % 3;
    const std::size_t c = (line.axis + 2) % 3;
    lines.push_back(
        fmt::format("the third dimension: all is of revolution along {} about {} = {:.4g} m, {} = {:.4g} m; a section "
                    "from there outward as a 2D mesh, [case] geometry = axisymmetric",
                    axis_names[line.axis], axis_names[b], line.through[b], axis_names[c], line.through[c]));
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (is_extruded[axis]) {
      lines.push_back(
          fmt::format("the third dimension: nothing changes along {} between planes of symmetry; a section "
                      "as a 2D mesh",
                      axis_names[axis]));
    }
    const bool has_better =
        is_extruded[axis] || std::ranges::any_of(revolutions, [&](const AxisLine& line) { return line.axis != axis; });
    if (is_mirrored[axis] && !has_better) {
      lines.push_back(
          fmt::format("half of the scene: it is its own mirror image about {} = {:.4g} m; the other half, "
                      "and {} on the cut",
                      axis_names[axis], middle[axis], symmetry_section));
    }
  }
  return lines;
}

}  // namespace malleus
