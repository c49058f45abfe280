// Where K - s M is factorized.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "modes/search.hpp"

namespace espalier::modes {

namespace {

// A share of the largest eigenvalue: so far below zero the search begins, that a free body's K - s M is well
// conditioned and its elastic modes are far from the shift.
constexpr double kBelowZero = 1e-7;
constexpr Index kInOneSlice = 160;  // modes between two shifts: more are shared with a shift between them
constexpr int kAttempts = 3;        // searches from one shift
// What is nearer counts as equal: relative to an eigenvalue, and to the typical one.
constexpr double kNear = 1e-9, kNearOfTypical = 1e-11;
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
  typical_ = *middle;
  unit_ = kBelowZero * typical_;
  largest_ = *std::max_element(ratios.begin(), ratios.end());
}

// Where K - s M is factorized first: its values choose scaling and matching.
double Search::first_shift() const {
  if (!std::isinf(options_.below)) return options_.below;
  return std::isnan(options_.shift) ? -unit_ : options_.shift;
}

// Below zero, or the bound. Where parts of K are larger than a typical one by many decades, so small a shift is
// rounding of theirs, and K - s M is singular: then it stands farther away. @return the number
double Search::count_below_zero() {
  constexpr double kFarther = 1e3;
  for (;;) {
    double s = -unit_;
    if (!std::isinf(options_.below) && options_.below < s) s = options_.below - 10 * std::abs(options_.below);
    try {
      below_shift_ = count_at(s, true);
      return s;
    } catch (const Error& e) {
      if (e.status().code != StatusCode::singular || kFarther * unit_ > largest_) throw;
    }
    unit_ *= kFarther;
  }
}

void Search::choose_first() {
  double s = options_.shift;
  if (!std::isnan(s)) {
    below_shift_ = count_at(s, false);
  } else {
    s = count_below_zero();
  }
  // Far more below it than are wanted: these are the wrong ones.
  for (double step = 10 * std::max(unit_, std::abs(s)); below_shift_ > wanted_ + 8; step *= 10) {
    s -= step;
    if (!std::isfinite(s) || pencil_.factorizations > 40)
      throw Error(StatusCode::accuracy_not_reached, "no number was found below the lowest eigenvalues");
    below_shift_ = count_at(s, true);
  }
}

// More are asked for than there are; where constraints depend on each other, that is the reason and is said.
void Search::refuse_count() {
  double s = first_shift();
  count_at(s, true);
  throw Error(StatusCode::invalid_input,
              fmt::format("{} modes are asked for, and there are {} finite eigenvalues ({} unknowns, {} of them with "
                          "mass; constraints take away the rest)",
                          options_.count, report_.finite, pencil_.n(), report_.rank));
}

// All below a bound: as many as the inertia says.
void Search::count_below_bound() {
  double s = options_.below;
  const Index below = count_at(s, true);
  wanted_ = std::min(wanted_, below);
}

// What a count says that cannot be: below any number there are 0 to all finite eigenvalues.
Status Search::impossible(Index negative, double s) const {
  return {report_.proven ? StatusCode::singular : StatusCode::invalid_input,
          fmt::format("K - s M has {} negative eigenvalues at s = {:g}, where between {} and {} are possible: {}",
                      negative, s, report_.negative_at_infinity, report_.negative_at_infinity + report_.finite,
                      report_.proven ? "constraints depend on each other"
                                     : "M is not positive semi-definite, or constraints depend on each other"),
          -1};
}

Index Search::count_at(double& s, bool movable) {
  constexpr int kTrials = 4;
  Status last;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Shifted f = pencil_.factorize(s);
    last = f.status;
    if (f.status.ok()) {
      exact_ = exact_ && f.exact;
      shift_ = s;
      attempts_ = 0;
      const Index below = f.negative - report_.negative_at_infinity;
      if (below >= 0 && below <= report_.finite) {
        counts_.push_back({s, below});
        std::sort(counts_.begin(), counts_.end(), [](const ModeCount& a, const ModeCount& b) { return a.at < b.at; });
        return below;
      }
      last = impossible(f.negative, s);
    } else {
      singular_.push_back(s);
      last.message = movable
                         ? fmt::format(
                               "K - s M is singular for every s that was tried: constraints depend on each other, or "
                               "an unknown has neither mass nor stiffness ({})",
                               f.status.message)
                         : fmt::format(
                               "the shift {:g} is an eigenvalue, or K - s M is singular for every s; give another "
                               "one, or none ({})",
                               s, f.status.message);
    }
    if (!movable) break;
    s += (trial % 2 == 0 ? 1.0 : -2.7) * 1e-3 * (trial + 1) * std::max(unit_, 1e-3 * std::abs(s));
  }
  throw Error(last);
}

