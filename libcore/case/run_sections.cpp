#include "case/run_sections.hpp"

#include <fmt/format.h>

#include "base/error.hpp"
#include "base/units.hpp"

namespace malleus {
namespace {

Unit parse_length_unit(std::string_view text) {
  Unit unit = parse_unit(text);
  if (!(unit.dimension == parse_unit("m").dimension)) {
    throw InputError(fmt::format("'{}' is no length; expected a unit like mm", text));
  }
  return unit;
}

Converter<std::string> length_unit_converter() {
  const auto read = [](std::string_view raw, Key&) {
    parse_length_unit(without_quotes(raw));
    return std::string(without_quotes(raw));
  };
  return {"unit of length", "", read, [](const std::string& unit) { return unit; }};
}

/// A whole number counts increments; a number with a unit, or a clock, is wall time.
Converter<Interval> interval_converter() {
  const auto read = [](std::string_view raw, Key& key) {
    Interval interval;
    if (raw.find_first_not_of("0123456789") == std::string_view::npos) {
      interval.increments = count_converter().read(raw, key);
    } else {
      interval.seconds = duration_converter().read(raw, key);
    }
    const bool is_positive = interval.increments ? *interval.increments > 0 : *interval.seconds > 0;
    if (!is_positive) throw InputError("must be above zero");
    return interval;
  };
  const auto write = [](const Interval& interval) {
    return interval.increments ? fmt::format("{}", *interval.increments) : fmt::format("{} s", *interval.seconds);
  };
  return {"increments, or wall time with a unit", "", read, write};
}

}  // namespace

void CaseSettings::describe(Section& s) {
  s.string("name", name, "name of the output files").default_is("that of the case file");
  s.string("title", title, "a line for people");
  s.choice("geometry", geometry, {{"cartesian", CaseGeometry::cartesian}, {"axisymmetric", CaseGeometry::axisymmetric}},
           "a 2D mesh is plane strain, or is revolved about its y axis (x = r >= 0)");
}

void CaseSettings::validate(Section& s) const {
  const bool is_file_name = !name.empty() && name.find('/') == std::string::npos && name.front() != '.';
  if (s.given("name") && !is_file_name) s.fail("name", "must be usable as the name of a file");
}

void MeshSettings::describe(Section& s) {
  s.path("file", file, "the mesh: .msh, .mesh, .meshb or the project's .h5")
      .required()
      .existing_file()
      .starter("part.msh");
  s.custom("length_unit", length_unit, length_unit_converter(), "unit of the coordinates in the mesh file");
}

Real MeshSettings::length_scale() const {
  const Unit unit = parse_length_unit(length_unit);
  return unit.numerator / unit.denominator;
}

void TimeSettings::describe(Section& s) {
  s.real("end", end, "s", "time at which the run ends").above(0).starter("1 s");
  s.real("step", step, "s", "largest increment").above(0).default_is("as large as accuracy and contact allow");
  s.integer("increments", increments, "number of increments after which the run ends").at_least(0);
}

void AccuracySettings::describe(Section& s) {
  std::vector<std::pair<std::string, Level>> choices;
  for (int i = 0; i < n_levels; ++i) {
    choices.emplace_back(level_names[static_cast<std::size_t>(i)], static_cast<Level>(i));
  }
  s.choice("level", level, choices, "preset of every setting that has a default by level; one given by itself wins");
  s.flag("two_meshes", two_meshes,
         "solve the first increment and one half-way on coarser meshes too, to estimate the error of space");
  s.real("size_factor", size_factor, "", "the mesh is made anew before the run, with its sizes times this; 1: as it is")
      .at_least(0.1)
      .at_most(10);
  s.real("target_error", target_error, "",
         "relative error of forces or gate pressures to aim at: chooses size_factor and level by a trial on coarser "
         "meshes; "
         "those given by themselves stay")
      .above(0)
      .below(1);
  s.real("target_time", target_time, "s", "wall time to stay within; chooses likewise, and wins over target_error")
      .above(0);
}

void SolverSettings::describe(Section& s) {
  s.real("newton_tolerance", newton_tolerance, "", "relative nonlinear residual at which a step has converged")
      .above(0)
      .below(1)
      .by_level(1e-3, 1e-4, 1e-6, 1e-8);
  s.real("linear_tolerance", linear_tolerance, "", "true relative residual of the last linear solve of a step")
      .above(0)
      .below(1)
      .by_level(1e-4, 1e-6, 1e-8, 1e-10);
  s.integer("max_newton", max_newton, "Newton iterations before a step counts as not converged").at_least(1);
  s.real("cutoff_strain_rate", cutoff_strain_rate, "",
         "strain rate below which a power law is Newtonian, in units of speed over height of the scene")
      .above(0)
      .by_level(3e-2, 1e-2, 1e-3, 1e-4);
  s.choice("linear_method", linear_method,
           {{"block-triangular", LinearChoice::block_triangular},
            {"gmres-ilu", LinearChoice::gmres_ilu},
            {"conjugate-residual", LinearChoice::conjugate_residual}},
           "block-triangular FGMRES; the others are baselines for comparison");
}

void RemeshSettings::describe(Section& s) {
  s.flag("active", active, "no: keeps the section in the file but does not remesh");
  s.real("size", size, "m", "edge length").above(0).default_is("the input's local size");
  s.real("min_size", min_size, "m", "smallest edge length").above(0);
  s.real("max_size", max_size, "m", "largest edge length").above(0);
  s.count("nodes", nodes, "target count of nodes").at_least(4);
  s.real("error", error, "", "target of the estimated relative error").above(0).below(1);
  s.real("gradation", gradation, "", "largest ratio of the lengths of neighbouring edges").above(1);
  s.integer("every", every, "increments between two remeshings; auto: when quality or contact asks")
      .at_least(1)
      .or_word("auto");
  s.flag("anisotropic", anisotropic, "sizes by direction");
}

void RemeshSettings::validate(Section& s) const {
  if (min_size && max_size && !(*min_size <= *max_size)) s.fail("min_size", "must not exceed max_size");
  if (size && min_size && !(*min_size <= *size)) s.fail("min_size", "must not exceed size");
  if (size && max_size && !(*size <= *max_size)) s.fail("max_size", "must not be below size");
}

void OutputSettings::describe(Section& s) {
  s.path("directory", directory, "where everything is written; -o wins").default_is("./out/<case name>");
  s.integer("every", every, "increments between two outputs; the first and the last state are always written")
      .at_least(1);
  s.words("fields", fields, "names of the fields to write").default_is("all that the scene has");
  s.choice("precision", precision, {{"float32", Precision::float32}, {"float64", Precision::float64}},
           "of the fields; checkpoints are always float64");
}

void CheckpointSettings::describe(Section& s) {
  s.custom("every", every, interval_converter(), "between two checkpoints; the newest two are kept");
}

void LimitSettings::describe(Section& s) {
  s.duration("wall_time", wall_time, "after it a checkpoint is written and the run stops with exit code 85").above(0);
  s.real("memory", memory, "B", "sum over ranks that the run may use").above(0);
}

void PartitionSettings::describe(Section& s) {
  s.choice("method", method,
           {{"curve", PartitionMethod::curve}, {"scotch", PartitionMethod::scotch}, {"cost", PartitionMethod::cost}},
           "stretches of a space-filling curve, least computing plus communication time, or the same from a start by "
           "PT-Scotch");
  s.choice("balance", balance, {{"counted", Balance::counted}, {"measured", Balance::measured}},
           "work of elements and nodes counted, or shares by speeds measured in each increment (then the bytes of two "
           "runs differ)");
}

}  // namespace malleus
