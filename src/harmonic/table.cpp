#include "harmonic/table.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace espalier::harmonic {

double degrees(std::complex<double> x) { return std::arg(x) * 180 / std::numbers::pi; }

std::vector<Peak> highest(const HarmonicResult& r) {
  std::vector<Peak> out;
  for (Index l = 0; l < r.loads; ++l)
    for (Index i = 0; i < r.outputs; ++i) {
      Peak peak{l, i, 0, -1, 0};
      for (std::size_t p = 0; p < r.points.size(); ++p)
        if (const std::complex<double> x = r.response(p, l, i); std::abs(x) > peak.amplitude)
          peak = {l, i, r.points[p].frequency, std::abs(x), degrees(x)};
      if (peak.amplitude >= 0) out.push_back(peak);
    }
  return out;
}

void write_table(const HarmonicResult& r, const std::vector<std::string>& outputs,
                 const std::vector<std::string>& loads, const std::function<void(std::string_view)>& write) {
  std::string line = "frequency,solved,backward_error,error_estimate";
  for (const std::string& load : loads)
    for (const std::string& output : outputs) line += fmt::format(",amplitude_{0}_{1},phase_{0}_{1}", output, load);
  write(line + "\n");
  const auto number = [](double x) { return std::isnan(x) ? std::string() : fmt::format("{}", x); };
  for (std::size_t p = 0; p < r.points.size(); ++p) {
    const HarmonicPoint& point = r.points[p];
    line = fmt::format("{},{},{},{}", point.frequency, point.solved ? 1 : 0, number(point.backward_error),
                       number(point.error_estimate));
    for (Index l = 0; l < r.loads; ++l)
      for (Index i = 0; i < r.outputs; ++i) {
        const std::complex<double> x = r.response(p, l, i);
        line += fmt::format(",{},{}", number(std::abs(x)), number(degrees(x)));
      }
    write(line + "\n");
  }
}

}  // namespace espalier::harmonic
