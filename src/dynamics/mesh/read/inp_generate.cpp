#include "dynamics/mesh/read/inp_generate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace espalier::dynamics {
namespace {

constexpr std::size_t kMostMade = 5000000;
constexpr std::int64_t kMostCopies = 1000000;

Point between(const Point& a, const Point& b, double t) {
  Point p{};
  for (std::size_t d = 0; d < 3; ++d) p[d] = (1 - t) * a[d] + t * b[d];
  return p;
}

/// The parabola through a (t = 0), middle (t = 1/2) and b (t = 1).
Point on_parabola(const Point& a, const Point& middle, const Point& b, double t) {
  Point p{};
  for (std::size_t d = 0; d < 3; ++d)
    p[d] = (1 - t) * (1 - 2 * t) * a[d] + 4 * t * (1 - t) * middle[d] + t * (2 * t - 1) * b[d];
  return p;
}

/// An arc about `centre` from a, against the clock seen from the tip of `normal`; 0: the shorter way.
struct Arc {
  Point centre{}, top{};  // top: centre + normal
  double degrees = 0, first = 0, last = 0;
};
Arc make_arc(const LineReader& reader, const Point& centre, const Point& a, const Point& b, Point normal) {
  Point ra{}, rb{};
  for (std::size_t d = 0; d < 3; ++d) {
    ra[d] = a[d] - centre[d];
    rb[d] = b[d] - centre[d];
  }
  const Point cross = {ra[1] * rb[2] - ra[2] * rb[1], ra[2] * rb[0] - ra[0] * rb[2], ra[0] * rb[1] - ra[1] * rb[0]};
  const auto dot = [](const Point& p, const Point& q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; };
  const bool given = dot(normal, normal) > 0;
  if (!given) normal = cross;
  const double size = std::sqrt(dot(normal, normal));
  Arc arc{centre, centre, 0, std::sqrt(dot(ra, ra)), std::sqrt(dot(rb, rb))};
  if (!(size > 1e-12 * (given ? 0.0 : arc.first * arc.last)) || !(arc.first > 0))
    reader.fail("*NGEN, LINE=C: the ends and the centre lie on one line; give the normal of the arc (fields 8 to 10)");
  for (std::size_t d = 0; d < 3; ++d) arc.top[d] += normal[d] / size;
  arc.degrees = std::atan2(dot(normal, cross) / size, dot(ra, rb)) * 180 / std::numbers::pi;
  if (given && arc.degrees <= 0) arc.degrees += 360;
  return arc;
}
Point on_arc(const Arc& arc, const Point& a, double t) {
  const Point p = turned_about(arc.centre, arc.top, arc.degrees * t, a);
  const double radius = (1 - t) * arc.first + t * arc.last;
  return between(arc.centre, p, radius / arc.first);
}

/// Sums that wrap around instead of overflowing: labels of broken files.
std::int64_t plus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}

/// So small that a million of them is a number still.
std::int64_t small(const LineReader& reader, std::int64_t value) {
  constexpr std::int64_t kMost = 1000000000000;
  if (value < -kMost || value > kMost) reader.fail(fmt::format("{} is no number of a node or an element", value));
  return value;
}

void need_positive(const LineReader& reader, std::int64_t value, const char* what) {
  if (value < 1 || value > kMostCopies)
    reader.fail(fmt::format("{} is {}; 1 to {} are read", what, value, kMostCopies));
}

}  // namespace

InpSet& inp_set(InpSets& sets, const std::string& name) {
  InpSet& set = sets[upper(name)];
  if (set.spelling.empty()) set.spelling = name;
  return set;
}

InpMember inp_labels(std::int64_t first, std::int64_t last, std::int64_t line) {
  InpMember e;
  e.first = first;
  e.last = last;
  e.line = line;
  return e;
}

bool InpGenerator::generate(LineReader& reader, const InpKeyword& k, const InpSystem& system, InpScope& scope,
                            std::int64_t lines_before) {
  scope_ = &scope;
  lines_before_ = lines_before;
  if (k.name == "*NGEN") return lines_of_nodes(reader, k, system), true;
  if (k.name == "*NFILL") return fills(reader, k), true;
  if (k.name == "*NCOPY") return copies_of_nodes(reader, k), true;
  if (k.name == "*ELGEN") return rows_of_elements(reader, k), true;
  if (k.name == "*ELCOPY") return copies_of_elements(reader, k), true;
  return false;
}

