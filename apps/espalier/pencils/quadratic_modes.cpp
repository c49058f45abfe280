#include "pencils/quadratic_modes.hpp"

#include <fmt/format.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "common/terminal.hpp"
#include "solve/report.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {
namespace {

double frequency_of(std::complex<double> l) { return std::abs(l.imag()) / (2 * std::numbers::pi); }
double damping_of(std::complex<double> l) { return std::abs(l) > 0 ? -l.real() / std::abs(l) : 0; }

}  // namespace

std::string quadratic_table(const QuadraticModesResult& r) {
  Table table(">>>>>>");
  table.add({"mode", "real part", "imaginary part", "frequency", "damping ratio", "residual"}, Tone::quiet);
  for (std::size_t i = 0; i < r.eigenvalues.size(); ++i) {
    const std::complex<double> l = r.eigenvalues[i];
    table.add({fmt::format("{}", i + 1), fmt::format("{:.9g}", l.real()), fmt::format("{:.9g}", l.imag() + 0.0),
               fmt::format("{:.9g}", frequency_of(l)), fmt::format("{:.6g}", damping_of(l)), small(r.residuals[i])});
  }
  return table.text();
}

nlohmann::ordered_json quadratic_report(const QuadraticModesResult& r, int code) {
  nlohmann::ordered_json modes = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < r.eigenvalues.size(); ++i) {
    const std::complex<double> l = r.eigenvalues[i];
    modes.push_back({{"real", l.real()},
                     {"imaginary", l.imag()},
                     {"frequency", frequency_of(l)},
                     {"damping_ratio", damping_of(l)},
                     {"residual", r.residuals[i]}});
  }
  return {{"espalier", solver::version()},
          {"exit_code", code},
          {"message", r.status.message},
          {"problem", "damped vibration"},
          {"unknowns", r.n},
          {"shift", r.shift},
          {"modes", modes},
          {"factorizations", r.factorizations},
          {"solved_columns", r.solved_columns}};
}

}  // namespace espalier::cli