// Whether as many were found below a number as were counted, eigenvalues on it counted either way.
bool Search::accounts_for(const ModeCount& count) const {
  const double rounding = rounding_at(count.at);
  return harvest_.below(count.at - rounding) <= count.below && count.below <= harvest_.below(count.at + rounding);
}

double Search::rounding_at(double at) const {
  return 1e3 * std::numeric_limits<double>::epsilon() * std::max(std::abs(at), typical_);
}

bool Search::contradicted() const {
  for (std::size_t i = 0; i < counts_.size(); ++i)
    if (harvest_.below(counts_[i].at - rounding_at(counts_[i].at)) > counts_[i].below ||
        (i > 0 && counts_[i].below < counts_[i - 1].below))
      return true;
  return false;
}

// The lowest number below which fewer were found than counted.
std::optional<ModeCount> Search::missing() const {
  for (const ModeCount& c : counts_)
    if (harvest_.below(c.at + rounding_at(c.at)) < c.below) return c;
  return std::nullopt;
}

// The largest number below which all are known to be found. A count on many equal ones says little: it goes by what is
// missing below it.
std::optional<ModeCount> Search::proven() const {
  const auto gone = missing();
  std::optional<ModeCount> last;
  for (const ModeCount& c : counts_)
    if (accounts_for(c) && !(gone && gone->at < c.at)) last = c;
  return last;
}

// How near an eigenvalue counts as equal, and how near to a cluster it is counted.
double Search::near(double eigenvalue) const {
  return std::max(kNear * std::abs(eigenvalue), kNearOfTypical * typical_);
}

// Those wanted that lie above it lie so near to it that no other can be between.
bool Search::proves_wanted(const ModeCount& count) const {
  if (count.below >= wanted_) return true;
  if (harvest_.size() < wanted_) return false;
  const double last = harvest_[wanted_ - 1].eigenvalue;
  return last - count.at <= 3 * near(last);
}

// As count_at(), into below_shift_. Where K - s M is singular around s, next to many eigenvalues that are equal to
// rounding, the factor of the last shift is there again.
// @return whether they were counted
bool Search::try_count(double s) {
  try {
    below_shift_ = count_at(s, true);
    return true;
  } catch (const Error& e) {
    if (e.status().code != StatusCode::singular) throw;
  }
  const Status back = pencil_.factorize(shift_).status;
  if (!back.ok()) throw Error(back);
  return false;
}

// The last one wanted may be one of many equal ones, all of which nobody wants: those below it are counted, next to it.
// @return false: they were, or cannot be
bool Search::count_before_wanted() {
  if (harvest_.size() < wanted_ || before_ == harvest_.size() || blurred_ == shift_) return false;
  before_ = harvest_.size();
  const double last = harvest_[wanted_ - 1].eigenvalue;
  if (try_count(last - 2 * near(last))) return true;
  blurred_ = shift_;
  return false;
}

int Search::most_factorizations() const { return 60 + wanted_ / 10; }

