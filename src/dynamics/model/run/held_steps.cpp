#include "dynamics/model/run/held_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace espalier::dynamics::model {

void HeldSteps::step(const State& s) {
  if (last_.size() != s.a.size()) return begin(s);
  coordinates_.resize(s.a.size());
  for (std::size_t i = 0; i < s.a.size(); ++i) {
    Coordinate& c = coordinates_[i];
    const double change = s.a[i] - last_[i];
    if (change != 0 && (change > 0) != c.rises) {
      c.rises = change > 0;
      ++c.turns;
    }
    c.way += std::abs(change);
    fastest_ = std::max(fastest_, std::abs(s.v[i]));
  }
  ++steps_;
  duration_ += s.t - time_;
  begin(s);
}

std::optional<std::string> HeldSteps::notice() const {
  constexpr long kManySteps = 3000, kManyTurns = 200;
  constexpr double kFewestSteps = 2.5, kMostSteps = 1000;  // of a period
  if (steps_ < kManySteps) return std::nullopt;
  const auto c = std::max_element(coordinates_.begin(), coordinates_.end(),
                                  [](const Coordinate& a, const Coordinate& b) { return a.way < b.way; });
  if (c == coordinates_.end() || c->turns < kManyTurns) return std::nullopt;
  const double periods = 0.5 * static_cast<double>(c->turns), each = static_cast<double>(steps_) / periods;
  if (each < kFewestSteps || each > kMostSteps) return std::nullopt;
  return fmt::format(
      "the {} steps follow a vibration of about {:.2g} per unit of time, with {:.0f} steps a period: where it does not "
      "matter, set [integrator] max_order = 2 and absolute_velocity = {:.1g} (what may be lost of speeds, which reach "
      "{:.2g}), or give it damping",
      steps_, periods / duration_, each, 0.01 * fastest_, fastest_);
}

}  // namespace espalier::dynamics::model
