#include "engine/error_budget.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace malleus {
namespace {

std::string advice(const ErrorShare& share) {
  return fmt::format("to halve the error by {}: {} times {:.3g}, which makes a run {:.2g} times as long", share.source,
                     share.knob, share.factor, share.cost);
}

}  // namespace

void ErrorBudget::add(ErrorShare share) {
  check(std::isfinite(share.relative) && share.relative >= 0, "a share of the error budget is not a finite size");
  const auto place = std::find_if(shares_.begin(), shares_.end(),
                                  [&](const ErrorShare& other) { return other.relative < share.relative; });
  shares_.insert(place, std::move(share));
}

Real ErrorBudget::total() const {
  Real squares = 0;
  for (const ErrorShare& share : shares_) squares += share.relative * share.relative;
  return std::sqrt(squares);
}

std::vector<std::string> ErrorBudget::lines() const {
  if (shares_.empty()) return {};
  const char* least = unknown_.empty() ? "" : "at least ";
  std::vector<std::string> lines = {fmt::format("estimated error {}{:.2g} %", least, 100 * total())};
  for (const auto& [source, why] : unknown_) lines.push_back(fmt::format("  {:<12}  unknown  {}", source, why));
  for (const ErrorShare& share : shares_) {
    lines.push_back(fmt::format("  {:<12} {:>8.2g} %  {}", share.source, 100 * share.relative, share.basis));
  }
  const auto first = std::find_if(shares_.begin(), shares_.end(), [](const ErrorShare& s) { return !s.knob.empty(); });
  if (first != shares_.end() && first->relative > 0) lines.push_back(advice(*first));
  return lines;
}

std::vector<std::string> ErrorBudget::unknown() const {
  std::vector<std::string> sources;
  for (const auto& [source, why] : unknown_) sources.push_back(source);
  return sources;
}

nlohmann::json ErrorBudget::json() const {
  nlohmann::json list = nlohmann::json::array();
  for (const ErrorShare& share : shares_) {
    list.push_back({{"source", share.source},
                    {"relative", share.relative},
                    {"basis", share.basis},
                    {"knob", share.knob},
                    {"factor", share.factor},
                    {"cost", share.cost}});
  }
  return list;
}

}  // namespace malleus
