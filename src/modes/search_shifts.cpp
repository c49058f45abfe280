// Where K - s M is factorized.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "modes/search.hpp"

namespace espalier::modes {

namespace {

// Of the largest eigenvalue: so far below zero the search begins, that a free body's K - s M is well conditioned and
// its elastic modes are far from the shift.
constexpr double kBelowZero = 1e-7;
constexpr Index kInOneSlice = 160;  // modes between two shifts: more are shared with a shift between them
constexpr int kAttempts = 3;        // searches from one shift
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace

// Ratios of diagonal entries are Rayleigh quotients; their median is of the size of the largest eigenvalues of a mesh.
void Search::measure() {
  const std::vector<double> k = diagonal_of(pencil_.k()), m = diagonal_of(pencil_.m());
  std::vector<double> ratios;
  for (std::size_t i = 0; i < k.size(); ++i)
    if (m[i] > 0 && k[i] != 0) ratios.push_back(std::abs(k[i]) / m[i]);
  if (ratios.empty()) return;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  unit_ = kBelowZero * *middle;
  largest_ = *std::max_element(ratios.begin(), ratios.end());
}

// Where K - s M is factorized first: its values choose scaling and matching.
double Search::first_shift() const {
  if (!std::isinf(options_.below)) return options_.below;
  return std::isnan(options_.shift) ? -unit_ : options_.shift;
}

void Search::choose_first() {
  double s = options_.shift;
  if (!std::isnan(s)) {
    below_shift_ = count_at(s, false);
  } else {
    s = -unit_;
    if (!std::isinf(options_.below) && options_.below < s) s = options_.below - 10 * std::abs(options_.below);
    below_shift_ = count_at(s, true);
  }
  // Far more below it than are wanted: these are the wrong ones.
  for (double step = 10 * std::max(unit_, std::abs(s)); below_shift_ > wanted_ + 8; step *= 10) {
    s -= step;
    if (!std::isfinite(s) || pencil_.factorizations > 40)
      throw Error(StatusCode::accuracy_not_reached, "no number was found below the lowest eigenvalues");
    below_shift_ = count_at(s, true);
  }
}

// All below a bound: as many as the inertia says.
void Search::count_below_bound() {
  double s = options_.below;
  const Index below = count_at(s, true);
  wanted_ = std::min(wanted_, below);
}

Index Search::count_at(double& s, bool movable) {
  constexpr int kTrials = 4;
  Status last;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Shifted f = pencil_.factorize(s);
    if (f.status.ok()) {
      exact_ = exact_ && f.exact;
      shift_ = s;
      attempts_ = 0;
      const Index below = f.negative - report_.negative_at_infinity;
      if (below < 0 || below > report_.finite)
        throw Error(
            StatusCode::invalid_input,
            fmt::format("K - s M has {} negative eigenvalues at s = {:g}, where between {} and {} are possible: "
                        "M is not positive semi-definite, or constraints depend on each other",
                        f.negative, s, report_.negative_at_infinity, report_.negative_at_infinity + report_.finite));
      counts_.push_back({s, below});
      std::sort(counts_.begin(), counts_.end(), [](const ModeCount& a, const ModeCount& b) { return a.at < b.at; });
      return below;
    }
    last = f.status;
    if (!movable) break;
    s += (trial % 2 == 0 ? 1.0 : -2.7) * 1e-3 * (trial + 1) * std::max(unit_, 1e-3 * std::abs(s));
  }
  if (!movable)
    throw Error(StatusCode::singular,
                fmt::format("the shift {:g} is an eigenvalue, or K - s M is singular for every s; give another one, or "
                            "none ({})",
                            s, last.message),
                last.row);
  throw Error(StatusCode::singular,
              fmt::format("K - s M is singular for every s that was tried: constraints depend on each other, or an "
                          "unknown has neither mass nor stiffness ({})",
                          last.message),
              last.row);
}

// The largest number below which all are known to be found.
std::optional<ModeCount> Search::proven() const {
  std::optional<ModeCount> last;
  for (const ModeCount& c : counts_)
    if (harvest_.below(c.at) == c.below) last = c;
  return last;
}

// Sets shift_ and its factor for the next search; false: there is no hope.
bool Search::choose_next() {
  if (pencil_.factorizations > 12 + wanted_ / 10) return false;
  const bool left_open = harvest_.below(shift_) < below_shift_;
  if (harvest_.below(shift_) > below_shift_) return false;  // more than there are: the inertia, or the modes, are wrong
  if (left_open) {
    if (attempts_ < kAttempts) return true;  // once more, with other random vectors
    const auto sure = proven();
    if (!sure) return false;
    double between = sure->at + (shift_ - sure->at) / 2;
    if (!(between > sure->at && between < shift_)) return false;
    below_shift_ = count_at(between, true);
    return true;
  }
  double s = harvest_.size() >= wanted_ ? gap_after_wanted() : beyond_found();
  if (std::isnan(s)) {  // the last one wanted is one of several: to their end
    extra_ += block_;
    return extra_ < 20 * block_ + wanted_;
  }
  const double lower = shift_;
  if (!(s > lower)) return false;
  below_shift_ = count_at(s, true);
  // Too many between: they are shared.
  while (below_shift_ - harvest_.below(s) > kInOneSlice && pencil_.factorizations < 12 + wanted_ / 10) {
    const double found_to = harvest_.size() > 0 ? std::max(lower, harvest_[harvest_.size() - 1].eigenvalue) : lower;
    s = found_to + (s - found_to) / 2;
    below_shift_ = count_at(s, true);
  }
  return true;
}

// A number behind the modes found so far, with about half of what is sought at a time between.
double Search::beyond_found() const {
  const Index found = harvest_.size(), missing = wanted_ - found;
  double last = shift_, spacing = unit_;
  if (found > 0 && harvest_[found - 1].eigenvalue > shift_) {
    last = harvest_[found - 1].eigenvalue;
    const Index back = std::min<Index>(found - 1, 20);
    const double from = back > 0 ? std::max(shift_, harvest_[found - 1 - back].eigenvalue) : shift_;
    spacing = (last - from) / static_cast<double>(std::max<Index>(back, 1));
    // Where the next ones are too far from this shift to be seen, as behind rigid motions, by some decades.
    if (std::isnan(right_edge_)) spacing = std::max(spacing, 1e3 * (last - shift_) / 50);
    spacing = std::max(spacing, 1e-2 * (last - shift_));
  } else if (!std::isnan(right_edge_)) {
    spacing = (right_edge_ - shift_) / 2;
  } else {
    spacing = 10 * std::max(unit_, std::abs(shift_));
  }
  double s = last + spacing * (0.5 + static_cast<double>(std::min<Index>(missing, 50)));
  for (const ModeCount& c : counts_)  // what was counted already is not passed
    if (c.at > last && c.at < s && harvest_.below(c.at) < c.below) s = last + (c.at - last) / 2;
  return s;
}

// Between two modes, behind the last one that is wanted; NaN: no gap is known.
double Search::gap_after_wanted() const {
  const Index found = harvest_.size();
  double best = kNaN, widest = 0;
  for (Index i = wanted_ - 1; i < found; ++i) {
    const double here = harvest_[i].eigenvalue;
    const double distance = std::max(std::abs(here - shift_), unit_);
    double next = here + distance;
    if (i + 1 < found)
      next = harvest_[i + 1].eigenvalue;
    else if (!std::isnan(right_edge_) && right_edge_ > here)
      next = right_edge_;
    const double gap = (next - here) / distance;
    if (gap > widest) best = here + 0.3 * (next - here), widest = gap;
    if (gap > 1e-4) break;
  }
  return widest > 1e-6 ? best : kNaN;
}

}  // namespace espalier::modes
