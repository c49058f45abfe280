#include "dynamics/model/answer/harmonic_observer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dynamics/model/fields/field_quantity.hpp"

namespace espalier::dynamics::model {

using harmonic::Complex;

namespace {

constexpr double kObserverStep = 1e-5;  // of the extent of the model; of multipliers: of the largest
constexpr int kNoiseSamples = 9;        // solutions by which noise is judged
constexpr double kNoisePart = 1e-7;     // of what a quantity would be, were the motion not so regular

}  // namespace

HarmonicObserver::HarmonicObserver(Mechanism& mechanism, const State& state, const Linearised& linearised,
                                   std::vector<Quantity> quantities,
                                   const std::vector<std::vector<DrivenNumber>>& loads, Complex multiplier,
                                   std::optional<double> load)
    : mechanism_(mechanism),
      state_(state),
      linearised_(linearised),
      quantities_(std::move(quantities)),
      multiplier_(multiplier),
      load_(load),
      scene_(mechanism),
      here_(values(state)) {
  std::size_t count = 0;
  Sample sample{&state_, {}};
  for (std::size_t i = 0; i < quantities_.size(); ++i) {
    first_.push_back(count);
    count += quantities_[i].field ? quantities_[i].field->numbers(sample).size() : 1;
    owner_.resize(count, i);
  }
  first_.push_back(count);
  for (const std::vector<DrivenNumber>& parts : loads) {
    std::vector<Complex> sum(here_.size());
    for (const DrivenNumber& part : parts) {
      const double before = *part.number;
      const Numbers d = derivative(part.step, [&](double h, State&) { *part.number = before + h; });
      *part.number = before;
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part.amplitude * d[i];
    }
    direct_.push_back(std::move(sum));
  }
  noise_.assign(loads.size(), Numbers(quantities_.size(), 0.0));
  measured_.assign(loads.size(), 0);
}

HarmonicObserver::Numbers HarmonicObserver::values(const State& s) const {
  Sample sample{&s, {}};
  sample.load = load_;
  Numbers out;
  for (const Quantity& q : quantities_) {
    if (!q.field) {
      out.push_back(q.value(sample));
      continue;
    }
    const Numbers own = q.field->numbers(sample);
    out.insert(out.end(), own.begin(), own.end());
  }
  return out;
}

template <class Place>
HarmonicObserver::Numbers HarmonicObserver::derivative(double step, const Place& place) const {
  Numbers at[4];  // -2, -1, 1, 2 steps
  const double ways[4] = {-2, -1, 1, 2};
  for (std::size_t k = 0; k < 4; ++k) {
    State s = state_;
    place(ways[k] * step, s);
    at[k] = values(s);
  }
  Numbers out(here_.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = (8 * (at[2][i] - at[1][i]) - (at[3][i] - at[0][i])) / (12 * step);
    if (quantities_[owner_[i]].field) continue;  // smooth
    // Bent sides: a smooth function's grow with the square of the step, those of a kink with the step.
    const double near = at[2][i] + at[1][i] - 2 * here_[i], far = at[3][i] + at[0][i] - 2 * here_[i];
    const double size = std::abs(at[2][i]) + std::abs(at[1][i]) + std::abs(here_[i]);
    if (std::abs(near) > 1e-9 * size && std::abs(far) < 3 * std::abs(near) &&
        std::abs(near) > 0.1 * std::abs(at[2][i] - at[1][i]))
      throw Error(StatusCode::invalid_input,
                  fmt::format("the quantity {} has a kink where the model is linearised (a length or another absolute "
                              "value that is zero there): it has no harmonic response; ask for its components",
                              quantities_[owner_[i]].name));
  }
  return out;
}

double HarmonicObserver::step_of(const std::vector<double>& dq) const {
  State s = state_;
  s.v = dq;
  const double largest = max_norm(dq);
  if (const double way = scene_.extent_over_speed(s); way > 0 && way * largest < 1e300) return kObserverStep * way;
  // A single point, or what no picture shows.
  std::vector<double> size(dq.size());
  mechanism_.system.magnitude(state_.q, size);
  const double extent = max_norm(size);
  return kObserverStep * (extent > 0 ? extent : 1) / largest;
}

HarmonicObserver::Numbers HarmonicObserver::along(const Direction& d) const {
  Numbers sum(here_.size(), 0.0);
  const auto add = [&](const Numbers& part) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
  };
  const auto shifted = [](std::vector<double>& x, double h, const std::vector<double>& by) {
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += h * by[i];
  };
  if (max_norm(d.q) > 0)
    add(derivative(step_of(d.q), [&](double h, State& s) {
      std::vector<double> step = d.q;
      for (double& x : step) x *= h;
      mechanism_.system.retract(state_.q, step, s.q);
    }));
  if (max_norm(d.v) > 0 || max_norm(d.a) > 0)
    add(derivative(step_of(max_norm(d.v) > 0 ? d.v : d.a), [&](double h, State& s) {
      shifted(s.v, h, d.v);
      shifted(s.a, h, d.a);
    }));
  if (const double largest = max_norm(d.lambda); largest > 0) {
    const double size = max_norm(state_.lambda);
    add(derivative(kObserverStep * (size > 0 ? size : 1) / largest,
                   [&](double h, State& s) { shifted(s.lambda, h, d.lambda); }));
  }
  return sum;
}

