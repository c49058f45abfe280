#include "harmonic/adaptive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/stopwatch.hpp"

namespace espalier::harmonic {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

namespace {

constexpr Eigen::Index kSketch = 6;      // sums of outputs that stand for all in fits
constexpr double kFloor = 0.01;          // of a median: what errors are relative to at least
constexpr double kDrift = 10;            // of a median, beyond which it is no unit any more
constexpr double kUndamped = 3e-9;       // half width over frequency below which a pole counts as undamped
constexpr double kUndampedReach = 1e-4;  // of the range: as near as one looks at such a pole
constexpr double kApart = 1e-10;         // of the range: samples are not closer than that
constexpr std::size_t kFirst = 9;        // samples at the start
constexpr std::size_t kAtATime = 6;      // targets of a round
constexpr std::size_t kFreshFits = 60;   // samples up to which a fit begins anew

double median_of(VectorXd x) {
  const Eigen::Index middle = x.size() / 2;
  std::nth_element(x.data(), x.data() + middle, x.data() + x.size());
  return x[middle];
}

// @param noise  of each row: what is rounding alone; 0: not known
VectorXd floors_of(const MatrixXcd& y, const VectorXd& noise) {
  VectorXd floor(y.rows());
  for (Eigen::Index i = 0; i < y.rows(); ++i) floor[i] = kFloor * median_of(y.row(i).cwiseAbs().transpose());
  // An output that is zero but for rounding is not followed.
  constexpr double kNothing = 1e-10;
  const double least = std::max(kNothing * floor.maxCoeff(), 1e-290);
  return (noise.array() > 0).select(floor.cwiseMax(noise), floor.cwiseMax(least));
}

std::uint64_t next(std::uint64_t& state) {  // Marsaglia, "Xorshift RNGs", J. Stat. Software 8, 2003
  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return state;
}

double uniform(std::uint64_t& state) { return static_cast<double>(next(state) >> 11) * 0x1p-53; }

}  // namespace

Adaptive::Adaptive(Sweep& sweep, const HarmonicOptions& options, HarmonicResult& result, double from, double to,
                   bool damped)
    : sweep_(sweep), options_(options), result_(result), from_(from), to_(to), damped_(damped) {
  const auto outputs = static_cast<Eigen::Index>(sweep.outputs());
  if (outputs <= kSketch) return;
  mixing_.resize(kSketch, outputs);
  for (Eigen::Index j = 0; j < outputs; ++j)
    for (Eigen::Index i = 0; i < kSketch; ++i) mixing_(i, j) = {2 * uniform(random_) - 1, 2 * uniform(random_) - 1};
}

double Adaptive::nearest_sample(double frequency) const {
  double least = INFINITY;
  for (const std::vector<Solved>* group : {&samples_, &singular_})
    for (const Solved& s : *group) least = std::min(least, std::abs(s.point.frequency - frequency));
  return least;
}

bool Adaptive::beside_singular(double frequency) const {
  return std::any_of(singular_.begin(), singular_.end(), [&](const Solved& s) {
    return std::abs(s.point.frequency - frequency) < kUndampedReach * length();
  });
}

// Whether a sample there helps: in the range, apart from the others, and not so near to a frequency at which the system
// is singular that its response would hide all others.
bool Adaptive::worth_a_sample(double frequency) const {
  return frequency > from_ && frequency < to_ && nearest_sample(frequency) >= kApart * length() &&
         !beside_singular(frequency);
}

void Adaptive::solve_beside_singular(const std::vector<double>& wanted) {
  const auto most = static_cast<std::size_t>(options_.max_solves);
  std::vector<double> where;
  for (const double f : wanted)
    if (beside_singular(f) && nearest_sample(f) > 0 && samples_.size() + singular_.size() + where.size() < most)
      where.push_back(f);
  beside_ = sweep_.solve(where, std::vector<char>(where.size(), 0));
}

void Adaptive::add(const std::vector<double>& frequencies, bool keep, bool beside_too) {
  std::vector<double> wanted;
  for (const double f : frequencies)
    if (nearest_sample(f) > 0 && std::find(wanted.begin(), wanted.end(), f) == wanted.end()) wanted.push_back(f);
  const std::size_t known = samples_.size() + singular_.size(), most = static_cast<std::size_t>(options_.max_solves);
  const bool too_many = known + wanted.size() > most;
  if (too_many) wanted.resize(most - known);
  std::vector<double> beside;
  for (Solved& s : sweep_.solve(wanted, std::vector<char>(wanted.size(), static_cast<char>(keep)))) {
    const double frequency = s.point.frequency;
    const bool singular = s.point.status.code == StatusCode::singular;
    std::vector<Solved>& group = singular ? singular_ : samples_;
    group.insert(std::upper_bound(group.begin(), group.end(), frequency,
                                  [](double f, const Solved& other) { return f < other.point.frequency; }),
                 std::move(s));
    // Its neighbourhood counts: a little inside the range.
    if (singular && beside_too)
      beside.push_back(frequency + (frequency < (from_ + to_) / 2 ? kUndampedReach : -kUndampedReach) * length());
  }
  if (too_many)
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("{} frequencies were solved and the interpolation is not yet good to {:g} (its estimates "
                            "stand beside the points); allow more, ask for a larger tolerance, or for a smaller range",
                            options_.max_solves, options_.tolerance));
  if (!beside.empty()) add(beside, false, false);
}

