/// \file
/// Plots as inline SVG. Colours are CSS variables of the page (--s1 ... --s8, --ink, --faint), so that they follow its
/// light and dark themes; every mark has a title for the pointer and for screen readers.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace espalier::cli::evidence {

enum class AxisUnit { number, seconds, percent, bytes };

struct Axis {
  std::string label;  ///< with its unit in words; tick labels carry units of their own
  AxisUnit unit = AxisUnit::number;
  bool logarithmic = false;
  bool from_zero = false;  ///< linear axes: begin at 0
  bool whole = false;      ///< linear axes: ticks at whole numbers only
};

struct Point {
  double x = 0, y = 0;
  std::string title;  ///< for the pointer
};

struct Series {
  std::string name;
  std::vector<Point> points;
  bool line = true, marks = true, dashed = false;
  int colour = -1;  ///< -1: by its place among the series
};

/// Curves over a plane.
struct LinePlot {
  std::string title;
  Axis x, y;
  std::vector<Series> series;
};

/// One row of labelled places, each with a mark per series: for comparing few numbers exactly (Cleveland's dot plot).
struct DotPlot {
  std::string title;
  Axis x;
  std::vector<std::string> rows;
  std::vector<Series> series;  ///< y is the number of the row; points are not joined
};

/// Busy intervals of workers; what is left white is idle.
struct TimelinePlot {
  struct Track {
    std::string device, name;
    std::vector<std::pair<double, double>> busy;  ///< seconds
    std::vector<double> waiting;                  ///< of each interval, seconds; empty: not known
    double busy_seconds = 0, waiting_seconds = 0;
  };
  std::string title;
  double seconds = 0;
  std::vector<Track> tracks;
};

/// Empty text where there is nothing to draw.
std::string svg(const LinePlot& plot);
std::string svg(const DotPlot& plot);
std::string svg(const TimelinePlot& plot);

/// &, <, > and quotes as entities.
std::string escaped(const std::string& text);

}  // namespace espalier::cli::evidence
