#pragma once

/// What a run will take, told by the run itself from its first increments.

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "engine/process.hpp"
#include "parallel/communicator.hpp"

namespace malleus {

/// Where a run stands after an increment. The same on all ranks but for the wall time.
struct Stand {
  GlobalId increment = 0;
  Real wall_s = 0;                           ///< since the start of the run
  std::array<Real, 3> progress = {0, 0, 0};  ///< 0..1 towards the end in time, in increments, of the process; 0: none
};

/// What is left from a stand on, as increments since an earlier one went: the end that comes first counts.
struct Rest {
  Real increments = 0;
  Real wall_s = 0;
};

/// None where no progress was made in between.
std::optional<Rest> rest_after(const Stand& earlier, const Stand& here);

/// Forecasts once, when a probe of some increments is done: those to come are taken to last as long and to lead as far
/// as the later half of the probe in the mean; the first ones find contacts and start without a flow.
class RunForecast {
 public:
  /// After each increment. still_to_come_s: of work known now that increments so far do not show. Whether the forecast
  /// was made now. Collective until it is made.
  bool see(const Communicator& comm, const Stand& here, Real still_to_come_s);

  const std::optional<Forecast>& made() const { return forecast_; }
  GlobalId made_after() const { return made_after_; }  ///< increments

  /// Of the run as it goes on; none before its second increment. Local.
  std::optional<Rest> rest(const Stand& here) const;

  /// @name For checkpoints: a forecast that is made; a leg that began before makes its own.
  /// @{
  nlohmann::json save() const;
  void restore(const nlohmann::json& saved);
  /// @}

 private:
  const Stand& middle() const { return probe_[probe_.size() / 2]; }

  std::vector<Stand> probe_;
  std::optional<Forecast> forecast_;
  GlobalId made_after_ = 0;
};

}  // namespace malleus
