/// Texts made from the description: help, the starter case, the documentation page.

#include "case/help.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "base/text.hpp"
#include "sample_case.hpp"
#include "support/scratch_directory.hpp"

namespace malleus::test {
namespace {

CaseReader documented() {
  CaseReader reader;
  SampleCase sample;
  sample.describe(reader);
  return reader;
}

bool holds(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

/// The template with every default and every section in force.
std::string with_all_lines_in_force(const std::string& text) {
  std::string result;
  std::string_view rest = text;
  while (!rest.empty()) {
    std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(line.size() + 1, rest.size()));
    const bool is_setting = line.starts_with(';') && !line.starts_with("; ") && !line.ends_with("= ");
    if (is_setting) line.remove_prefix(1);
    result += std::string(line) + "\n";
  }
  return result;
}

void expect_readable(const std::string& text) {
  const ScratchDirectory scratch;
  if (world().is_root()) std::ofstream(scratch.path() / "part.msh") << "mesh";
  world().barrier();
  SampleCase sample;
  try {
    read_sample(sample, text, {}, scratch.path() / "case.ini");
  } catch (const InputError& error) {
    FAIL() << error.what() << "\n" << text;
  }
  ASSERT_EQ(sample.bodies.size(), 1U);
  EXPECT_EQ(sample.bodies[0].consistency, 179.2e6);
}

TEST(Help, NamesEverySectionAndKey) {
  const std::string text = help_text(documented());
  for (const std::string_view part :
       {"[time]: when", "[gravity] (optional): weight", "[body.NAME] (repeated, at least 1): a body",
        "tolerance            number in (0, inf); default: 0.001 / 0.0001 / 1e-06 / 1e-08 (by level)",
        "group                text; required", "consistency          number, Pa.s^m in (0, inf); default: none",
        "every                whole number in [1, inf), or auto; default: auto", "norton-hoff | newtonian | rigid"}) {
    EXPECT_TRUE(holds(text, part)) << part << "\n" << text;
  }
}

TEST(Help, ShowsOneSection) {
  const std::string text = help_text(documented(), "body");
  EXPECT_TRUE(holds(text, "[body.NAME]"));
  EXPECT_FALSE(holds(text, "[time]"));
  EXPECT_EQ(help_text(documented(), "body.billet"), text);
  try {
    help_text(documented(), "bodi");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "--help-case: unknown section 'bodi'; did you mean 'body'?");
  }
}

TEST(Help, TheTemplateIsACase) {
  expect_readable(template_text(documented(), "sample"));
}

TEST(Help, TheTemplateIsACaseWithAllItsDefaultsInForce) {
  const std::string text = with_all_lines_in_force(template_text(documented(), "sample"));
  EXPECT_TRUE(holds(text, "\n[gravity]\n"));
  EXPECT_TRUE(holds(text, "\nstep = 1 s\n"));
  expect_readable(text);
}

TEST(Help, ThePageHasARowForEachKey) {
  const CaseReader reader = documented();
  const std::string page = markdown_page(reader, "sample");
  std::size_t n_keys = 0;
  for (const SectionDescription& description : reader.descriptions()) {
    EXPECT_TRUE(holds(page, "## [" + description.title() + "]"));
    for (const Key& key : description.keys) EXPECT_TRUE(holds(page, "| `" + key.name + "` | "));
    n_keys += description.keys.size();
  }
  EXPECT_EQ(n_keys, 26U);
  EXPECT_TRUE(holds(page, "norton-hoff \\| newtonian \\| rigid"));
}

}  // namespace
}  // namespace malleus::test
