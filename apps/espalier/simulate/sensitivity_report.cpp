#include "simulate/sensitivity_report.hpp"

#include <fmt/format.h>

#include <iterator>

namespace espalier::cli {

std::string sensitivity_summary(const SensitivityResult& r) {
  std::string text = fmt::format("{:<28} {:>16}", "derivatives at the end by", "value");
  for (const std::string& p : r.parameters) text += fmt::format(" {:>24}", p);
  text += fmt::format("\n{:<28} {:>16}", "", "");
  for (const double v : r.parameter_values) text += fmt::format(" {:>24.9g}", v);
  text += "\n";
  const std::size_t np = r.parameters.size();
  for (const std::string& q : r.quantities) {
    text += fmt::format("{:<28} {:>16.9g}", q, r.value(q));
    for (const std::string& p : r.parameters) text += fmt::format(" {:>24.9g}", r.derivative(q, p));
    text += "\n";
  }
  for (std::size_t i = 0; i < r.modes.frequencies.size(); ++i) {
    text += fmt::format("{:<28} {:>16.9g}", fmt::format("frequency {}", i + 1), r.modes.frequencies[i]);
    for (std::size_t p = 0; p < np; ++p) text += fmt::format(" {:>24.9g}", r.modes.derivatives[i * np + p]);
    text += "\n";
  }
  return text + fmt::format("{} {:.1e}\n",
                            r.adjoint ? "adjoint method: tangents and differences of the equations agree to"
                                      : "linear equations of the derivatives solved to",
                            r.defect);
}

std::string sensitivity_csv(const SensitivityResult& r) {
  std::string text = "t";
  for (const std::string& q : r.quantities) {
    text += "," + q;
    for (const std::string& p : r.parameters) text += fmt::format(",d({})/d({})", q, p);
  }
  text += "\n";
  const std::size_t nq = r.quantities.size(), np = r.parameters.size();
  const auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    fmt::format_to(out, "{}", r.t[i]);
    for (std::size_t q = 0; q < nq; ++q) {
      fmt::format_to(out, ",{}", r.values[i * nq + q]);
      for (std::size_t p = 0; p < np; ++p) fmt::format_to(out, ",{}", r.derivatives[(i * nq + q) * np + p]);
    }
    text += "\n";
  }
  return text;
}

}  // namespace espalier::cli