void HarmonicObserver::observe(double w, Index load, const Complex* x, Complex* y) {
  const auto n = static_cast<std::size_t>(linearised_.n);
  const std::size_t rows = linearised_.rows.size();
  const Complex iw(0, w);
  std::vector<Complex> numbers(here_.size());
  for (const bool imaginary : {false, true}) {
    const auto part = [&](const Complex& z) { return imaginary ? z.imag() : z.real(); };
    Direction d{Numbers(n), Numbers(n), Numbers(n), Numbers(state_.lambda.size(), 0.0)};
    for (std::size_t i = 0; i < n; ++i) {
      d.q[i] = part(x[i]);
      d.v[i] = part(iw * x[i]);
      d.a[i] = part(iw * iw * x[i]);
    }
    for (std::size_t r = 0; r < rows; ++r) d.lambda[at(linearised_.rows[r])] = part(multiplier_ * x[n + r]);
    if (share_) {
      State shared = state_;
      shared.lambda = d.lambda;
      share_(shared);
      d.lambda = shared.lambda;
    }
    const Numbers values = along(d);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (imaginary)
        numbers[i].imag(values[i]);
      else
        numbers[i] = values[i];
    }
  }
  if (load >= 0) {
    const std::vector<Complex>& direct = direct_[at(load)];
    for (std::size_t i = 0; i < direct.size(); ++i) numbers[i] += direct[i];
  }
  combine(numbers, y);
  if (load < 0) return;
  if (measured_[at(load)]++ < kNoiseSamples) measure_noise(w, load, x);
}

void HarmonicObserver::combine(const std::vector<Complex>& numbers, Complex* y) const {
  const std::span<const Complex> all(numbers);
  for (std::size_t i = 0; i < quantities_.size(); ++i)
    y[i] = quantities_[i].field ? quantities_[i].field->amplitude(all.subspan(first_[i], first_[i + 1] - first_[i]))
                                : numbers[first_[i]];
}

// A motion as large as this one, but with signs at random: symmetry makes nothing zero in it.
void HarmonicObserver::measure_noise(double w, Index load, const Complex* x) {
  const auto n = static_cast<std::size_t>(linearised_.n);
  double motion = 0, force = 0;
  for (std::size_t i = 0; i < n; ++i) motion = std::max(motion, std::abs(x[i]));
  for (std::size_t r = 0; r < linearised_.rows.size(); ++r) force = std::max(force, std::abs(multiplier_ * x[n + r]));
  std::uint64_t random = 88172645463325252U;  // Marsaglia's xorshift, as in harmonic/adaptive.cpp
  const auto sign = [&random] {
    random ^= random << 13;
    random ^= random >> 7;
    random ^= random << 17;
    return (random >> 32 & 1) != 0 ? 1.0 : -1.0;
  };
  Direction d{Numbers(n), Numbers(n), Numbers(n), Numbers(state_.lambda.size(), 0.0)};
  for (std::size_t i = 0; i < n; ++i) {
    d.q[i] = sign() * motion;
    d.v[i] = w * d.q[i];
    d.a[i] = w * d.v[i];
  }
  for (const Index row : linearised_.rows) d.lambda[at(row)] = sign() * force;
  const Numbers values = along(d);
  const std::vector<Complex> numbers(values.begin(), values.end());
  std::vector<Complex> size(quantities_.size());
  combine(numbers, size.data());
  Numbers& noise = noise_[at(load)];
  for (std::size_t i = 0; i < size.size(); ++i) noise[i] = std::max(noise[i], kNoisePart * std::abs(size[i]));
}

double HarmonicObserver::noise(Index load, Index output) const { return noise_[at(load)][at(output)]; }

}  // namespace espalier::dynamics::model
