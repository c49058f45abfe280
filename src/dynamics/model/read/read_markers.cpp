#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/frames/read_marker.hpp"

namespace espalier::dynamics::model {
namespace {

MarkerSpec global_marker(const Place& place, const std::string& body, const Vec3& point, const Mat3& axes) {
  MarkerSpec m;
  m.place = place;
  m.body = body;
  m.point = point;
  m.axes = axes;
  m.global = true;
  return m;
}

/// The name of a node set, or labels of nodes.
void read_nodes(Section& s, MarkerSpec& m) {
  const Value* nodes = s.value("nodes");
  if (nodes == nullptr) return;
  if (nodes->type == Value::Type::text) {
    m.nodes = nodes->text;
    return;
  }
  const auto is_text = [](const Value& item) { return item.type == Value::Type::text; };
  if (nodes->type != Value::Type::array || nodes->items.empty() ||
      std::any_of(nodes->items.begin(), nodes->items.end(), is_text))
    fail(nodes->place,
         "must be the name of one node set, \"SET\", or a list of labels of nodes, [31, 90] (of one alone: node = 31)");
  constexpr double kLargest = 9e15;  // whole numbers are exact up to there
  for (const Value& item : nodes->items) {
    const double label = Section::plain_number(item);
    if (label != std::floor(label) || label < -1 || label > kLargest)
      fail(nodes->place, fmt::format("labels of nodes are whole numbers, not {}", label));
    m.labels.push_back(static_cast<std::int64_t>(label));
  }
}

/// The weight of each label in the mean.
void read_weights(Section& s, MarkerSpec& m) {
  if (!s.has("weights")) return;
  m.weights = s.numbers("weights");
  if (m.weights.size() != m.labels.size())
    fail(s.place("weights"), fmt::format("needs one number for each node of 'nodes', a list of labels: {}, not {}",
                                         m.labels.size(), m.weights.size()));
  if (std::any_of(m.weights.begin(), m.weights.end(), [](double w) { return !(w > 0); }))
    fail(s.place("weights"), "must all be greater than 0");
  if (m.attach == Attach::rigid || !m.face.empty())
    fail(s.place("weights"), "are of the mean of nodes; leave them out with attach = \"rigid\" and 'face'");
}

/// A share of the length, or two of them.
void read_along(Section& s, MarkerSpec& m) {
  if (!s.has("along")) return;
  m.along = s.value("along")->type == Value::Type::array ? s.numbers("along") : std::vector{s.number("along")};
  const bool ordered = std::is_sorted(m.along.begin(), m.along.end());
  if (m.along.empty() || m.along.size() > 2 || !ordered || !(m.along.front() >= 0 && m.along.back() <= 1))
    fail(s.place("along"), "needs a share of the length, from 0 at the start to 1 at the end, or two: [0.2, 0.5]");
}

}  // namespace

Mat3 read_axes(Section& s, bool& given) {
  given = s.has("rotation") || s.has("axis");
  if (s.has("rotation")) {
    if (s.has("axis") || s.has("x_axis")) fail(s.place("rotation"), "give either 'rotation' or 'axis' and 'x_axis'");
    return s.rotation("rotation");
  }
  const Vec3 axis = s.vector("axis", Vec3::UnitZ());
  if (!(axis.norm() > 0)) fail(s.place("axis"), "must not be zero");
  const Vec3 z = axis.normalized();
  const Vec3 towards = s.vector("x_axis", std::abs(z.x()) < 0.9 ? Vec3::UnitX() : Vec3::UnitY());
  const Vec3 x = towards - towards.dot(z) * z;
  if (!(x.norm() > 1e-6 * towards.norm()))
    fail(s.place("x_axis"), "must not be parallel to 'axis' (the z axis of the frame)");
  Mat3 axes;
  axes << x.normalized(), z.cross(x.normalized()), z;
  return axes;
}

Attach read_attach(Section& s) { return s.one_of("attach", kAttachments, Attach::automatic); }

MarkerSpec read_marker(const Value& value, const std::string& name) {
  MarkerSpec m;
  m.place = value.place;
  m.name = name;
  if (value.type == Value::Type::text) {
    m.reference = value.text;
    return m;
  }
  if (!value.is_table())
    fail(value.place,
         fmt::format(
             "must be a frame, {{ body = ..., point = ... }}, or the name of a marker, a body or \"ground\", not {}",
             name_of(value.type)));
  Section s(value);
  if (name.empty()) m.name = s.text("name", "");  // in line
  if (s.has("same_as")) {
    m.reference = s.text("same_as");
    s.finish();
    return m;
  }
  m.body = s.text("body");
  m.global = s.flag("global", false);
  m.point_given = s.has("point");
  m.point = s.vector("point", Vec3::Zero());
  m.axes = read_axes(s, m.axis_given);
  m.attach = read_attach(s);
  read_where(s, m);
  read_weights(s, m);
  m.most_nodes = s.integer("most_nodes", 0, 240);
  s.finish();
  return m;
}

void read_where(Section& s, MarkerSpec& m) {
  if (s.has("node")) m.node = s.integer("node", -1, 0);
  if (s.has("near")) m.near = s.vector("near");
  m.face = s.text("face", "");
  read_nodes(s, m);
  m.edge = s.texts("edge");
  read_along(s, m);
  m.radius = s.positive("radius", 0);
  if (auto b = s.table("bore")) {
    m.bore = {b->vector("point"), b->vector("axis", Vec3::UnitZ()), b->positive("radius"), b->positive("length", 0)};
    if (!(m.bore->axis.norm() > 0)) fail(b->place("axis"), "must not be zero");
    m.bore->axis.normalize();
    b->finish();
    if (!m.point_given) m.point = m.bore->point;
    m.point_given = true;
  }
}

std::vector<MarkerSpec> read_frames(Section& s, std::size_t count) {
  std::vector<MarkerSpec> frames;
  if (s.has("bodies")) {
    const std::vector<std::string> bodies = s.texts("bodies");
    if (count != 2 || bodies.size() != 2)
      fail(s.place("bodies"), "must be a list of two names (or give frames a, b, ...)");
    const Vec3 at = s.vector("at");
    bool given = false;
    const Mat3 axes = read_axes(s, given);
    for (const std::string& body : bodies) {
      frames.push_back(global_marker(s.place("bodies"), body, at, axes));
      frames.back().axis_given = given;
    }
    return frames;
  }
  for (const char* key : {"at", "axis", "x_axis", "rotation"})
    if (s.has(key))
      fail(
          s.place(key),
          "goes with bodies = [..]; beside frames a and b it belongs into one of them: a = { body = ..., point = [..], "
          "axis = [..] }");
  static const char* const kKeys[] = {"a", "b", "c", "d"};
  for (std::size_t k = 0; k < count; ++k) {
    const Value* value = s.value(kKeys[k]);
    if (value == nullptr) {
      fail(s.place(),
           fmt::format(
               "needs a frame '{}': {{ body = ..., point = ... }}, or the name of a marker, a body or \"ground\"{}",
               kKeys[k], count == 2 ? ", or the short form bodies = [..], at = [..]" : ""));
    }
    frames.push_back(read_marker(*value, ""));
  }
  return frames;
}

std::vector<MarkerSpec> read_through(Section& s) {
  const Value* list = s.value("through");
  const auto most = static_cast<std::size_t>(FrameBlocks::kMostFrames);
  if (list == nullptr || list->type != Value::Type::array || list->items.size() < 2 || list->items.size() > most)
    fail(list == nullptr ? s.place() : list->place,
         fmt::format(
             "needs 'through', a list of 2 to {} frames: where the cable begins, the rings that it goes through, "
             "and where it ends; each {{ body = ..., point = ... }} or the name of a marker",
             most));
  std::vector<MarkerSpec> frames;
  for (const Value& item : list->items) frames.push_back(read_marker(item, ""));
  return frames;
}

}  // namespace espalier::dynamics::model
