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
///
/// A restarted run keeps the lines up to its start. Those behind it, of a run that got further, stay in the file until
/// new ones have taken their place: new lines are kept in memory until they reach beyond the last old one. So a run
/// that dies early leaves no shorter history than it found.
class CsvWriter {
 public:
  /// @param keep_until lines of an existing file with the same header up to this time are kept (a restarted run); NaN:
  /// none. A last line that was cut off (by a full disk, or a kill) is dropped.
  /// @throws Error(invalid_input) when the file cannot be opened, or is to be kept and has other columns or a damaged
  /// line
  CsvWriter(std::string path, std::vector<CsvColumn> columns,
            double keep_until = std::numeric_limits<double>::quiet_NaN());
  /// Time of the last line kept; NaN: none.
  [[nodiscard]] double kept() const { return kept_; }
  /// Appends the values of one state and flushes. @throws Error(invalid_input) when writing fails
  void write(const StateView& state);
  /// Puts all lines written so far into the file; older ones for later times stay behind them. To be called before a
  /// restart file is written: the next run keeps what it finds before its start.
  void catch_up();
  /// The run has reached its end: older lines for later times are dropped.
  void finish();
  [[nodiscard]] std::int64_t lines() const { return lines_; }

 private:
  struct Line {
    double time;
    std::string text;  // with its end
  };
  void resume(const std::string& header, double keep_until);
  [[nodiscard]] Line read_line(std::string text, std::int64_t number) const;
  /// Replaces the file by its first kept_bytes_ bytes, the new lines, and those of `later_` from first_later_ on.
  void rewrite();
  void open_to_append();

  std::string path_;
  std::vector<CsvColumn> columns_;
  std::ofstream out_;
  std::int64_t lines_ = 0;
  double kept_ = std::numeric_limits<double>::quiet_NaN();
  std::uintmax_t kept_bytes_ = 0;  // of the file: what stays at its beginning
  std::string fresh_;              // new lines that are not in the file
  std::vector<Line> later_;        // old lines for later times
  std::size_t first_later_ = 0;    // before it: overtaken
};

}  // namespace espalier::dynamics
