/// \file
/// The quantities of a run as rows over time, as many as a page can hold.
#pragma once

#include <string>
#include <vector>

#include "espalier/dynamics.hpp"

namespace espalier::dynamics::page {

class Rows {
 public:
  void begin(std::vector<std::string> names);
  /// One number for each name. Of too many rows every second one is dropped from then on.
  void add(double t, const std::vector<double>& values);
  void restore(double t);  ///< later rows go
  [[nodiscard]] bool ends_at(double t) const { return !last_.empty() && last_[0] == t; }
  [[nodiscard]] bool empty() const { return t_.empty(); }
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  [[nodiscard]] long stride() const { return stride_; }  ///< of every so many, one is there
  /// Times, then the values of each name; the last row that was added is always there.
  [[nodiscard]] std::vector<double> columns() const;
  [[nodiscard]] SimulationSeries series() const;  ///< the same, row by row

 private:
  void thin_out();
  std::vector<std::string> names_;
  std::vector<double> t_, values_;
  std::vector<double> last_;  // time and values
  long stride_ = 1, seen_ = 0;
};

/// The rows of a series that is in memory already.
[[nodiscard]] Rows rows_of(const SimulationSeries& series);

}  // namespace espalier::dynamics::page
