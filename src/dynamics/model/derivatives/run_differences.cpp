#include "dynamics/model/derivatives/run_differences.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/stage.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr std::size_t kFew = 16, kMost = 64;  // parameters that are looked at one by one: at once, after all together
constexpr double kAlike = 0.02;               // of a derivative: curvature over such a way, error of a step
constexpr double kSettled = 0.05;             // differences with two ways agree to this part
constexpr double kSpreads = 3;                // by which a derivative may differ from what they tend to

class Check {
 public:
  Check(const DerivativesToCheck& what, const EndOfRun& run, std::span<double> derivatives)
      : what_(what), run_(run), derivatives_(derivatives), now_(run({})) {}

  std::string result() {
    const std::size_t count = what_.parameters.size();
    if (count > kFew && agree_together()) return {};
    if (count > kMost)
      return fmt::format(
          "a run with all {} parameters moved ends elsewhere than they say; look at differences of whole "
          "runs before you trust them",
          count);
    base::Stage stage("check of the derivatives", static_cast<double>(count), "parameters");
    for (std::size_t p = 0; p < count; ++p, stage.add(1))
      if (!agrees(p)) settle(p);
    return text_;
  }

 private:
  [[nodiscard]] double& derivative(std::size_t q, std::size_t p) {
    return derivatives_[q * what_.parameters.size() + p];
  }

  [[nodiscard]] bool alike(std::size_t q, double there, double expected, double size) const {
    const double change = there - now_[q];
    return std::abs(change - expected) <=
           kAlike * std::max(size, std::abs(change)) + std::max(what_.noise(now_[q]), what_.noise(there));
  }

  [[nodiscard]] bool agree_together() {
    MovedParameters moved;
    for (std::size_t p = 0; p < what_.parameters.size(); ++p) moved.emplace_back(p, what_.values[p] + way(p));
    const std::vector<double> there = run_(moved);
    for (std::size_t q = 0; q < now_.size(); ++q) {
      double expected = 0, size = 0;
      for (std::size_t p = 0; p < what_.parameters.size(); ++p) {
        expected += way(p) * derivative(q, p);
        size += std::abs(way(p) * derivative(q, p));
      }
      if (!alike(q, there[q], expected, size)) return false;
    }
    return true;
  }

  // To both sides in turn, so that the parts of many parameters do not all add up.
  [[nodiscard]] double way(std::size_t p) const { return p % 2 == 0 ? what_.ways[p] : -what_.ways[p]; }

  [[nodiscard]] bool agrees(std::size_t p) {
    const std::vector<double> there = run_({{p, what_.values[p] + way(p)}});
    for (std::size_t q = 0; q < now_.size(); ++q) {
      const double expected = way(p) * derivative(q, p);
      if (!alike(q, there[q], expected, std::abs(expected))) return false;
    }
    return true;
  }

  [[nodiscard]] std::vector<double> difference(std::size_t p, double way) {
    const std::vector<double> above = run_({{p, what_.values[p] + way}}), below = run_({{p, what_.values[p] - way}});
    std::vector<double> slope(above.size());
    for (std::size_t q = 0; q < slope.size(); ++q) slope[q] = (above[q] - below[q]) / (2 * way);
    return slope;
  }

  // Central differences with a way and its half, and what they tend to.
  void settle(std::size_t p) {
    const double way = what_.ways[p];
    const std::vector<double> wide = difference(p, way), narrow = difference(p, way / 2);
    for (std::size_t q = 0; q < now_.size(); ++q) {
      const double best = (4 * narrow[q] - wide[q]) / 3, spread = std::abs(wide[q] - narrow[q]);
      const double noise = 4 * what_.noise(now_[q]) / way, given = derivative(q, p);
      const double size = std::max(std::abs(given), std::abs(best));
      const bool settled = spread <= kSettled * std::max(std::abs(wide[q]), std::abs(narrow[q])) + noise;
      if (settled && std::abs(given - best) <= kAlike * size + kSpreads * spread + noise) continue;
      text_ += fmt::format("{}d({})/d({}) is {:.4g} by the steps of the run, and ", text_.empty() ? "" : "; ",
                           what_.numbers[q], what_.parameters[p], given);
      if (!settled) {
        text_ += fmt::format("{:.4g} or {:.4g} by runs beside it: do not trust it", wide[q], narrow[q]);
      } else {
        text_ += fmt::format("{:.4g} by whole runs beside it{}", best, what_.replace ? ", which is given" : "");
        if (what_.replace) derivative(q, p) = best;
      }
    }
  }

  const DerivativesToCheck& what_;
  const EndOfRun& run_;
  std::span<double> derivatives_;
  std::vector<double> now_;
  std::string text_;
};

}  // namespace

std::string check_by_runs(const DerivativesToCheck& what, const EndOfRun& run, std::span<double> derivatives) {
  return Check(what, run, derivatives).result();
}

}  // namespace espalier::dynamics::model
