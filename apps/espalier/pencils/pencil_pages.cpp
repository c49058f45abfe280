#include "pencils/pencil_pages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/terminal.hpp"
#include "harmonic/table.hpp"

namespace espalier::cli {

namespace {

std::vector<double> numbered(std::size_t count) {
  std::vector<double> list;
  for (std::size_t k = 1; k <= count; ++k) list.push_back(static_cast<double>(k));
  return list;
}

}  // namespace

Sheet modes_sheet(const std::string& source, const ModesResult& r, bool buckling, Sheet::Json report) {
  Sheet sheet(source, std::move(report));
  const std::size_t count = r.eigenvalues.size();
  sheet.set_facts(
      fmt::format("{} of {} unknowns, {}",
                  buckling ? counted(r.count(), "load factor", "load factors") : counted(r.count(), "mode", "modes"),
                  grouped(r.n), r.complete ? "proven complete" : "not proven complete"));
  if (count == 0) return sheet;
  std::vector<double> values = r.eigenvalues;
  if (!buckling)
    for (double& l : values)
      l = l >= 0 ? std::sqrt(l) / (2 * std::numbers::pi) : std::numeric_limits<double>::quiet_NaN();
  const std::string name = buckling ? "load factor" : "frequency";
  sheet.begin_plot(buckling ? "Load factors" : "Frequencies", {"mode"}, {name}, "dots");
  sheet.add_series(name, numbered(count), values);
  sheet.begin_plot("How exact they are", {"mode"}, {"relative", true}, "dots");
  sheet.add_series("residual", numbered(count), r.residuals);
  std::vector<double> bounds;
  for (std::size_t k = 0; k < count; ++k) bounds.push_back(r.error_bounds[k] / std::abs(r.eigenvalues[k]));
  sheet.add_series("error bound over the eigenvalue", numbered(count), bounds);
  return sheet;
}

Sheet quadratic_sheet(const std::string& source, const QuadraticModesResult& r, Sheet::Json report) {
  Sheet sheet(source, std::move(report));
  sheet.set_facts(fmt::format("{} of {} unknowns, with damping", counted(r.count(), "mode", "modes"), grouped(r.n)));
  std::vector<double> real, imaginary;
  for (const std::complex<double>& l : r.eigenvalues) {
    real.push_back(l.real());
    imaginary.push_back(l.imag());
  }
  if (real.empty()) return sheet;
  sheet.begin_plot("Eigenvalues", {"real part"}, {"imaginary part"}, "dots");
  sheet.add_series("eigenvalue", real, imaginary);
  sheet.begin_plot("How exact they are", {"mode"}, {"residual", true}, "dots");
  sheet.add_series("residual", numbered(real.size()), r.residuals);
  return sheet;
}

// A Campbell diagram, where the number is a speed; of one value the modes by their number.
Sheet model_modes_sheet(const std::string& source, const ModelModesResult& r, Sheet::Json report) {
  Sheet sheet(source, std::move(report));
  std::size_t most = 0;
  for (const ModelModesPoint& p : r.points) most = std::max(most, p.modes.size());
  const std::string count = counted(static_cast<Index>(most), "mode", "modes");
  sheet.set_facts(r.number.empty() ? count
                                   : fmt::format("{} for {}", count,
                                                 counted(static_cast<Index>(r.points.size()), "value", "values")));
  if (most == 0) return sheet;
  const bool several = r.points.size() > 1;
  const auto plot = [&](const std::string& title, const std::string& name, double SimulationMode::*member) {
    sheet.begin_plot(title, {several ? r.number : "mode"}, {name}, several ? "line" : "dots");
    std::vector<double> x, y;
    if (!several)
      for (const SimulationMode& m : r.points.front().modes) y.push_back(m.*member);
    if (!several) return sheet.add_series(name, numbered(y.size()), y);
    for (std::size_t k = 0; k < most; ++k, x.clear(), y.clear()) {
      for (const ModelModesPoint& p : r.points) {
        x.push_back(p.value);
        y.push_back(k < p.modes.size() ? p.modes[k].*member : std::numeric_limits<double>::quiet_NaN());
      }
      sheet.add_series(fmt::format("{} {}", name, k + 1), x, y);
    }
  };
  plot("Frequencies", "frequency", &SimulationMode::frequency);
  plot("Damping ratios", "damping ratio", &SimulationMode::damping_ratio);
  return sheet;
}

Sheet harmonic_sheet(const std::string& source, const HarmonicOptions& o, const HarmonicResult& r, Sheet::Json report) {
  constexpr std::size_t kMostCurves = 8;
  Sheet sheet(source, std::move(report));
  const auto all = Offset{r.loads} * r.outputs;
  sheet.set_facts(fmt::format("{}, {} of {} unknowns",
                              counted(static_cast<Index>(r.points.size()), "frequency", "frequencies"),
                              counted(all, "response", "responses"), grouped(r.n)));
  if (r.points.empty()) return sheet;
  std::vector<double> frequencies, errors, estimates;
  for (const HarmonicPoint& p : r.points) {
    frequencies.push_back(p.frequency);
    errors.push_back(p.backward_error);
    estimates.push_back(p.solved ? std::numeric_limits<double>::quiet_NaN() : p.error_estimate);
  }
  std::vector<harmonic::Peak> curves = harmonic::highest(r);
  std::stable_sort(curves.begin(), curves.end(),
                   [](const harmonic::Peak& a, const harmonic::Peak& b) { return a.amplitude > b.amplitude; });
  curves.resize(std::min(curves.size(), kMostCurves));
  const SheetAxis frequency{"frequency", o.logarithmic};
  const std::string some = static_cast<Offset>(curves.size()) < all
                               ? fmt::format(": the {} highest of {}", curves.size(), grouped(all))
                               : "";
  const auto plot = [&](const std::string& title, const SheetAxis& y, double (*part)(std::complex<double>)) {
    sheet.begin_plot(title + some, frequency, y, "line");
    for (const harmonic::Peak& c : curves) {
      std::vector<double> values;
      for (std::size_t p = 0; p < frequencies.size(); ++p) values.push_back(part(r.response(p, c.load, c.output)));
      const Index unknown = o.observed.empty() ? c.output : o.observed[static_cast<std::size_t>(c.output)];
      sheet.add_series(
          r.loads > 1 ? fmt::format("unknown {}, load {}", unknown, c.load) : fmt::format("unknown {}", unknown),
          frequencies, values);
    }
  };
  plot("Amplitudes", {"amplitude", true}, [](std::complex<double> y) { return std::abs(y); });
  plot("Phases", {"degrees"}, harmonic::degrees);
  sheet.begin_plot("How exact they are", frequency, {"relative", true}, "dots");
  sheet.add_series("backward error of what was solved", frequencies, errors);
  if (o.tolerance > 0) sheet.add_series("estimated error of what was interpolated", frequencies, estimates);
  return sheet;
}

}  // namespace espalier::cli
