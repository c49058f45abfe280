#include "evidence/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "evidence/scale.hpp"

namespace espalier::cli::evidence {

namespace {

constexpr double kWidth = 760, kRight = 30, kTop = 12;
constexpr double kLineHeight = 300, kLineLeft = 74, kAxisHeight = 46;
constexpr double kRowHeight = 26;
constexpr int kColours = 8;

using Out = std::back_insert_iterator<std::string>;

struct Canvas {
  std::string text;
  template <class... T>
  void add(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(Out(text), format, std::forward<T>(values)...);
  }
};

int colour_of(const std::vector<Series>& series, std::size_t k) {
  if (series[k].colour >= 0) return series[k].colour % kColours + 1;
  return static_cast<int>(k) % kColours + 1;
}

/// Circle, square, triangle or diamond: told apart without colour, too.
void add_mark(Canvas& canvas, std::size_t shape, int colour, double x, double y, const std::string& title) {
  constexpr double r = 4.5;
  canvas.add("<g class=\"mark\" fill=\"var(--s{})\">", colour);
  switch (shape % 4) {
    case 0:
      canvas.add("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\"/>", x, y, r);
      break;
    case 1:
      canvas.add("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>", x - r + 0.5, y - r + 0.5,
                 2 * r - 1, 2 * r - 1);
      break;
    case 2:
      canvas.add("<path d=\"M{:.1f} {:.1f}l{:.1f} {:.1f}h{:.1f}z\"/>", x, y - r - 0.5, r + 0.5, 2 * r, -2 * r - 1);
      break;
    default:
      canvas.add("<path d=\"M{:.1f} {:.1f}l{:.1f} {:.1f}l{:.1f} {:.1f}l{:.1f} {:.1f}z\"/>", x, y - r - 1, r + 1, r + 1,
                 -r - 1, r + 1, -r - 1, -r - 1);
  }
  canvas.add("<title>{}</title></g>", escaped(title));
}

void open_svg(Canvas& canvas, double height, const std::string& title) {
  canvas.add("<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n", kWidth, height, escaped(title));
}

/// Vertical grid lines with tick labels below, and the axis' name.
void add_x_axis(Canvas& canvas, const Scale& scale, const Axis& axis, double left, double bottom) {
  for (const double tick : scale.ticks()) {
    const double x = scale.pixel(tick);
    canvas.add("<line class=\"grid\" x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{0:.1f}\" y2=\"{2:.1f}\"/>", x, kTop, bottom);
    canvas.add("<text class=\"tick\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>", x, bottom + 17,
               escaped(scale.label(tick)));
  }
  canvas.add("<text class=\"axis\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
             (left + kWidth - kRight) / 2, bottom + 38, escaped(axis.label));
}

void add_y_axis(Canvas& canvas, const Scale& scale, const Axis& axis, double left, double bottom) {
  for (const double tick : scale.ticks()) {
    const double y = scale.pixel(tick);
    canvas.add("<line class=\"grid\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>", left, y,
               kWidth - kRight, y);
    canvas.add("<text class=\"tick\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", left - 8, y + 4,
               escaped(scale.label(tick)));
  }
  canvas.add("<text class=\"axis\" transform=\"translate(14 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
             (kTop + bottom) / 2, escaped(axis.label));
}

/// The legend stands outside the drawing, as text that wraps.
std::string with_legend(const std::string& title, const std::vector<Series>& series, const std::string& drawing) {
  Canvas canvas;
  canvas.add("<figure><figcaption>{}</figcaption>", escaped(title));
  if (series.size() > 1) {
    canvas.add("<ul class=\"legend\">");
    for (std::size_t k = 0; k < series.size(); ++k) {
      canvas.add("<li><svg viewBox=\"0 0 26 14\" width=\"26\" height=\"14\" aria-hidden=\"true\">");
      if (series[k].line)
        canvas.add("<line x1=\"1\" y1=\"7\" x2=\"25\" y2=\"7\" stroke=\"var(--s{})\" class=\"curve{}\"/>",
                   colour_of(series, k), series[k].dashed ? " dashed" : "");
      if (series[k].marks) add_mark(canvas, k, colour_of(series, k), 13, 7, series[k].name);
      canvas.add("</svg>{}</li>", escaped(series[k].name));
    }
    canvas.add("</ul>");
  }
  canvas.text += drawing;
  canvas.add("</figure>\n");
  return canvas.text;
}

void add_curve(Canvas& canvas, const Series& series, int colour, const Scale& x, const Scale& y) {
  std::string path;
  for (const Point& p : series.points) {
    if (!x.shows(p.x) || !y.shows(p.y)) continue;
    path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x.pixel(p.x), y.pixel(p.y));
  }
  canvas.add("<path class=\"curve{}\" stroke=\"var(--s{})\" d=\"{}\"/>\n", series.dashed ? " dashed" : "", colour,
             path);
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string svg(const LinePlot& plot) {
  std::vector<double> xs, ys;
  for (const Series& s : plot.series)
    for (const Point& p : s.points) {
      xs.push_back(p.x);
      ys.push_back(p.y);
    }
  const double bottom = kTop + kLineHeight;
  const Scale x(plot.x, xs, kLineLeft, kWidth - kRight), y(plot.y, ys, bottom, kTop);
  if (x.empty() || y.empty()) return "";
  Canvas canvas;
  open_svg(canvas, bottom + kAxisHeight, plot.title);
  add_y_axis(canvas, y, plot.y, kLineLeft, bottom);
  add_x_axis(canvas, x, plot.x, kLineLeft, bottom);
  for (std::size_t k = 0; k < plot.series.size(); ++k)
    if (plot.series[k].line) add_curve(canvas, plot.series[k], colour_of(plot.series, k), x, y);
  for (std::size_t k = 0; k < plot.series.size(); ++k)
    for (const Point& p : plot.series[k].points)
      if (plot.series[k].marks && x.shows(p.x) && y.shows(p.y))
        add_mark(canvas, k, colour_of(plot.series, k), x.pixel(p.x), y.pixel(p.y), p.title);
  canvas.add("</svg>\n");
  return with_legend(plot.title, plot.series, canvas.text);
}

std::string svg(const DotPlot& plot) {
  std::vector<double> xs;
  std::size_t longest = 8;
  for (const std::string& row : plot.rows) longest = std::max(longest, row.size());
  for (const Series& s : plot.series)
    for (const Point& p : s.points) xs.push_back(p.x);
  const double left = std::min(300.0, 16 + 7.2 * static_cast<double>(longest));
  const double bottom = kTop + kRowHeight * static_cast<double>(plot.rows.size());
  const Scale x(plot.x, xs, left + 8, kWidth - kRight - 8);
  if (x.empty()) return "";
  Canvas canvas;
  open_svg(canvas, bottom + kAxisHeight, plot.title);
  add_x_axis(canvas, x, plot.x, left, bottom);
  for (std::size_t r = 0; r < plot.rows.size(); ++r) {
    const double y = kTop + kRowHeight * (static_cast<double>(r) + 0.5);
    canvas.add("<line class=\"row\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>", left, y,
               kWidth - kRight, y);
    canvas.add("<text class=\"label\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", left - 8, y + 4,
               escaped(plot.rows[r]));
  }
  for (std::size_t k = plot.series.size(); k-- > 0;)  // the first series lies on top
    for (const Point& p : plot.series[k].points)
      if (x.shows(p.x))
        add_mark(canvas, k, colour_of(plot.series, k), x.pixel(p.x), kTop + kRowHeight * (p.y + 0.5), p.title);
  canvas.add("</svg>\n");
  std::vector<Series> legend = plot.series;
  for (Series& s : legend) s.line = false;
  return with_legend(plot.title, legend, canvas.text);
}

std::string svg(const TimelinePlot& plot) {
  if (plot.tracks.empty() || !(plot.seconds > 0)) return "";
  constexpr double kTrack = 16;
  const double left = 236, bottom = kTop + (kTrack + 4) * static_cast<double>(plot.tracks.size());
  const Scale x({"time", AxisUnit::seconds, false, true}, {0, plot.seconds}, left, kWidth - kRight);
  Canvas canvas;
  open_svg(canvas, bottom + kAxisHeight, plot.title);
  add_x_axis(canvas, x, {"time since the first task", AxisUnit::seconds}, left, bottom);
  for (std::size_t k = 0; k < plot.tracks.size(); ++k) {
    const auto& track = plot.tracks[k];
    const double y = kTop + (kTrack + 4) * static_cast<double>(k);
    const double busy = track.busy_seconds / plot.seconds, waiting = track.waiting_seconds / plot.seconds;
    canvas.add("<text class=\"label\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}, {:.0f} % busy</text>", left - 8,
               y + 12, escaped(track.name), 1e2 * busy);
    canvas.add(
        "<rect class=\"idle\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.0f}\"><title>{}: {:.1f} % busy, "
        "{:.1f} % "
        "waiting for others inside tasks</title></rect>",
        left, y, x.pixel(plot.seconds) - left, kTrack, escaped(track.name), 1e2 * busy, 1e2 * waiting);
    for (std::size_t i = 0; i < track.busy.size(); ++i) {
      const auto& [begin, end] = track.busy[i];
      const double width = std::max(0.3, x.pixel(end) - x.pixel(begin));
      canvas.add("<rect class=\"busy\" x=\"{:.2f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.0f}\"/>", x.pixel(begin),
                 y, width, kTrack);
      // Where in the interval its tasks waited is not kept: the share is drawn, from the left, in the lower half.
      const double waited = i < track.waiting.size() && end > begin ? width * track.waiting[i] / (end - begin) : 0;
      if (waited > 0.3)
        canvas.add("<rect class=\"waiting\" x=\"{:.2f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.0f}\"/>",
                   x.pixel(begin), y + kTrack / 2, std::min(waited, width), kTrack / 2);
    }
    canvas.add("\n");
  }
  canvas.add("</svg>\n");
  return with_legend(plot.title, {}, canvas.text);
}

}  // namespace espalier::cli::evidence