VectorXd Adaptive::noise() const {
  const auto each = static_cast<Eigen::Index>(sweep_.observed());
  VectorXd out(static_cast<Eigen::Index>(sweep_.outputs()));
  for (Eigen::Index i = 0; i < out.size(); ++i)
    out[i] = sweep_.observer().noise(static_cast<espalier::Index>(i / each), static_cast<espalier::Index>(i % each));
  return out;
}

VectorXd Adaptive::sizes_of(const VectorXcd& y, const VectorXd& floor) const { return y.cwiseAbs().cwiseMax(floor); }

void Adaptive::fit() {
  const base::Stopwatch watch(result_.seconds.interpolation);
  const auto outputs = static_cast<Eigen::Index>(sweep_.outputs());
  const auto count = static_cast<Eigen::Index>(samples_.size());
  at_.clear();
  values_.resize(outputs, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    const Solved& s = samples_[static_cast<std::size_t>(j)];
    at_.push_back(s.point.frequency);
    values_.col(j) = Eigen::Map<const VectorXcd>(s.outputs.data(), outputs);
  }
  const VectorXd nothing = noise();
  floor_ = floors_of(values_, nothing);
  // The units of the sums stay, so that functions of different rounds can be compared; but where a median has moved far
  // they are new: samples above the resonances alone know outputs that are tiny there and would hide the others.
  const VectorXd unit = floor_ / kFloor;
  const bool other_units = unit_.size() == 0 || unit.cwiseQuotient(unit_).maxCoeff() > kDrift ||
                           unit_.cwiseQuotient(unit).maxCoeff() > kDrift;
  if (other_units) unit_ = unit;
  const MatrixXcd scaled = unit_.cwiseInverse().asDiagonal() * values_;
  const MatrixXcd sketch = mixing_.size() > 0 ? MatrixXcd(mixing_ * scaled) : scaled;
  sketch_floor_ = floors_of(
      sketch, mixing_.size() > 0 ? VectorXd(VectorXd::Zero(sketch.rows())) : VectorXd(nothing.cwiseQuotient(unit_)));
  MatrixXd sizes(sketch.rows(), count);
  for (Eigen::Index j = 0; j < count; ++j) sizes.col(j) = sizes_of(sketch.col(j), sketch_floor_);
  std::vector<std::size_t> support;
  if (samples_.size() > kFreshFits && !now_.empty())
    for (const double s : now_.support_at()) {
      const auto place = std::lower_bound(at_.begin(), at_.end(), s);
      support.push_back(static_cast<std::size_t>(place - at_.begin()));
    }
  before_ = other_units ? Rational() : std::move(now_);
  now_ = Rational();
  constexpr double kMargin = 0.01;
  now_.fit(at_, sketch, sizes, kMargin * options_.tolerance, std::move(support));
}

double Adaptive::difference_at(double frequency) const {
  if (before_.empty()) return INFINITY;
  const VectorXcd now = now_.evaluate(frequency);
  const VectorXcd before = before_.evaluate(frequency);
  if (!now.allFinite() || !before.allFinite()) return INFINITY;
  return ((now - before).cwiseAbs().array() / sizes_of(now, sketch_floor_).array()).maxCoeff();
}

std::vector<Adaptive::Peak> Adaptive::peaks(const Rational& r) const {
  std::vector<Peak> out;
  if (r.empty()) return out;
  for (const Complex& p : r.poles()) {
    Peak peak{p.real(), std::abs(p.imag()), true};
    if (!(peak.frequency > from_ && peak.frequency < to_) || peak.half_width > length()) continue;
    if (peak.half_width < (damped_ ? kUndamped * peak.frequency : kUndampedReach * length())) {
      peak.half_width = std::max(kUndampedReach * length(), peak.half_width);
      peak.damped = false;
    }
    // Poles with a zero beside them are not seen.
    const VectorXcd beside = r.evaluate(peak.frequency + 4 * peak.half_width);
    const VectorXcd top = r.evaluate(peak.frequency + (peak.damped ? 0 : peak.half_width));
    const VectorXcd other = r.evaluate(peak.frequency - 4 * peak.half_width);
    const VectorXd bend = (top - 0.5 * (beside + other)).cwiseAbs();
    if ((bend.array() / sizes_of(top, sketch_floor_).array()).maxCoeff() > options_.tolerance) out.push_back(peak);
  }
  return out;
}

