#include "espalier/harmonic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/memory.hpp"
#include "base/stage.hpp"
#include "base/stopwatch.hpp"
#include "harmonic/adaptive.hpp"
#include "harmonic/respond.hpp"
#include "matrix/file.hpp"

namespace espalier {

namespace {

using harmonic::Complex;

void refuse(const std::string& text) { throw Error(StatusCode::invalid_input, text); }

void check_frequency(double f, const char* name) {
  if (!(f >= 0) || !std::isfinite(f)) refuse(fmt::format("{} = {:g}: frequencies are numbers of at least 0", name, f));
}

// The frequencies asked for, rising.
std::vector<double> wanted_frequencies(const HarmonicOptions& o) {
  for (const double f : o.shapes_at) check_frequency(f, "shapes_at");
  if (!o.frequencies.empty()) {
    for (std::size_t i = 0; i < o.frequencies.size(); ++i) {
      check_frequency(o.frequencies[i], "frequencies");
      if (i > 0 && !(o.frequencies[i] > o.frequencies[i - 1]))
        refuse(fmt::format("frequencies: {:g} follows {:g}; they must rise", o.frequencies[i], o.frequencies[i - 1]));
    }
    return o.frequencies;
  }
  check_frequency(o.from, "from");
  check_frequency(o.to, "to");
  if (!(o.to > o.from)) refuse(fmt::format("to = {:g}: must be above from = {:g}", o.to, o.from));
  constexpr Index kMost = 10'000'000;
  if (o.points < 2 || o.points > kMost) refuse(fmt::format("points = {}: give 2 to {}", o.points, kMost));
  if (o.logarithmic && !(o.from > 0)) refuse("from = 0: equal ratios need a frequency above 0");
  std::vector<double> out;
  for (Index i = 0; i < o.points; ++i) {
    const double part = static_cast<double>(i) / (o.points - 1);
    out.push_back(i == 0              ? o.from
                  : i == o.points - 1 ? o.to
                  : o.logarithmic     ? o.from * std::pow(o.to / o.from, part)
                                      : o.from + part * (o.to - o.from));
    if (i > 0 && !(out[static_cast<std::size_t>(i)] > out[static_cast<std::size_t>(i) - 1]))
      refuse(fmt::format("points = {}: so many cannot be told apart from {:g} to {:g}", o.points, o.from, o.to));
  }
  return out;
}

void check_options(const HarmonicOptions& o, Index n) {
  if (o.tolerance != 0 && !(o.tolerance >= 1e-10 && o.tolerance <= 0.1))
    refuse(fmt::format("tolerance = {:g}: give 0 (a solve at each frequency), or 1e-10 to 0.1", o.tolerance));
  if (!(o.loss_factor >= 0) || !std::isfinite(o.loss_factor))
    refuse(fmt::format("loss_factor = {:g}: give a number of at least 0", o.loss_factor));
  if (o.max_solves < 16) refuse(fmt::format("max_solves = {}: give at least 16", o.max_solves));
  for (const Index i : o.observed)
    if (i < 0 || i >= n) refuse(fmt::format("observed: {} is none of the {} unknowns (counted from 0)", i, n));
}

void check_loads(std::span<const Complex> loads, Index columns, Index n) {
  if (columns < 1) refuse("no load is given");
  const auto rows = static_cast<std::size_t>(n);
  if (loads.size() != rows * static_cast<std::size_t>(columns))
    refuse(fmt::format("the loads have {} values; {} columns of {} rows are {}", loads.size(), columns, n,
                       rows * static_cast<std::size_t>(columns)));
  for (Index c = 0; c < columns; ++c) {
    bool any = false;
    for (std::size_t i = 0; i < rows; ++i) {
      const Complex v = loads[static_cast<std::size_t>(c) * rows + i];
      if (!std::isfinite(v.real()) || !std::isfinite(v.imag()))
        throw Error(StatusCode::invalid_input, fmt::format("load {}: row {} is not finite", c, i),
                    static_cast<Index>(i));
      any = any || v != 0.0;
    }
    if (!any) refuse(fmt::format("load {} is zero everywhere: there is no response", c));
  }
}

// All responses lie in memory at once.
void check_room(const HarmonicResult& r, std::size_t points, Offset limit) {
  const double bytes = sizeof(Complex) * static_cast<double>(points) * r.loads * r.outputs;
  const Offset room = limit > 0 ? limit : matrix::machine_memory();
  if (bytes <= static_cast<double>(room)) return;
  throw Error(
      StatusCode::out_of_memory,
      fmt::format("{} points of {} responses to {} loads would take {:.3g} bytes, and there are {}: ask for fewer "
                  "points, or observe fewer",
                  points, r.outputs, r.loads, bytes, base::format_bytes(room)));
}

class Run {
 public:
  Run(std::span<const Complex> loads, const HarmonicOptions& options, modes::Resources& shop, HarmonicResult& result,
      const harmonic::DynamicStiffness& z, std::vector<double> wanted, harmonic::Observer& observer)
      : loads_(loads),
        options_(options),
        result_(result),
        z_(z),
        sweep_(z, loads, result.loads, options, shop, result, observer),
        wanted_(std::move(wanted)),
        shapes_(options.shapes_at) {
    std::sort(shapes_.begin(), shapes_.end());
    shapes_.erase(std::unique(shapes_.begin(), shapes_.end()), shapes_.end());
  }

