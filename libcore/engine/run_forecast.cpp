#include "engine/run_forecast.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/resources.hpp"

namespace malleus {
namespace {

constexpr std::size_t fewest_increments = 6;
/// The probe ends with the first of them: wall time beyond its first increment, share of the run's increments.
constexpr Real longest_probe_s = 5;
constexpr Real largest_share = 0.1;

}  // namespace

std::optional<Rest> rest_after(const Stand& earlier, const Stand& here) {
  const auto done = static_cast<Real>(here.increment - earlier.increment);
  Real left = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < here.progress.size(); ++i) {
    const Real advance = here.progress[i] - earlier.progress[i];
    if (advance > 0) left = std::min(left, done * (1 - here.progress[i]) / advance);
  }
  if (!std::isfinite(left)) return std::nullopt;
  return Rest{left, left * (here.wall_s - earlier.wall_s) / done};
}

bool RunForecast::see(const Communicator& comm, const Stand& here, Real still_to_come_s) {
  if (forecast_) return false;
  probe_.push_back(here);
  if (probe_.size() < fewest_increments) return false;
  const auto rest = rest_after(middle(), here);
  if (!rest) return false;
  const auto done = static_cast<Real>(here.increment);
  const bool is_long = comm.broadcast(here.wall_s - probe_.front().wall_s >= longest_probe_s);
  if (!is_long && done < largest_share * (done + rest->increments)) return false;
  forecast_ = {comm.max(here.wall_s + rest->wall_s + still_to_come_s), static_cast<Real>(comm.sum(peak_memory_bytes())),
               here.increment + static_cast<GlobalId>(std::ceil(rest->increments - 1e-6))};
  made_after_ = here.increment;
  probe_ = {middle()};
  return true;
}

std::optional<Rest> RunForecast::rest(const Stand& here) const {
  if (probe_.empty() || middle().increment >= here.increment) return std::nullopt;
  return rest_after(middle(), here);
}

nlohmann::json RunForecast::save() const {
  if (!forecast_) return {};
  return {forecast_->wall_s, forecast_->memory_bytes, forecast_->increments, made_after_};
}

void RunForecast::restore(const nlohmann::json& saved) {
  if (saved.is_null()) return;
  forecast_ = {saved.at(0), saved.at(1), saved.at(2)};
  made_after_ = saved.at(3);
}

}  // namespace malleus
