#include "dynamics/model/derivatives/quantity_slopes.hpp"

#include <fmt/format.h>

#include <cmath>
#include <random>
#include <utility>

namespace espalier::dynamics::model {

namespace {

constexpr double kStep = 1e-5;       // of the extent of the model, of the largest velocity, acceleration, multiplier
constexpr double kProbeStep = 1e-4;  // likewise, of moves that are to change a bit

double largest_or_one(const std::vector<double>& x) {
  const double largest = max_norm(x);
  return largest > 0 ? largest : 1;
}

// For each index of a range a number of size 1/2 to 1 with a random sign.
void fill_random(std::size_t first, std::size_t last, std::vector<double>& out) {
  std::mt19937_64 random(first * 1000003 + last);
  std::uniform_real_distribution<double> amount(0.5, 1);
  for (std::size_t i = first; i < last; ++i) out[i] = amount(random) * ((random() & 1) != 0 ? 1 : -1);
}

}  // namespace

QuantitySlopes::QuantitySlopes(Mechanism& mechanism, std::vector<Index> rows, std::optional<double> load)
    : mechanism_(mechanism),
      rows_(std::move(rows)),
      load_(load),
      n_(static_cast<std::size_t>(mechanism.system.sizes().velocity)),
      scene_(mechanism) {}

double QuantitySlopes::value(const Quantity& quantity, const State& state) const {
  Sample s{&state, {}};
  s.load = load_;
  return quantity.value(s);
}

std::vector<QuantitySlopes::StateRange> QuantitySlopes::parts(const State& state) const {
  std::vector<StateRange> all = {{0, n_, 0}};
  if (!load_) {
    all.push_back({n_, 2 * n_, largest_or_one(state.v)});
    all.push_back({2 * n_, 3 * n_, largest_or_one(state.a)});
  }
  all.push_back({3 * n_, 3 * n_ + rows_.size(), largest_or_one(state.lambda)});
  return all;
}

State QuantitySlopes::moved(const State& state, const std::vector<double>& step) const {
  State s = state;
  mechanism_.system.retract(state.q, {step.data(), n_}, s.q);
  for (std::size_t i = 0; i < n_; ++i) {
    s.v[i] += step[n_ + i];
    s.a[i] += step[2 * n_ + i];
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) s.lambda[static_cast<std::size_t>(rows_[r])] += step[3 * n_ + r];
  return s;
}

double QuantitySlopes::extent_along(const State& state, const std::vector<double>& dq) {
  const double largest = max_norm({dq.data(), n_});
  if (largest == 0) return 0;
  State s = state;
  s.v.assign(dq.begin(), dq.begin() + static_cast<std::ptrdiff_t>(n_));
  if (const double way = scene_.extent_over_speed(s); way > 0 && way * largest < 1e300) return way;
  // A single point, or what no picture shows.
  std::vector<double> size(n_);
  mechanism_.system.magnitude(state.q, size);
  const double extent = max_norm(size);
  return (extent > 0 ? extent : 1) / largest;
}

std::vector<double> QuantitySlopes::steps(const State& state, std::span<const Index> coordinates) {
  std::vector<double> unit(n_, 0.0), out(n_, kStep);
  std::vector<char> done(n_, 0);
  for (const Index coordinate : coordinates) {
    const auto i = static_cast<std::size_t>(coordinate);
    if (std::exchange(done[i], char{1}) != 0) continue;
    unit[i] = 1;
    out[i] = kStep * extent_along(state, unit);
    unit[i] = 0;
  }
  return out;
}

// Whether moves of the numbers by amounts of about 1, times what a probe is of them, change a bit of the quantity.
bool QuantitySlopes::changes(const Quantity& quantity, const State& state, const std::vector<double>& amounts) {
  std::vector<double> step = amounts;
  for (const StateRange& part : parts(state)) {
    const double size = part.first == 0 ? extent_along(state, amounts) : part.size;
    for (std::size_t i = part.first; i < part.last; ++i) step[i] *= kProbeStep * size;
  }
  const std::vector<double> none(step.size(), 0.0);
  return value(quantity, moved(state, step)) != value(quantity, moved(state, none));
}

// Numbers first ... last - 1 are moved at random; halves that change nothing are left.
void QuantitySlopes::find_support(const Quantity& quantity, const State& state, std::size_t first, std::size_t last,
                                  std::vector<std::size_t>& found) {
  if (first == last) return;
  std::vector<double> amounts(3 * n_ + rows_.size(), 0.0);
  fill_random(first, last, amounts);
  if (!changes(quantity, state, amounts)) return;
  if (last - first == 1) {
    found.push_back(first);
    return;
  }
  const std::size_t middle = first + (last - first) / 2;
  find_support(quantity, state, first, middle, found);
  find_support(quantity, state, middle, last, found);
}

const std::vector<std::size_t>& QuantitySlopes::support(const Quantity& quantity, const State& state) {
  const auto [entry, fresh] = support_.try_emplace(quantity.name);
  std::vector<std::size_t>& known = entry->second;
  if (!fresh) {
    std::vector<double> amounts(3 * n_ + rows_.size(), 0.0);
    for (const StateRange& part : parts(state)) fill_random(part.first, part.last, amounts);
    for (const std::size_t i : known) amounts[i] = 0;
    if (!changes(quantity, state, amounts)) return known;
  }
  known.clear();
  for (const StateRange& part : parts(state)) find_support(quantity, state, part.first, part.last, known);
  return known;
}

StateSlopes QuantitySlopes::at(const Quantity& quantity, const State& state) {
  std::vector<double> slopes(3 * n_ + rows_.size(), 0.0), step(slopes.size(), 0.0);
  const std::vector<StateRange> all = parts(state);
  for (const std::size_t i : support(quantity, state)) {
    double size = 0;
    for (const StateRange& part : all)
      if (i >= part.first && i < part.last) size = part.size;
    step[i] = 1;
    const double h = kStep * (i < n_ ? extent_along(state, step) : size);
    const auto f = [&](double way) {
      step[i] = way;
      return value(quantity, moved(state, step));
    };
    slopes[i] = (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
    step[i] = 0;
    if (!std::isfinite(slopes[i]))
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("adjoint: the quantity {} is no number beside the {}", quantity.name,
                              load_ ? "equilibrium" : fmt::format("state at t = {:g}", state.t)));
  }
  StateSlopes out;
  const auto part = [&](std::size_t k) {
    const auto begin = slopes.begin() + static_cast<std::ptrdiff_t>(k * n_);
    return std::vector<double>(begin, begin + static_cast<std::ptrdiff_t>(n_));
  };
  out.q = part(0);
  out.v = part(1);
  out.a = part(2);
  out.lambda.assign(state.lambda.size(), 0.0);
  for (std::size_t r = 0; r < rows_.size(); ++r) out.lambda[static_cast<std::size_t>(rows_[r])] = slopes[3 * n_ + r];
  return out;
}

}  // namespace espalier::dynamics::model
