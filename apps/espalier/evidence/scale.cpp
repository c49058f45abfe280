#include "evidence/scale.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "measure/format.hpp"

namespace espalier::cli::evidence {

using measure::bytes_text;
using measure::count_text;
using measure::seconds_text;

Scale::Scale(const Axis& axis, const std::vector<double>& values, double from, double to)
    : axis_(axis), from_(from), to_(to) {
  for (const double value : values) {
    if (!std::isfinite(value) || (axis.logarithmic && !(value > 0))) continue;
    const double at = axis.logarithmic ? std::log10(value) : value;
    low_ = empty_ ? at : std::min(low_, at);
    high_ = empty_ ? at : std::max(high_, at);
    empty_ = false;
  }
  if (empty_) return;
  if (axis.logarithmic)
    place_decades();
  else
    place_round();
}

// Decades, with 2 and 5 between them where the range is short.
void Scale::place_decades() {
  if (high_ - low_ < 0.3) {
    const double middle = (low_ + high_) / 2;
    low_ = middle - 0.15;
    high_ = middle + 0.15;
  }
  const double margin = 0.04 * (high_ - low_);
  low_ -= margin;
  high_ += margin;
  const std::vector<double> digits = high_ - low_ > 3.2   ? std::vector<double>{1}
                                     : high_ - low_ > 1.6 ? std::vector<double>{1, 3}
                                                          : std::vector<double>{1, 2, 5};
  const int stride = std::max(1, static_cast<int>((high_ - low_) / 8));
  for (int decade = static_cast<int>(std::floor(low_)); decade <= static_cast<int>(std::ceil(high_)); decade += stride)
    for (const double digit : digits) {
      const double at = decade + std::log10(digit);
      if (at >= low_ && at <= high_) ticks_.push_back(std::pow(10.0, at));
    }
}

void Scale::place_round() {
  if (axis_.from_zero) low_ = std::min(low_, 0.0);
  if (high_ <= low_) high_ = low_ + 1;
  const double rough = (high_ - low_) / 5;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double digit = rough / power;
  const double round = power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
  const double step = axis_.whole ? std::max(1.0, round) : round;
  high_ = std::ceil(high_ / step - 1e-9) * step;
  low_ = std::floor(low_ / step + 1e-9) * step;
  for (int k = 0; low_ + k * step <= high_ + step / 2; ++k) ticks_.push_back(low_ + k * step);
}

bool Scale::shows(double value) const { return std::isfinite(value) && (!axis_.logarithmic || value > 0); }

double Scale::pixel(double value) const {
  const double at = axis_.logarithmic ? std::log10(value) : value;
  return from_ + (to_ - from_) * (at - low_) / (high_ - low_);
}

std::string Scale::label(double tick) const {
  switch (axis_.unit) {
    case AxisUnit::seconds:
      return tick == 0 ? "0" : seconds_text(tick);
    case AxisUnit::percent:
      return fmt::format("{:.3g} %", 1e2 * tick);
    case AxisUnit::bytes:
      return bytes_text(tick);
    case AxisUnit::number:
      break;
  }
  return std::abs(tick) >= 1e7   ? fmt::format("{:.0e}", tick)
         : std::abs(tick) >= 1e3 ? count_text(tick)
                                 : fmt::format("{:.3g}", tick);
}

}  // namespace espalier::cli::evidence
