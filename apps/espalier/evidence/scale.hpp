/// \file
/// From numbers to pixels: axes with round ticks.
#pragma once

#include <string>
#include <vector>

#include "evidence/plot.hpp"

namespace espalier::cli::evidence {

/// Maps the range of some values to pixels.
class Scale {
 public:
  /// Covers all finite values (positive ones, where the axis is logarithmic). @pre from != to
  Scale(const Axis& axis, const std::vector<double>& values, double from, double to);

  [[nodiscard]] bool empty() const { return empty_; }
  [[nodiscard]] bool shows(double value) const;
  [[nodiscard]] double pixel(double value) const;
  [[nodiscard]] const std::vector<double>& ticks() const { return ticks_; }
  [[nodiscard]] std::string label(double tick) const;

 private:
  void place_decades();
  void place_round();

  Axis axis_;
  double from_, to_;
  double low_ = 0, high_ = 1;  // of the values; logarithms where the axis is logarithmic
  bool empty_ = true;
  std::vector<double> ticks_;
};

}  // namespace espalier::cli::evidence