  void solve_all() {
    std::vector<double> all;
    std::set_union(wanted_.begin(), wanted_.end(), shapes_.begin(), shapes_.end(), std::back_inserter(all));
    std::vector<char> keep;
    for (const double f : all) keep.push_back(static_cast<char>(std::binary_search(shapes_.begin(), shapes_.end(), f)));
    for (harmonic::Solved& s : sweep_.solve(all, keep)) {
      result_.responses.insert(result_.responses.end(), s.outputs.begin(), s.outputs.end());
      result_.points.push_back(std::move(s.point));
    }
  }

  void interpolate(modes::Resources& shop) {
    const double from = wanted_.front(), to = wanted_.back();
    if (!(to > from)) refuse("a tolerance needs a range of frequencies, and one alone is given");
    harmonic::Adaptive adaptive(sweep_, options_, result_, from, to, z_.damped());
    harmonic::Resonances expected;
    expected.completeness = "resonances were not sought";
    std::vector<char> excited;
    const Status status = modes::guarded(shop, [&] {
      if (options_.seek_resonances) {
        const base::Stopwatch watch(result_.seconds.modes);
        expected = find_resonances(z_, loads_, result_.loads, sweep_, from, to, options_);
      }
      excited.assign(expected.all.size(), 0);
      adaptive.add(shapes_, true);
      adaptive.run(expected.all, excited);
      adaptive.solve_beside_singular(wanted_);
    });
    result_.complete = expected.complete && status.ok();
    result_.completeness = expected.completeness;
    for (std::size_t i = 0; i < expected.all.size(); ++i)
      result_.resonances.push_back({expected.all[i].frequency, expected.all[i].half_width, excited[i] != 0});
    adaptive.deliver(wanted_);
    if (!status.ok()) throw Error(status);
  }

  // What single points say of themselves.
  void judge() const {
    std::size_t singular = 0, inexact = 0;
    const HarmonicPoint *first = nullptr, *worst = nullptr;
    for (const HarmonicPoint& p : result_.points) {
      if (p.status.code == StatusCode::singular) {
        ++singular;
        if (first == nullptr) first = &p;
      } else if (!p.status.ok()) {
        ++inexact;
        if (worst == nullptr || p.backward_error > worst->backward_error) worst = &p;
      }
    }
    if (singular > 0)
      throw Error(StatusCode::singular,
                  singular == 1
                      ? first->status.message
                      : fmt::format("{} of {} frequencies: {}", singular, result_.points.size(), first->status.message),
                  first->status.row);
    if (inexact > 0)
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("{} of {} solutions are not as exact as they should be, the worst at frequency {:g}: {}",
                              inexact, result_.points.size(), worst->frequency, worst->status.message));
  }

 private:
  std::span<const Complex> loads_;
  const HarmonicOptions& options_;
  HarmonicResult& result_;
  const harmonic::DynamicStiffness& z_;
  harmonic::Sweep sweep_;
  std::vector<double> wanted_, shapes_;
};

}  // namespace

namespace harmonic {

HarmonicResult respond(const MatrixView& k, const MatrixView& c, const MatrixView& m, std::span<const Complex> loads,
                       Index columns, const HarmonicOptions& options, Observer* observer,
                       const MatrixView& structural) {
  HarmonicResult result;
  const base::Stopwatch watch(result.seconds.total);
  modes::Resources shop(options.solver);
  result.status = modes::guarded(shop, [&] {
    std::vector<double> wanted = wanted_frequencies(options);
    check_options(options, k.rows);
    const DynamicStiffness z(k, c, m, options.loss_factor, shop.pool, structural);
    check_loads(loads, columns, z.n());
    UnknownObserver unknowns(options.observed, z.n());
    if (observer == nullptr) observer = &unknowns;
    result.n = z.n();
    result.loads = columns;
    result.outputs = observer->outputs();
    check_room(result, wanted.size(), options.solver.host_memory_bytes);
    // Where the answers choose the frequencies nobody knows how many there will be.
    const double total = options.tolerance > 0 ? 0 : static_cast<double>(wanted.size());
    const base::Stage stage("frequency response", total, "frequencies");
    Run run(loads, options, shop, result, z, std::move(wanted), *observer);
    if (options.tolerance > 0)
      run.interpolate(shop);
    else
      run.solve_all();
    run.judge();
  });
  return result;
}

}  // namespace harmonic

HarmonicResult harmonic_response(const MatrixView& k, const MatrixView& c, const MatrixView& m,
                                 std::span<const std::complex<double>> loads, Index columns,
                                 const HarmonicOptions& options) {
  return harmonic::respond(k, c, m, loads, columns, options, nullptr);
}

}  // namespace espalier