// Sets shift_ and its factor for the next search; false: there is no hope.
bool Search::choose_next() {
  if (pencil_.factorizations > most_factorizations() || contradicted()) return false;
  const auto gone = missing();
  if (!accounts_for({shift_, below_shift_}) || (gone && gone->at < shift_)) {
    if (below_shift_ - harvest_.below(shift_) > block_ && count_before_wanted()) return true;
    if (news_ && attempts_ < kAttempts) return true;  // once more, with other random vectors
    return count_before_wanted() || choose_below();
  }
  const bool all_found = harvest_.size() >= wanted_;
  double s = all_found ? gap_after_wanted() : beyond_found();
  if (std::isnan(s)) {  // the last one wanted is one of several: they are counted from below, or sought to their end
    if (count_before_wanted()) return true;
    extra_ += block_;
    return extra_ < 20 * block_ + wanted_;
  }
  const double lower = shift_;
  if (!(s > lower)) return false;
  if (all_found && !try_count(s)) return choose_next();  // by another gap
  if (!all_found) below_shift_ = count_at(s, true);
  // Too many between: they are shared.
  while (below_shift_ - harvest_.below(s) > kInOneSlice && pencil_.factorizations < most_factorizations()) {
    const double found_to = harvest_.size() > 0 ? std::max(lower, harvest_[harvest_.size() - 1].eigenvalue) : lower;
    if (s - found_to < near(found_to)) break;  // they are equal
    s = found_to + (s - found_to) / 2;
    below_shift_ = count_at(s, true);
  }
  return true;
}

// Some below the shift are missing, and are not seen from it: one between it and what is proven, by decades where they
// are many, or below all.
bool Search::choose_below() {
  const auto sure = proven(), gone = missing();
  double s = 0;
  if (sure) {
    const double low = sure->at, high = gone ? gone->at : shift_;
    constexpr double kDecades = 1e3;
    const bool far = low * high > 0 && std::max(low / high, high / low) > kDecades;
    s = far ? std::copysign(std::sqrt(std::abs(low)) * std::sqrt(std::abs(high)), low) : low + (high - low) / 2;
    if (!(s > low && s < high)) return false;
  } else {
    constexpr double kDown = 100;
    const double lowest = std::min(counts_.front().at, harvest_.size() > 0 ? harvest_[0].eigenvalue : shift_);
    s = lowest - kDown * std::max(unit_, std::abs(lowest));
    if (!std::isfinite(s)) return false;
  }
  below_shift_ = count_at(s, true);
  return true;
}

// From the nearest number at which there was a factor: relative to it an eigenvalue is known.
double Search::distance_from_shifts(double eigenvalue) const {
  double least = std::abs(eigenvalue - shift_);
  for (const ModeCount& c : counts_) least = std::min(least, std::abs(eigenvalue - c.at));
  return std::max(least, unit_);
}

// A number behind the modes found so far, with about half of what is sought at a time between.
double Search::beyond_found() const {
  const Index found = harvest_.size(), missing = wanted_ - found;
  double last = shift_, spacing = unit_;
  if (found > 0 && harvest_[found - 1].eigenvalue > shift_) {
    last = harvest_[found - 1].eigenvalue;
    double nearest = shift_;  // of the shifts below: from this one, or from one before it was sent below all
    for (const ModeCount& c : counts_)
      if (c.at <= last) nearest = std::max(nearest, c.at);
    const Index back = std::min<Index>(found - 1, 20);
    const double from = back > 0 ? std::max(nearest, harvest_[found - 1 - back].eigenvalue) : nearest;
    spacing = (last - from) / static_cast<double>(std::max<Index>(back, 1));
    // Where the next ones are too far from this shift to be seen, as behind rigid motions, by some decades.
    if (std::isnan(right_edge_)) spacing = std::max(spacing, 1e3 * (last - nearest) / 50);
    spacing = std::max(spacing, 1e-2 * (last - nearest));
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

// Between two modes, behind the last one that is wanted, where K - s M is not singular; NaN: no such gap is known.
double Search::gap_after_wanted() const {
  const Index found = harvest_.size();
  double best = kNaN, widest = 0;
  for (Index i = wanted_ - 1; i < found; ++i) {
    const double here = harvest_[i].eigenvalue;
    const double distance = distance_from_shifts(here);
    double next = here + distance;
    if (i + 1 < found)
      next = harvest_[i + 1].eigenvalue;
    else if (!std::isnan(right_edge_) && right_edge_ > here)
      next = right_edge_;
    const auto inside = [&](double at) { return at >= here && at <= next; };
    if (std::any_of(singular_.begin(), singular_.end(), inside)) continue;
    const double gap = (next - here) / distance;
    if (gap > widest) best = here + 0.3 * (next - here), widest = gap;
    if (gap > 1e-4) break;
  }
  return widest > 1e-6 ? best : kNaN;
}

}  // namespace espalier::modes
