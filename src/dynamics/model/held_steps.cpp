#include "dynamics/model/held_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace espalier::dynamics::model {

void HeldSteps::step(const State& s) {
  constexpr double kFewest = 4, kMost = 400;  // steps of a period
  const double h = s.t - last_.t;
  if (!(h > 0) || s.a.empty() || last_.a.size() != s.a.size()) return begin(s);
  std::size_t most = 0;
  for (std::size_t i = 1; i < s.a.size(); ++i)
    if (std::abs(s.a[i] - last_.a[i]) > std::abs(s.a[most] - last_.a[most])) most = i;
  const double change = std::abs(s.a[most] - last_.a[most]),
               bent = std::abs(s.v[most] - last_.v[most] - 0.5 * h * (s.a[most] + last_.a[most]));
  const double frequency = change > 0 ? 12 * bent / (h * h * change) / (2 * std::numbers::pi) : 0;
  ++steps_;
  for (const double v : s.v) fastest_ = std::max(fastest_, std::abs(v));
  if (frequency * h * kMost > 1 && frequency * h * kFewest < 1) {
    ++held_;
    time_ += h;
    log_frequency_ += std::log(frequency);
    log_square_ += std::log(frequency) * std::log(frequency);
  }
  last_ = s;
}

std::optional<std::string> HeldSteps::notice() const {
  constexpr long kMany = 3000;
  constexpr double kPart = 0.7, kOne = 1.5, kPeriods = 200;
  if (held_ < kMany || static_cast<double>(held_) < kPart * static_cast<double>(steps_)) return std::nullopt;
  const auto count = static_cast<double>(held_);
  const double mean = log_frequency_ / count, spread = std::sqrt(std::max(0.0, log_square_ / count - mean * mean));
  const double frequency = std::exp(mean);
  if (spread > kOne || frequency * time_ < kPeriods) return std::nullopt;
  return fmt::format(
      "{} of {} steps follow a vibration of about {:.2g} per unit of time, with {:.0f} steps a period: where it does "
      "not matter, set [integrator] max_order = 2 and absolute_velocity = {:.1g} (what may be lost of speeds, which "
      "reach {:.2g}), or give it damping",
      held_, steps_, frequency, count / (frequency * time_), 0.01 * fastest_, fastest_);
}

}  // namespace espalier::dynamics::model