std::vector<Adaptive::Target> Adaptive::doubtful() const {
  std::vector<double> grid;
  constexpr int kParts = 8;
  for (std::size_t i = 0; i + 1 < at_.size(); ++i)
    for (int k = 1; k < kParts; ++k) grid.push_back(at_[i] + (at_[i + 1] - at_[i]) * k / kParts);
  std::vector<Target> out;
  for (const Rational* r : {&now_, &before_})
    for (const Peak& p : peaks(*r)) {
      for (const double k : {-3.0, -1.0, 0.0, 1.0, 3.0})
        if (k != 0 || p.damped) grid.push_back(p.frequency + k * p.half_width);
      // A peak is believed when a sample lies in it.
      const double inside = p.frequency + (p.damped ? 0.3 : 1) * p.half_width;
      if (nearest_sample(p.frequency) > 3 * p.half_width && worth_a_sample(inside)) out.push_back({inside, INFINITY});
    }
  std::vector<Target> worst(at_.size() + 1);  // between two samples, before the first and behind the last one
  for (const double f : grid) {
    if (!worth_a_sample(f)) continue;
    const auto interval = static_cast<std::size_t>(std::upper_bound(at_.begin(), at_.end(), f) - at_.begin());
    if (const double d = difference_at(f); d > worst[interval].difference) worst[interval] = {f, d};
  }
  for (const Target& t : worst)
    if (t.difference > 0) out.push_back(t);
  std::stable_sort(out.begin(), out.end(),
                   [](const Target& a, const Target& b) { return a.difference > b.difference; });
  return out;
}

std::vector<double> Adaptive::to_check(const std::vector<Target>& all) {
  std::vector<std::pair<double, double>> gaps;  // negative length, middle
  for (std::size_t i = 0; i + 1 < at_.size(); ++i)
    gaps.emplace_back(at_[i] - at_[i + 1], at_[i] + 0.45 * (at_[i + 1] - at_[i]));
  std::sort(gaps.begin(), gaps.end());
  std::vector<double> out;
  for (std::size_t i = 0; i < std::min<std::size_t>(2, gaps.size()); ++i) out.push_back(gaps[i].second);
  if (!all.empty()) out.push_back(all.front().frequency);
  out.push_back(from_ + uniform(random_) * length());
  return out;
}

std::vector<double> Adaptive::apart(const std::vector<double>& frequencies) const {
  std::vector<double> out;
  for (const double f : frequencies) {
    const auto apart_from = [&](double g) { return std::abs(f - g) >= kApart * length(); };
    if (worth_a_sample(f) && std::all_of(out.begin(), out.end(), apart_from)) out.push_back(f);
  }
  return out;
}

double Adaptive::try_out(const std::vector<double>& frequencies) {
  const std::vector<double> where = apart(frequencies);
  std::vector<VectorXcd> said;
  for (const double f : where) said.push_back(now_.evaluate(f, values_));
  add(where);
  double worst = 0;
  for (std::size_t k = 0; k < where.size(); ++k) {
    ++result_.checks;
    const auto place =
        std::find_if(samples_.begin(), samples_.end(), [&](const Solved& s) { return s.point.frequency == where[k]; });
    if (place == samples_.end()) continue;  // on a resonance: beside it
    const Eigen::Map<const VectorXcd> is(place->outputs.data(), said[k].size());
    const double e = ((said[k] - is).cwiseAbs().array() / sizes_of(is, floor_).array()).maxCoeff();
    worst = std::max(worst, std::isfinite(e) ? e : INFINITY);
  }
  return worst;
}

