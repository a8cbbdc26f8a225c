/// The text of a case: sections, comments, quotes, overrides, and broken files.

#include "case/case_file.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "base/error.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

std::string value_of(const CaseFile& file, std::string_view kind, std::string_view key, std::string_view name = "") {
  const CaseEntry* entry = file.find_entry(kind, name, key);
  return entry == nullptr ? "(absent)" : entry->value;
}

std::vector<std::string> lines_of(const CaseFile& file) {
  std::vector<std::string> lines;
  for (const Mistake& mistake : file.mistakes().list()) lines.push_back(mistake.place.text() + ": " + mistake.message);
  return lines;
}

TEST(CaseFile, ReadsSectionsCommentsAndQuotes) {
  const CaseFile file = CaseFile::parse(
      "\xEF\xBB\xBF; first\r\n"
      "  # second\r\n"
      "[mesh]   ; trailing\r\n"
      "file = part;1#2.msh   # a mark inside a word starts no comment\r\n"
      "  title=\"a ; b # c\" ; but this does\r\n"
      "words = a \"b ; c\" d;e\r\n"
      "empty_quotes = \"\"\r\n"
      "[ body.billet ]\n"
      "x=1\n"
      "equation = \"a = b\"",
      "test.ini");
  EXPECT_TRUE(file.mistakes().empty());
  EXPECT_EQ(value_of(file, "mesh", "file"), "part;1#2.msh");
  EXPECT_EQ(value_of(file, "mesh", "title"), "\"a ; b # c\"");
  EXPECT_EQ(value_of(file, "mesh", "words"), "a \"b ; c\" d;e");
  EXPECT_EQ(value_of(file, "body", "x", "billet"), "1");
  EXPECT_EQ(value_of(file, "body", "equation", "billet"), "\"a = b\"");
  EXPECT_EQ(file.find_entry("body", "billet", "x")->place.text(), "test.ini:9");
  EXPECT_EQ(file.find("body", "billet")->place.line, 8);
  EXPECT_EQ(file.find("body"), nullptr);
}

TEST(CaseFile, TakesQuotesOffWholeValuesOnly) {
  EXPECT_EQ(without_quotes("\"a b\""), "a b");
  EXPECT_EQ(without_quotes("\"a\" \"b\""), "\"a\" \"b\"");
  EXPECT_EQ(without_quotes("\""), "\"");
  EXPECT_EQ(without_quotes("\"\""), "");
  EXPECT_EQ(without_quotes(""), "");
}

TEST(CaseFile, CollectsEveryMistake) {
  const CaseFile file = CaseFile::parse(
      "stray = 1\n"
      "[time\n"
      "end = 3\n"
      "end = 4\n"
      "just words\n"
      "= 5\n"
      "two words = 5\n"
      "nothing =\n"
      "open = \"quote\n"
      "[time]\n"
      "[body.]\n"
      "[body.a b]\n"
      "[]\n"
      "[mesh] file = x\n",
      "test.ini");
  const std::string no_section =
      "is no section; expected [section] or [section.NAME] with letters, digits, '_' and '-'";
  const std::vector<std::string> expected = {"test.ini:1: key 'stray' stands before the first [section]",
                                             "test.ini:2: '[time': the closing ']' is missing",
                                             "test.ini:4: [time] end is given twice, first at test.ini:3",
                                             "test.ini:5: expected 'key = value' or '[section]', found 'just words'",
                                             "test.ini:6: expected 'key = value' or '[section]', found '= 5'",
                                             "test.ini:7: expected 'key = value' or '[section]', found 'two words = 5'",
                                             "test.ini:8: [time] nothing has no value",
                                             "test.ini:9: [time] open has an unclosed quote",
                                             "test.ini:10: section [time] is given twice, first at test.ini:2",
                                             "test.ini:11: '[body.]' " + no_section,
                                             "test.ini:12: '[body.a b]' " + no_section,
                                             "test.ini:13: '[]' " + no_section,
                                             "test.ini:14: '[mesh] file = x': unexpected text after ']'"};
  EXPECT_EQ(lines_of(file), expected);
}

TEST(CaseFile, OverridesWinAndCreate) {
  const CaseFile file =
      CaseFile::parse("[time]\nend = 3\n[body.a]\nx = 1\n", "test.ini",
                      {"time.end=4 s", "time.end = 5 s", "body.a.x=2", "body.b.x=3", "new.key=a;b", "new.note=a ; b"});
  EXPECT_TRUE(file.mistakes().empty());
  EXPECT_EQ(value_of(file, "time", "end"), "5 s");
  EXPECT_TRUE(file.find_entry("time", "", "end")->place.is_command_line());
  EXPECT_EQ(value_of(file, "body", "x", "a"), "2");
  EXPECT_EQ(value_of(file, "body", "x", "b"), "3");
  EXPECT_EQ(value_of(file, "new", "key"), "a;b");
  EXPECT_EQ(value_of(file, "new", "note"), "\"a ; b\"");
}

TEST(CaseFile, RefusesOverridesOfSectionsWithMisspeltNames) {
  const char* text = "[body.billet]\nx = 1\n[probe.point1]\nx = 1\n";
  const CaseFile misspelt = CaseFile::parse(text, "test.ini", {"body.bilet.x=2"});
  ASSERT_EQ(misspelt.mistakes().list().size(), 1U);
  EXPECT_NE(misspelt.mistakes().list()[0].message.find("did you mean 'body.billet'?"), std::string::npos);
  EXPECT_TRUE(CaseFile::parse(text, "test.ini", {"probe.point2.x=2", "body.die.x=3"}).mistakes().empty());
}

TEST(CaseFile, RefusesMalformedOverrides) {
  const CaseFile file = CaseFile::parse("[time]\nend = 3\n", "test.ini",
                                        {"", "time", "end=3", "time.end", ".end=3", "time.=3", "a b.c=3",
                                         "time.end=", "time.end=\"x", "time.end=\"x\" ; y", "time.end=1\n[x]"});
  EXPECT_EQ(file.mistakes().list().size(), 11U);
  for (const Mistake& mistake : file.mistakes().list()) EXPECT_TRUE(mistake.place.is_command_line());
}

TEST(CaseFile, RefusesWhatIsNoText) {
  EXPECT_FALSE(CaseFile::parse(std::string_view("a\0b", 3), "test.ini").mistakes().empty());
  EXPECT_FALSE(CaseFile::parse("\xff\xfe[\x01", "test.ini").mistakes().empty());
  EXPECT_TRUE(CaseFile::parse("", "test.ini").mistakes().empty());
  EXPECT_TRUE(CaseFile::parse("\n\n\r\n", "test.ini").sections().empty());
}

TEST(CaseFile, AllRanksReadWhatTheRootRead) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "case.ini";
  if (test::world().is_root()) std::ofstream(path) << "[time]\nend = 3\n";
  const CaseFile file = CaseFile::read(test::world(), path);
  EXPECT_EQ(value_of(file, "time", "end"), "3");
  EXPECT_THROW(CaseFile::read(test::world(), scratch.path() / "absent.ini"), InputError);
  EXPECT_THROW(CaseFile::read(test::world(), scratch.path()), InputError);
}

}  // namespace
}  // namespace malleus
