#include "engine/command_line.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "base/error.hpp"
#include "base/text.hpp"
#include "parallel/session.hpp"
#include "storage/h5_file.hpp"

namespace malleus {
namespace {

struct OptionTexts {
  const char* after =
      "What follows -- goes to PETSc's options database (-- -ksp_view, say).\n"
      "Exit codes: 0 done, 2 wrong input, 3 the numerics failed, 4 the disk failed,\n"
      "85 stopped with a checkpoint (run again with --restart).";
};

CLI::Validator whole_number() {
  const auto check = [](const std::string& text) {
    const bool is_whole = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
    return is_whole ? std::string() : fmt::format("'{}' is no whole number of 0 or more", text);
  };
  return {check, "", "whole number"};
}

void add_options(CLI::App& app, CommandLine& line) {
  app.add_option("CASE.ini", line.case_file, "The case file");
  app.add_option("-o,--output", line.output, "Directory for all files (default: [output] directory, else ./out/NAME)")
      ->type_name("DIR");
  app.add_option("-D,--set", line.overrides, "Overrides one key of the case; repeatable; wins over the file")
      ->type_name("SECTION.KEY=VALUE")
      ->allow_extra_args(false);
  app.add_flag("--check", line.check, "Reads and validates all, prints the plan, runs nothing");
  app.add_flag("--restart", line.restart, "Goes on from the newest complete checkpoint of the output directory");
  app.add_option("--steps", line.steps, "Stops cleanly after N more increments")->type_name("N")->check(whole_number());
  app.add_option("--help-case", line.help_case, "Prints every section and key of a case, or those of one section")
      ->type_name("[SECTION]")
      ->expected(0, 1)
      ->default_str("");
  app.add_flag("--template", line.print_template, "Prints a commented starter case");
  app.add_flag("--case-page", line.print_case_page, "Prints --help-case as a page in Markdown");
  app.add_flag("--quiet", line.quiet, "Prints warnings and errors alone");
  app.add_flag("--verbose", line.verbose, "Prints details of the solvers too");
  app.set_help_flag("-h,--help", "Prints this");
}

/// "; did you mean '--output'?" for the first option that the program does not have.
std::string nearest_option(const CLI::App& app, const std::vector<std::string>& arguments) {
  std::vector<std::string> known;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  for (const std::string& argument : arguments) {
    const std::string name = argument.substr(0, argument.find('='));
    const bool is_unknown = name.starts_with("--") && std::find(known.begin(), known.end(), name) == known.end();
    if (is_unknown) return did_you_mean(name, known);
  }
  return {};
}

}  // namespace

std::string version_text(const std::string& program) {
  return fmt::format("{} {} ({}, {}, GCC {})", program, MALLEUS_VERSION, parallel_library_versions(), hdf5_version(),
                     __VERSION__);
}

CommandLine parse_command_line(const std::string& program, const std::string& description,
                               const std::vector<std::string>& arguments) {
  CommandLine line;
  CLI::App app(description, program);
  app.footer(OptionTexts().after);
  bool version = false;
  add_options(app, line);
  app.add_flag("--version", version, "Prints version and libraries");
  try {
    std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
    app.parse(reversed);
  } catch (const CLI::CallForHelp&) {
    line.answer = app.help();
    return line;
  } catch (const CLI::ParseError& error) {
    throw InputError(
        fmt::format("command line: {}{} (see {} --help)", error.what(), nearest_option(app, arguments), program));
  }
  if (version) line.answer = version_text(program);
  const bool needs_no_case = !line.answer.empty() || line.help_case || line.print_template || line.print_case_page;
  if (line.case_file.empty() && !needs_no_case) {
    throw InputError(
        fmt::format("command line: the case file is missing: {} [options] CASE.ini (see {} --help)", program, program));
  }
  return line;
}

}  // namespace malleus