void InpGenerator::forget() {
  nodes_.clear();
  elements_.clear();
  nodes_seen_ = elements_seen_ = 0;
}

void InpGenerator::count(const LineReader& reader) {
  if (++made_ > kMostMade)
    reader.fail(fmt::format("the lines up to here make more than {} nodes and elements", kMostMade));
}

Point InpGenerator::node(const LineReader& reader, std::int64_t label) {
  for (; nodes_seen_ < scope_->nodes.size(); ++nodes_seen_) nodes_[scope_->nodes[nodes_seen_].label] = nodes_seen_;
  const auto found = nodes_.find(label);
  if (found == nodes_.end()) reader.fail(fmt::format("node {} is not defined above", label));
  return scope_->nodes[found->second].at;
}

void InpGenerator::add_node(const LineReader& reader, std::int64_t label, const Point& at, InpSet* set) {
  count(reader);
  scope_->nodes.push_back({label, at});
  if (set != nullptr) set->entries.push_back(inp_labels(label, label, here(reader)));
}

std::vector<std::int64_t> InpGenerator::members(const LineReader& reader, const InpSets& sets,
                                                const std::string& name) const {
  std::vector<std::int64_t> out;
  collect(reader, sets, upper(name), 0, out);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

void InpGenerator::collect(const LineReader& reader, const InpSets& sets, const std::string& name, int depth,
                           std::vector<std::int64_t>& out) const {
  const auto found = sets.find(name);
  if (found == sets.end()) reader.fail(fmt::format("set {} is not defined above", name));
  if (depth > 32) reader.fail(fmt::format("set {} contains itself", name));
  for (const InpMember& e : found->second.entries) {
    if (!e.name.empty()) {
      collect(reader, sets, e.name, depth + 1, out);
      continue;
    }
    for (std::int64_t label = e.first;; label += e.step) {
      out.push_back(label);
      if (out.size() > kMostMade) reader.fail(fmt::format("set {} has more than {} members", name, kMostMade));
      if (static_cast<std::uint64_t>(e.last) - static_cast<std::uint64_t>(label) < static_cast<std::uint64_t>(e.step))
        break;
    }
  }
}

void InpGenerator::lines_of_nodes(LineReader& reader, const InpKeyword& k, const InpSystem& system) {
  InpSet* set = k.has("NSET") ? &inp_set(scope_->node_sets, k.get("NSET")) : nullptr;
  const std::string shape = upper(k.get("LINE"));
  if (!shape.empty() && shape != "C" && shape != "P")
    reader.fail(fmt::format("LINE={} is not read (C and P are)", shape));
  std::string_view line;
  while (next_inp_data(reader, line)) {
    Fields fields(reader, line, ',');
    const std::int64_t first = small(reader, fields.integer("first end node"));
    const std::int64_t last = small(reader, fields.integer("second end node"));
    const std::int64_t step = small(reader, read_inp_integer(fields, "increment", 1));
    const std::int64_t extra = read_inp_integer(fields, "extra node", 0);
    double more[6] = {};
    read_inp_reals(fields, more, 6);
    const std::int64_t by = last < first ? -std::abs(step) : std::abs(step);
    if (by == 0 || (last - first) % by != 0)
      reader.fail(fmt::format("an increment of {} does not lead from node {} to node {}", step, first, last));
    const Point a = node(reader, first), b = node(reader, last);
    Point third{};
    if (!shape.empty())
      third = extra != 0 ? node(reader, extra)
                         : system.global(inp_rectangular(reader, k.get("SYSTEM"), {more[0], more[1], more[2]}));
    const Arc arc = shape == "C" ? make_arc(reader, third, a, b, {more[3], more[4], more[5]}) : Arc{};
    const std::int64_t intervals = (last - first) / by;
    if (set != nullptr)
      for (const std::int64_t end : {first, last}) set->entries.push_back(inp_labels(end, end, here(reader)));
    for (std::int64_t i = 1; i < intervals; ++i) {
      const double t = static_cast<double>(i) / static_cast<double>(intervals);
      const Point p = shape.empty() ? between(a, b, t) : shape == "P" ? on_parabola(a, third, b, t) : on_arc(arc, a, t);
      add_node(reader, first + i * by, p, set);
    }
  }
}

void InpGenerator::fills(LineReader& reader, const InpKeyword& k) {
  for (const char* other : {"SINGULAR", "TWOSTEP"})
    if (k.has(other)) reader.fail(fmt::format("*NFILL, {} is not read; write the nodes out in full", other));
  InpSet* set = k.has("NSET") ? &inp_set(scope_->node_sets, k.get("NSET")) : nullptr;
  double bias = 1;
  if (k.has("BIAS")) {
    const std::string given = k.get("BIAS");
    bias = Fields(reader, given, ',').real("BIAS");
    if (!(bias > 0)) reader.fail(fmt::format("BIAS is {}; it must be greater than 0", bias));
  }
  std::string_view line, name_a, name_b;
  while (next_inp_data(reader, line)) {
    Fields fields(reader, line, ',');
    if (!fields.next(name_a) || !fields.next(name_b)) reader.fail("*NFILL needs two node sets");
    const std::int64_t intervals = read_inp_integer(fields, "number of intervals", 1);
    const std::int64_t step = small(reader, read_inp_integer(fields, "increment", 1));
    need_positive(reader, intervals, "the number of intervals");
    const auto a = members(reader, scope_->node_sets, inp_unquoted(name_a));
    const auto b = members(reader, scope_->node_sets, inp_unquoted(name_b));
    for (std::size_t m = 0; m < std::min(a.size(), b.size()); ++m) {
      const Point from = node(reader, a[m]), to = node(reader, b[m]);
      if (set != nullptr)
        for (const std::int64_t end : {a[m], b[m]}) set->entries.push_back(inp_labels(end, end, here(reader)));
      // Intervals of lengths 1, 1 / bias, 1 / bias^2, ...
      const double q = 1 / bias;
      const double all = q == 1 ? static_cast<double>(intervals) : (std::pow(q, intervals) - 1) / (q - 1);
      double at = 0, length = 1;
      for (std::int64_t i = 1; i < intervals; ++i) {
        at += length;
        length *= q;
        add_node(reader, plus(a[m], i * step), between(from, to, at / all), set);
      }
    }
  }
}

void InpGenerator::copies_of_nodes(LineReader& reader, const InpKeyword& k) {
  const auto whole = [&](const char* key) {
    const std::string text = k.need(reader, key);
    return Fields(reader, text, ',').integer(key);
  };
  const std::int64_t change = small(reader, whole("CHANGENUMBER")), copies = k.has("MULTIPLE") ? whole("MULTIPLE") : 1;
  need_positive(reader, copies, "MULTIPLE");
  if (k.has("POLE")) reader.fail("*NCOPY, POLE is not read; write the nodes out in full");
  InpSet* set = k.has("NEWSET") ? &inp_set(scope_->node_sets, k.get("NEWSET")) : nullptr;
  const std::string mirror = upper(k.get("REFLECT"));
  const std::vector<std::int64_t> old = members(reader, scope_->node_sets, k.need(reader, "OLDSET"));
  double shift[3] = {}, turn[7] = {};
  std::string_view line;
  if (next_inp_data(reader, line)) {  // a shift; or two points of a mirror
    Fields fields(reader, line, ',');
    if (k.has("REFLECT"))
      read_inp_reals(fields, turn, 6);
    else
      read_inp_reals(fields, shift, 3);
  }
  Point third{};
  if (next_inp_data(reader, line)) {  // an axis and an angle; or the third point
    Fields fields(reader, line, ',');
    if (k.has("REFLECT"))
      read_inp_reals(fields, third.data(), 3);
    else
      read_inp_reals(fields, turn, 7);
  }
  const Point from = {turn[0], turn[1], turn[2]}, to = {turn[3], turn[4], turn[5]};
  const auto reflected = [&](Point p) {
    if (mirror == "POINT") return between(from, p, -1);
    if (mirror == "LINE") return turned_about(from, to, 180, p);
    // A mirror plane through three points: half a turn about its normal, then through the point.
    const Point u = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    const Point v = {third[0] - from[0], third[1] - from[1], third[2] - from[2]};
    const Point tip = {from[0] + u[1] * v[2] - u[2] * v[1], from[1] + u[2] * v[0] - u[0] * v[2],
                       from[2] + u[0] * v[1] - u[1] * v[0]};
    return between(from, turned_about(from, tip, 180, p), -1);
  };
  if (k.has("REFLECT") && mirror != "POINT" && mirror != "LINE" && mirror != "MIRROR")
    reader.fail(fmt::format("REFLECT={} is not read (LINE, MIRROR and POINT are)", mirror));
  for (const std::int64_t label : old) {
    Point p = node(reader, label);
    for (std::int64_t copy = 1; copy <= copies; ++copy) {
      if (k.has("REFLECT")) {
        p = reflected(p);
      } else {
        for (std::size_t d = 0; d < 3; ++d) p[d] += shift[d];
        if (turn[6] != 0) p = turned_about(from, to, turn[6], p);
      }
      if (!std::isfinite(p[0] + p[1] + p[2])) reader.fail("*NCOPY: the points of its axis or plane lie on one line");
      add_node(reader, plus(label, copy * change), p, set);
    }
  }
}

void InpGenerator::copy_element(const LineReader& reader, std::int64_t from, std::int64_t label, std::int64_t by,
                                InpSet* set) {
  for (; elements_seen_ < scope_->elements.size(); ++elements_seen_)
    elements_[scope_->elements[elements_seen_].label] = elements_seen_;
  count(reader);
  if (set != nullptr) set->entries.push_back(inp_labels(label, label, here(reader)));
  if (scope_->passed_over.contains(from)) {
    scope_->passed_over.insert(label);
    return;
  }
  const auto found = elements_.find(from);
  if (found == elements_.end()) reader.fail(fmt::format("element {} is not defined above", from));
  InpElement e = scope_->elements[found->second];
  e.label = label;
  e.line = here(reader);
  for (int a = 0; a < shape_of(e.type).nodes; ++a) {
    std::int64_t& n = e.nodes[static_cast<std::size_t>(a)];
    n = plus(n, by);
  }
  scope_->elements.push_back(e);
}

void InpGenerator::rows_of_elements(LineReader& reader, const InpKeyword& k) {
  InpSet* set = k.has("ELSET") ? &inp_set(scope_->element_sets, k.get("ELSET")) : nullptr;
  std::string_view line;
  while (next_inp_data(reader, line)) {
    Fields fields(reader, line, ',');
    const std::int64_t master = fields.integer("element");
    std::int64_t number[3], nodes[3], labels[3];  // of a row, of rows, of layers
    for (int d = 0; d < 3; ++d) {
      number[d] = read_inp_integer(fields, "number of elements", 1);
      nodes[d] = small(reader, read_inp_integer(fields, "increment of nodes", 1));
      labels[d] = small(reader, read_inp_integer(fields, "increment of elements", 1));
      need_positive(reader, number[d], "the number of elements");
    }
    if (set != nullptr) set->entries.push_back(inp_labels(master, master, here(reader)));
    for (std::int64_t layer = 0; layer < number[2]; ++layer)
      for (std::int64_t row = 0; row < number[1]; ++row)
        for (std::int64_t i = 0; i < number[0]; ++i)
          if (layer + row + i > 0)
            copy_element(reader, master, plus(master, i * labels[0] + row * labels[1] + layer * labels[2]),
                         i * nodes[0] + row * nodes[1] + layer * nodes[2], set);
  }
}

void InpGenerator::copies_of_elements(LineReader& reader, const InpKeyword& k) {
  const auto whole = [&](const char* key) {
    const std::string text = k.need(reader, key);
    return Fields(reader, text, ',').integer(key);
  };
  if (k.has("REFLECT")) reader.fail("*ELCOPY, REFLECT is not read; write the elements out in full");
  const std::int64_t labels = whole("ELEMENTSHIFT"), nodes = whole("SHIFTNODES");
  InpSet* set = k.has("NEWSET") ? &inp_set(scope_->element_sets, k.get("NEWSET")) : nullptr;
  for (const std::int64_t from : members(reader, scope_->element_sets, k.need(reader, "OLDSET")))
    copy_element(reader, from, plus(from, labels), nodes, set);
  std::string_view unread;
  while (next_inp_data(reader, unread)) {
  }
}

}  // namespace espalier::dynamics
