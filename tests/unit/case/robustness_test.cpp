/// Damaged case files never crash, hang or trap: they are read, or refused with a message.

#include <gtest/gtest.h>

#include <random>

#include "base/units.hpp"
#include "case/help.hpp"
#include "sample_case.hpp"

namespace malleus::test {
namespace {

/// Uniform in [0, n); written out, so that every standard library gives the same sequence.
std::size_t draw(std::mt19937& random, std::size_t n) {
  return random() % n;
}

std::string starting_point() {
  CaseReader reader;
  SampleCase sample;
  sample.describe(reader);
  return std::string(good_case) + R"ini([gravity]
acceleration = 0 0 -9.81 m/s^2
force_x = "x < 0.5 ? sin(_pi*x)^2 : max(1, t)*exp(-x)"
strength = 3 kPa
[files]
title = "a ; b"
fields = velocity "two words"
)ini" + template_text(reader, "sample");
}

std::string damaged(std::string text, std::mt19937& random) {
  static constexpr std::string_view pieces[] = {
      "[",   "]", "=", "\"", ";",   "#",    "\n",   "\r",   "\t", ".",          "^",      "(",
      ")",   "/", "-", "1e", "nan", "free", "\xff", "\xc2", "\0", "9999999999", "[body.", "MPa",
      "s^m", "?", ":", "&&", "||",  "!",    ",",    "sin(", "x",  "\x01"};
  const std::size_t n_damages = 1 + draw(random, 8);
  for (std::size_t i = 0; i < n_damages && !text.empty(); ++i) {
    const std::size_t at = draw(random, text.size());
    switch (draw(random, 5)) {
      case 0:
        text[at] = static_cast<char>(draw(random, 256));
        break;
      case 1:
        text.erase(at, 1 + draw(random, 20));
        break;
      case 2:
        text.insert(at, pieces[draw(random, std::size(pieces))]);
        break;
      case 3:
        text.insert(at, text.substr(draw(random, text.size()), 1 + draw(random, 60)));
        break;
      default:
        text.resize(at);
        break;
    }
  }
  return text;
}

TEST(Robustness, DamagedCasesAreReadOrRefused) {
  std::mt19937 random(20240229);
  const std::string start = starting_point();
  int n_refused = 0;
  // Every rank parses the same text: more ranks add only the waiting for each other.
  const int n_trials = world().size() == 1 ? 1500 : 60;
  for (int trial = 0; trial < n_trials; ++trial) {
    const std::string text = damaged(start, random);
    try {
      SampleCase sample;
      CaseReader reader = read_sample(sample, text, {damaged("time.end=3 s", random)});
      const std::string resolved = reader.resolved("out");
      SampleCase again;
      EXPECT_NO_THROW(read_sample(again, resolved)) << text << "\n-----\n" << resolved;
    } catch (const InputError& error) {
      ++n_refused;
      ASSERT_GT(std::string_view(error.what()).size(), 10U);
    }
  }
  EXPECT_GT(n_refused, n_trials / 2);
}

TEST(Robustness, RandomValuesAreReadOrRefused) {
  std::mt19937 random(7);
  static constexpr std::string_view letters = "0123456789.eE+-*/^()<>=!&|?:,xyztpi_mskgPaN \"%";
  const Unit wanted = parse_unit("Pa.s^m");
  int n_read = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::string text;
    for (std::size_t i = 1 + draw(random, 14); i > 0; --i) text += letters[draw(random, letters.size())];
    try {
      parse_quantities(text, wanted);
      ++n_read;
    } catch (const InputError&) {
    }
    try {
      const Expression formula = Expression::parse(text);
      formula({0.1, -0.2, 0.3}, 1);
      ++n_read;
    } catch (const InputError&) {
    }
  }
  EXPECT_GT(n_read, 100);
}

}  // namespace
}  // namespace malleus::test
