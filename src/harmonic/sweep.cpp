#include "harmonic/sweep.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace espalier::harmonic {

Sweep::Sweep(const DynamicStiffness& z, std::span<const Complex> loads, Index columns, const HarmonicOptions& options,
             modes::Resources& shop, HarmonicResult& result, Observer& observer)
    : n_(z.n()),
      columns_(columns),
      result_(result),
      observer_(observer),
      teams_(z, loads, columns, options, shop, result) {}

Solved Sweep::judged(double frequency, Answer answer, bool keep) {
  constexpr double kUndetermined = 1e-3;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  Solved out;
  out.point.frequency = frequency;
  out.point.status = std::move(answer.status);
  out.point.backward_error = answer.backward_error;
  const StatusCode code = out.point.status.code;
  const bool singular = code == StatusCode::singular || !(answer.rounding <= kUndetermined);
  if (singular) {
    out.point.status = {StatusCode::singular,
                        fmt::format("frequency {:.17g} lies on a resonance without damping (or the system is singular "
                                    "for another reason: {}); add damping, or choose another frequency",
                                    frequency,
                                    code == StatusCode::singular ? out.point.status.message
                                                                 : "rounding of the entries alone decides the answer"),
                        out.point.status.row};
    out.point.backward_error = kNan;
    answer.x.assign(answer.x.size(), {kNan, kNan});
  } else if (!out.point.status.ok() && code != StatusCode::accuracy_not_reached) {
    throw Error(out.point.status);
  }
  out.outputs.assign(outputs(), {kNan, kNan});
  const auto n = static_cast<std::size_t>(n_);
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns_) && !singular; ++c)
    observer_.observe(2 * std::numbers::pi * frequency, static_cast<Index>(c), answer.x.data() + c * n,
                      out.outputs.data() + c * observed());
  if (keep) {
    result_.shape_frequencies.push_back(frequency);
    result_.shapes.insert(result_.shapes.end(), answer.x.begin(), answer.x.end());
  }
  return out;
}

std::vector<Solved> Sweep::solve(std::span<const double> frequencies, const std::vector<char>& keep) {
  std::vector<Solved> out;
  const std::size_t most = at_a_time();
  for (std::size_t begin = 0; begin < frequencies.size(); begin += most) {
    const auto some = frequencies.subspan(begin, std::min(most, frequencies.size() - begin));
    std::vector<Answer> answers = teams_.solve(some);
    for (std::size_t i = 0; i < some.size(); ++i)
      out.push_back(judged(some[i], std::move(answers[i]), keep[begin + i] != 0));
  }
  return out;
}

}  // namespace espalier::harmonic
