#pragma once

/// Where the error of a run's main results (forces on tools, pressures at gates) comes from, and what to turn first.

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/types.hpp"

namespace malleus {

/// One source of error, with the knob that governs it.
struct ErrorShare {
  std::string source;  ///< "space", "time", "contact", "volume", "front", "frozen flow", "nonlinear", "linear"
  Real relative = 0;   ///< estimated error of the main results by this source alone, relative; >= 0
  std::string basis;   ///< how it was estimated: "two meshes: sizes h and 2 h"
  std::string knob;    ///< the key that moves it, empty where none does: "[remesh] size"
  Real factor = 0.5;   ///< what to multiply the knob's value with so that the share is halved; > 0
  Real cost = 1;       ///< how many times as long a run takes with the knob so turned; >= 1
};

/// The sources of a run. The same on all ranks. Local.
class ErrorBudget {
 public:
  /// Shares that are not finite are a Defect: a source that cannot be estimated is left out.
  void add(ErrorShare share);

  /// A source that should be known and is not: what is estimated is the least then. why: "no coarser mesh ...".
  void add_unknown(const std::string& source, const std::string& why) { unknown_.emplace_back(source, why); }

  bool empty() const noexcept { return shares_.empty(); }
  /// Sources that are not known.
  std::vector<std::string> unknown() const;
  /// From the largest to the smallest.
  const std::vector<ErrorShare>& shares() const noexcept { return shares_; }
  /// The root of the sum of squares: what sources that know nothing of each other leave together. 0 if there are none.
  Real total() const;
  /// A line of the total, one a source, and one that names the knob to turn first. Empty if there are no sources.
  std::vector<std::string> lines() const;
  /// [{source, relative, basis, knob, factor, cost}], from the largest to the smallest.
  nlohmann::json json() const;

 private:
  std::vector<ErrorShare> shares_;
  std::vector<std::pair<std::string, std::string>> unknown_;  ///< source, why
};

}  // namespace malleus
