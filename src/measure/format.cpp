#include "measure/format.hpp"

#include <fmt/format.h>

#include <cmath>
#include <initializer_list>
#include <utility>

namespace espalier::measure {

namespace {

std::string scaled(double value, std::initializer_list<std::pair<double, const char*>> units) {
  for (const auto& [unit, name] : units)
    if (std::abs(value) >= unit * 0.9995) return fmt::format("{:.3g} {}", value / unit, name);
  return fmt::format("{:.3g}", value);
}

}  // namespace

std::string seconds_text(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  return scaled(seconds, {{1, "s"}, {1e-3, "ms"}, {1e-6, "µs"}, {0, "µs"}});
}

std::string count_text(double count) {
  if (!std::isfinite(count)) return "-";
  if (std::abs(count) >= 1e10) return fmt::format("{:.3g}", count);
  std::string digits = fmt::format("{:.0f}", count);
  for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3) digits.insert(static_cast<std::size_t>(at), ",");
  return digits;
}

std::string bytes_text(double bytes) {
  if (!std::isfinite(bytes)) return "-";
  return scaled(bytes, {{1e9, "GB"}, {1e6, "MB"}, {1e3, "kB"}, {0, "B"}});
}

std::string rate_text(double flops_per_second) {
  if (!std::isfinite(flops_per_second)) return "-";
  return scaled(flops_per_second, {{1e12, "TFLOP/s"}, {1e9, "GFLOP/s"}, {1e6, "MFLOP/s"}, {0, "FLOP/s"}});
}

std::string percent_text(double fraction) {
  return std::isfinite(fraction) ? fmt::format("{:.1f} %", 1e2 * fraction) : "-";
}

std::string factor_text(double factor) { return std::isfinite(factor) ? fmt::format("{:.2f}", factor) : "-"; }

std::string error_text(double error) { return std::isfinite(error) ? fmt::format("{:.1e}", error) : "-"; }

}  // namespace espalier::measure
