#include "dynamics/forces/stop.hpp"

#include <cmath>
#include <stdexcept>

#include "dynamics/forces/penalty.hpp"

namespace espalier::dynamics {
namespace {

class Stop final : public CoordinateLaw {
 public:
  explicit Stop(const StopLaw& law) : law_(law) {}

  [[nodiscard]] Strength strength(const LawPoint& p) const override {
    if (p.g > law_.upper) return contact(p.g - law_.upper, p.rate, 1);
    if (p.g < law_.lower) return contact(law_.lower - p.g, -p.rate, -1);
    return {};
  }
  [[nodiscard]] double potential(double g) const override {
    const double p = g > law_.upper ? g - law_.upper : law_.lower - g;
    return penalty(p, law_.stiffness, law_.smoothing).energy;
  }
  [[nodiscard]] bool switches() const override { return true; }
  void branches(const LawPoint& p, Branches& out) const override {
    // So little beyond the end there is hardly a force.
    const double dead = 1e-9 * law_.smoothing;
    if (std::isfinite(law_.upper)) out.push_back({.value = law_.upper - p.g, .dead = dead});
    if (std::isfinite(law_.lower)) out.push_back({.value = p.g - law_.lower, .dead = dead});
  }

 private:
  // `side`: 1 where the stop pushes g down. s = side N(p) (1 + a p'), p = side (g - end)
  [[nodiscard]] Strength contact(double p, double rate, double side) const {
    const PenaltyForce n = penalty(p, law_.stiffness, law_.smoothing);
    const double factor = 1 + law_.damping * rate;
    if (factor <= 0) return {};
    return {side * n.force * factor, n.slope * factor, n.force * law_.damping};
  }

  StopLaw law_;
};

}  // namespace

std::unique_ptr<CoordinateLaw> stop_law(const StopLaw& law) {
  if (!(law.stiffness > 0 && law.smoothing > 0 && law.damping >= 0))
    throw std::invalid_argument("a stop needs a positive stiffness and smoothing, and no negative damping");
  if (!(law.lower < law.upper)) throw std::invalid_argument("the lower limit of a stop must lie below the upper one");
  return std::make_unique<Stop>(law);
}

}  // namespace espalier::dynamics
