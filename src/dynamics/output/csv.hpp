/// \file
/// Chosen quantities over time as comma-separated values.
#pragma once

#include <fstream>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// One column: a name (with its unit, for instance "tip y [m]") and its value in a state.
struct CsvColumn {
  std::string name;
  std::function<double(const StateView&)> value;
};

/// Writes a header and one line per call; the first column is time. Numbers have 17 significant digits or fewer where
/// that is exact (they read back to the same bits). Names with commas or quotes are quoted (RFC 4180).
class CsvWriter {
 public:
  /// @param keep_until lines of an existing file with the same header up to this time are kept (a restarted run); NaN:
  /// none @throws Error(invalid_input) when the file cannot be opened, or is to be kept and has other columns
  CsvWriter(std::string path, std::vector<CsvColumn> columns,
            double keep_until = std::numeric_limits<double>::quiet_NaN());
  /// Time of the last line kept; NaN: none.
  [[nodiscard]] double kept() const { return kept_; }
  /// Appends the values of one state and flushes. @throws Error(invalid_input) when writing fails
  void write(const StateView& state);
  [[nodiscard]] std::int64_t lines() const { return lines_; }

 private:
  std::string path_;
  std::vector<CsvColumn> columns_;
  std::ofstream out_;
  std::int64_t lines_ = 0;
  double kept_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace espalier::dynamics