// Whether a resonance shows, by the size of its peak beside what errors are relative to; if so, samples are placed
// there.
void Adaptive::note(const std::vector<Resonance>& expected, std::vector<char>& excited) {
  constexpr double kPart = 0.1;        // of the tolerance
  constexpr double kBroad = 1.0 / 20;  // of the range: seen without help
  std::vector<double> where;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Resonance& r = expected[i];
    const Eigen::Map<const VectorXd> peak(r.peak.data(), r.peak.size());
    excited[i] = static_cast<char>((peak.array() > kPart * options_.tolerance * floor_.array()).any());
    if (excited[i] == 0 || r.half_width > kBroad * length()) continue;
    const bool damped = r.half_width > kUndamped * r.frequency;
    double d = damped ? r.half_width : kUndampedReach * length();
    if (!damped)
      for (const std::size_t k : {i - 1, i + 1})
        if (k < expected.size()) d = std::min(d, std::abs(expected[k].frequency - r.frequency) / 4);
    where.insert(where.end(), {r.frequency - d, damped ? r.frequency : -1, r.frequency + d});
  }
  add(apart(where));
}

void Adaptive::run(const std::vector<Resonance>& expected, std::vector<char>& excited) {
  std::vector<double> first;
  for (std::size_t i = 0; i < kFirst; ++i) {
    const double part = static_cast<double>(i) / (kFirst - 1);
    first.push_back(i == 0                 ? from_
                    : i == kFirst - 1      ? to_
                    : options_.logarithmic ? from_ * std::pow(to_ / from_, part)
                                           : from_ + part * length());
  }
  add(first);
  if (samples_.size() < 2) {  // and beside each of the others another one was tried
    const Status& first_one = singular_.front().point.status;
    throw Error(first_one.code,
                fmt::format("at {} frequencies of {} the system is singular: {}", singular_.size(),
                            singular_.size() + samples_.size(), first_one.message),
                first_one.row);
  }
  fit();
  note(expected, excited);
  fit();
  before_ = Rational();
  bool agreed = false;
  while (true) {
    const std::vector<Target> all = doubtful();
    std::vector<double> where;
    for (const Target& t : all)
      if (t.difference > options_.tolerance && where.size() < kAtATime) where.push_back(t.frequency);
    const bool last = where.empty();
    // The function with the last solves in it is another one, and is looked at, too: it may have a pole of its own.
    if (last && agreed) return;
    if (last) where = to_check(all);
    const double error = try_out(where);
    result_.checked_error = error;
    if (options_.solver.log)
      options_.solver.log(fmt::format("harmonic: {} solves, {} support points, {} of {} places {}: error {:.1e}",
                                      samples_.size(), now_.support().size(), where.size(), all.size(),
                                      last ? "checked" : "doubtful", error));
    agreed = last && error <= options_.tolerance;
    fit();
  }
}

void Adaptive::deliver(const std::vector<double>& wanted) {
  if (at_.size() != samples_.size() && samples_.size() > 1) fit();
  std::vector<double> all = wanted;
  for (const Peak& p : peaks(now_))
    for (const double k : {-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0})
      if (const double f = p.frequency + k * p.half_width;
          (k != 0 || p.damped) && f > from_ && f < to_ && !beside_singular(f))
        all.push_back(f);
  std::sort(all.begin(), all.end());
  std::vector<Solved> out = samples_;
  out.insert(out.end(), beside_.begin(), beside_.end());
  const auto solved_beside = [&](double f) {
    const auto place = std::lower_bound(beside_.begin(), beside_.end(), f,
                                        [](const Solved& s, double at) { return s.point.frequency < at; });
    return place != beside_.end() && place->point.frequency == f;
  };
  // On a resonance: those asked for alone, others were our choice.
  std::vector<double> shapes = options_.shapes_at;
  std::sort(shapes.begin(), shapes.end());
  for (const Solved& s : singular_)
    if (const double f = s.point.frequency;
        std::binary_search(wanted.begin(), wanted.end(), f) || std::binary_search(shapes.begin(), shapes.end(), f))
      out.push_back(s);
  for (std::size_t i = 0; i < all.size() && !now_.empty(); ++i) {
    const double f = all[i];
    if ((i > 0 && f == all[i - 1]) || nearest_sample(f) == 0 || solved_beside(f)) continue;
    Solved s;
    s.point.frequency = f;
    s.point.solved = false;
    s.point.backward_error = std::numeric_limits<double>::quiet_NaN();
    s.point.error_estimate = beside_singular(f) ? INFINITY : difference_at(f);
    const VectorXcd y = now_.evaluate(f, values_);
    s.outputs.assign(y.data(), y.data() + y.size());
    out.push_back(std::move(s));
  }
  std::sort(out.begin(), out.end(),
            [](const Solved& a, const Solved& b) { return a.point.frequency < b.point.frequency; });
  for (Solved& s : out) {
    result_.responses.insert(result_.responses.end(), s.outputs.begin(), s.outputs.end());
    result_.points.push_back(std::move(s.point));
  }
}

}  // namespace espalier::harmonic
