#include "harmonic/sweep.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "base/stopwatch.hpp"

namespace espalier::harmonic {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Options solver_options(const Options& from) {
  Options o = from;
  o.kind = Kind::automatic;
  o.precision = Precision::fp64;
  o.singular = SingularMatrix::error;
  o.permutation.clear();
  o.record_timeline = false;
  return o;
}

double largest(std::span<const Complex> x) {
  double most = 0;
  for (const Complex& v : x)
    if (const double size = std::abs(v); !(size <= most)) most = size;  // NaN, too
  return most;
}

}  // namespace

Sweep::Sweep(DynamicStiffness& z, std::span<const Complex> loads, Index columns, const HarmonicOptions& options,
             modes::Workshop& shop, HarmonicResult& result)
    : z_(z),
      loads_(loads),
      columns_(columns),
      options_(options),
      shop_(shop),
      result_(result),
      solver_(solver_options(options.solver)) {}

std::size_t Sweep::observed() const {
  return options_.observed.empty() ? static_cast<std::size_t>(z_.n()) : options_.observed.size();
}

std::size_t Sweep::unknown(std::size_t output) const {
  return options_.observed.empty() ? output : static_cast<std::size_t>(options_.observed[output]);
}

void Sweep::analyze(double frequency) {
  const base::Stopwatch watch(result_.seconds.analysis);
  const AnalysisResult r = solver_.analyze(z_.view());
  if (r.status.code == StatusCode::singular)
    throw Error(
        r.status.code,
        fmt::format("K (1 + i eta) + i w C - w^2 M is singular by its pattern at frequency {:g}, and so at every "
                    "other one ({})",
                    frequency, r.status.message),
        r.status.row);
  if (!r.status.ok()) throw Error(r.status);
}

double Sweep::rounding_of(double w, const std::vector<Complex>& x, double z_norm) {
  constexpr double kEps = std::numeric_limits<double>::epsilon();
  // |Z| |x| / |f| is a lower bound of the condition: where that is harmless, nothing more is looked at.
  constexpr double kWorthALook = 1e-9;
  const auto n = static_cast<std::size_t>(z_.n());
  std::vector<Complex> d(n);
  double worst = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns_); ++c) {
    const double size = largest({x.data() + c * n, n});
    if (!std::isfinite(size)) return size;
    if (!(size * z_norm * kEps > kWorthALook * largest(loads_.subspan(c * n, n)))) continue;
    z_.magnitudes(w, x.data() + c * n, d.data());
    const Status status = solver_.solve(d, d).status;
    ++result_.solved_columns;
    if (!status.ok() && status.code != StatusCode::accuracy_not_reached) throw Error(status);
    worst = std::max(worst, kEps * largest(d) / size);
  }
  return worst;
}

Solved Sweep::solve(double frequency, bool keep) {
  constexpr double kUndetermined = 1e-3;
  shop_.interruption.check();
  const double w = 2 * std::numbers::pi * frequency;
  const std::vector<Complex>& values = z_.evaluate(w);
  if (solver_.state() == ComplexSolver::State::empty) analyze(frequency);
  Solved out;
  out.point.frequency = frequency;
  std::vector<Complex> x(loads_.begin(), loads_.end());
  {
    const base::Stopwatch watch(result_.seconds.factorization);
    out.point.status = solver_.refactorize(values).status;
    ++result_.factorizations;
  }
  const base::Stopwatch watch(result_.seconds.solves);
  double rounding = 0;
  if (out.point.status.ok()) {
    const SolveResult r = solver_.solve(x, x, columns_);
    result_.solved_columns += columns_;
    out.point.status = r.status;
    out.point.backward_error = r.backward_error;
    if (r.status.ok()) rounding = rounding_of(w, x, z_.norm(w));
  }
  const StatusCode code = out.point.status.code;
  if (code == StatusCode::singular || !(rounding <= kUndetermined)) {
    out.point.status = {StatusCode::singular,
                        fmt::format("frequency {:.17g} lies on a resonance without damping (or the system is singular "
                                    "for another reason: {}); add damping, or choose another frequency",
                                    frequency,
                                    code == StatusCode::singular ? out.point.status.message
                                                                 : "rounding of the entries alone decides the answer"),
                        out.point.status.row};
    out.point.backward_error = kNan;
    x.assign(x.size(), {kNan, kNan});
  } else if (!out.point.status.ok() && code != StatusCode::accuracy_not_reached) {
    throw Error(out.point.status);
  }
  const auto n = static_cast<std::size_t>(z_.n());
  out.outputs.reserve(outputs());
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns_); ++c)
    for (std::size_t o = 0; o < observed(); ++o) out.outputs.push_back(x[c * n + unknown(o)]);
  if (keep) {
    result_.shape_frequencies.push_back(frequency);
    result_.shapes.insert(result_.shapes.end(), x.begin(), x.end());
  }
  return out;
}

}  // namespace espalier::harmonic
