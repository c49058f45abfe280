#include "dynamics/page/marks.hpp"

#include <limits>

#include "dynamics/contact/geometry/outline.hpp"
#include "dynamics/joints/space_curve.hpp"
#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/page/json_text.hpp"
#include "dynamics/page/skin_faces.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

void push(const Vec3& x, std::vector<double>& to) { to.insert(to.end(), x.data(), x.data() + 3); }

std::string body_name(const model::MarkerSpec& marker, const model::Description& model) {
  if (marker.reference.empty()) return marker.body;
  const auto named = model.markers.find(marker.reference);
  return named == model.markers.end() ? marker.reference : named->second.body;
}

std::vector<std::string> body_names(const std::vector<model::MarkerSpec>& frames, const model::Description& model) {
  std::vector<std::string> names;
  for (const model::MarkerSpec& frame : frames) names.push_back(body_name(frame, model));
  return names;
}

std::string mark_json(const std::string& name, const char* what, const std::string& kind,
                      const std::vector<std::string>& between, const std::vector<double>& path = {}) {
  JsonObject mark;
  mark.text("name", name).text("what", what).text("kind", kind).raw("between", json_texts(between));
  if (!path.empty()) mark.raw("path", json_numbers(path, 7));
  return mark.done();
}

/// Points of a curve on the ground, in global axes; none of one that moves.
std::vector<double> path_of(const Joint& joint, const SpaceCurve* curve) {
  std::vector<double> path;
  if (curve == nullptr || dynamic_cast<const GroundFrame*>(&joint.frame(0)) == nullptr) return path;
  constexpr int kPoints = 200;
  const FrameMotion a = joint.frame_motion({}, {}, 0);
  for (int k = 0; k <= kPoints; ++k)
    push(a.r + a.rot * curve->at(curve->least() + (curve->most() - curve->least()) * k / kPoints).x, path);
  return path;
}

/// The parts of what goes through several frames are a mark each; the last one has the force.
int parts_of(const Joint& joint) { return joint.kind() == "cable" ? joint.frames() - 1 : 1; }

}  // namespace

Marks::Marks(const model::Mechanism& mechanism, const model::Description& model) : mechanism_(mechanism) {
  std::vector<std::string> marks;
  for (const Joint* joint : mechanism.joints) {
    std::vector<model::MarkerSpec> frames;
    const SpaceCurve* curve = nullptr;
    for (const model::JointSpec& spec : model.joints) {
      if (spec.name != joint->name()) continue;
      frames = spec.frames;
      curve = spec.curve.get();
    }
    for (int k = 0; k < parts_of(*joint); ++k)
      marks.push_back(
          mark_json(joint->name(), "joint", joint->kind(), body_names(frames, model), path_of(*joint, curve)));
  }
  for (const model::BuiltForce& built : mechanism.forces) {
    std::string kind = "force";
    std::vector<model::MarkerSpec> frames;
    for (const model::ForceSpec& spec : model.forces)
      if (spec.name == built.force->name()) {
        frames = spec.frames;
        kind = model::force_kind(spec.type).name;
      }
    marks.push_back(mark_json(built.force->name(), "force", kind, body_names(frames, model)));
  }
  for (const CableForce* cable : mechanism.cables) {
    std::vector<model::MarkerSpec> frames;
    for (const model::ForceSpec& spec : model.forces)
      if (spec.name == cable->name()) frames = spec.frames;
    for (int k = 1; k < cable->frames(); ++k)
      marks.push_back(mark_json(cable->name(), "force", "cable", body_names(frames, model)));
  }
  for (const FacePressure* pressure : mechanism.pressures) {
    std::vector<std::string> on;
    for (const model::ForceSpec& spec : model.forces)
      if (spec.name == pressure->name()) on = {spec.body};
    const model::BuiltBody* body = on.empty() ? nullptr : mechanism.body(on[0]);
    pressed_.push_back(body == nullptr || body->reduced != nullptr ? nullptr : body);
    marks.push_back(mark_json(pressure->name(), "force", "pressure", on));
  }
  for (const Support* support : mechanism.supports) {
    reactions_.push_back({support, reaction_of(*support, false), reaction_of(*support, true)});
    marks.push_back(mark_json(support->name(), "support", "support", {support->body().name()}));
  }
  for (const model::BuiltContact& contact : mechanism.surface_contacts)
    marks.push_back(mark_json(contact.name, "contact", "contact", {}));
  count_ = static_cast<Index>(marks.size());
  json_ = json_list(marks);
}

void Marks::place(const StateView& s, const StateView& end, std::vector<double>& out) const {
  for (const Joint* joint : mechanism_.joints) {
    const int parts = parts_of(*joint), other = joint->frames() > 1 ? parts : 0;
    for (int k = 0; k + 1 < parts; ++k) {
      const Vec3 from = joint->frame_motion(s.q, {}, k).r, to = joint->frame_motion(s.q, {}, k + 1).r;
      for (const Vec3& x : {from, to, Vec3(Vec3::Zero()), Vec3(Vec3::Zero()), Vec3(Vec3::Zero())}) push(x, out);
    }
    const FrameMotion a = joint->frame_motion(s.q, {}, parts - 1), b = joint->frame_motion(s.q, {}, other);
    const Wrench wrench = joint->reaction(s, other);
    for (const Vec3& x : {a.r, b.r, Vec3(a.rot.col(2)), wrench.force, wrench.moment}) push(x, out);
  }
  for (const model::BuiltForce& built : mechanism_.forces) {
    FrameMotion a, b;
    built.force->frame(0).motion(s.q, {}, a);
    built.force->frame(1).motion(s.q, {}, b);
    if (built.side == 0) b = a;  // a load
    const Wrench wrench = built.force->applied(s, built.side);
    for (const Vec3& x : {a.r, b.r, Vec3(a.rot.col(2)), wrench.force, wrench.moment}) push(x, out);
  }
  for (const CableForce* cable : mechanism_.cables) {
    const int last = cable->frames() - 1;
    for (int k = 0; k < last; ++k) {
      FrameMotion a, b;
      cable->frame(k).motion(s.q, {}, a);
      cable->frame(k + 1).motion(s.q, {}, b);
      const Vec3 force = k + 1 == last ? cable->applied(s, last) : Vec3(Vec3::Zero());
      for (const Vec3& x : {a.r, b.r, Vec3(Vec3::Zero()), force, Vec3(Vec3::Zero())}) push(x, out);
    }
  }
  place_pressures(s, out);
  place_supports(s, out);
  for (const model::BuiltContact& contact : mechanism_.surface_contacts) {
    const contact::ContactReport report = contact.report(end);
    const double square = report.force.squaredNorm();
    // The point of the force's line that is next to the origin; the page moves it along the line.
    const Vec3 on_line = square > 0 ? Vec3(report.force.cross(report.moment) / square) : Vec3(Vec3::Constant(kNone));
    for (const Vec3& x : {on_line, on_line, Vec3(Vec3::Zero()), report.force, Vec3(Vec3::Zero())}) push(x, out);
  }
}

// The sum of what it does to the nodes, at their mean weighted by it.
void Marks::place_pressures(const StateView& s, std::vector<double>& out) const {
  std::vector<double> residual;
  for (std::size_t k = 0; k < pressed_.size(); ++k) {
    Vec3 force = Vec3::Zero(), place = Vec3::Zero();
    double weight = 0;
    if (pressed_[k] != nullptr) {
      const FlexibleBody& body = *pressed_[k]->flexible;
      residual.assign(s.v.size(), 0);
      mechanism_.pressures[k]->residual(s, residual);
      for (Index vertex = 0; vertex < body.vertices(); vertex += body.vertices_per_node()) {
        const Vec3 f = -Eigen::Map<const Vec3>(residual.data() + body.coordinate(vertex));
        force += f;
        weight += f.norm();
        place += f.norm() * Eigen::Map<const Vec3>(s.q.data() + body.configuration(vertex));
      }
    }
    place /= weight;  // no number where nothing acts
    for (const Vec3& x : {place, place, Vec3(Vec3::Zero()), force, Vec3(Vec3::Zero())}) push(x, out);
  }
}

void Marks::place_supports(const StateView& s, std::vector<double>& out) const {
  for (const Reaction& reaction : reactions_) {
    Vec3 place = Vec3::Zero();
    for (const Index vertex : reaction.support->places())
      place += Eigen::Map<const Vec3>(s.q.data() + reaction.support->body().configuration(vertex));
    place /= static_cast<double>(reaction.support->places().size());
    for (const Vec3& x : {place, place, Vec3(Vec3::Zero()), reaction.force->value(s), reaction.moment->value(s)})
      push(x, out);
  }
}

std::string Marks::ground_json() const {
  std::vector<std::string> shapes;
  for (const contact::RigidSurface& surface : mechanism_.ground_surfaces) {
    JsonObject shape;
    shape.text("name", surface.name);
    if (std::holds_alternative<contact::PlaneShape>(surface.shape)) {
      const Vec3 normal = surface.axes.col(2);
      shape.raw("point", json_numbers({surface.point.data(), 3})).raw("normal", json_numbers({normal.data(), 3}));
    } else {
      const contact::Outline outline = contact::outline_of(surface.shape);
      std::vector<double> points;
      for (const Vec3& x : outline.points) push(surface.point + surface.axes * x, points);
      std::vector<std::array<Index, 3>> triangles;
      for (const std::vector<Index>& face : outline.faces) add_triangles(face, face.size(), triangles);
      std::vector<std::string> numbers;
      for (const auto& triangle : triangles)
        for (const Index k : triangle) numbers.push_back(std::to_string(k));
      shape.raw("points", json_numbers(points, 7)).raw("triangles", json_list(numbers));
    }
    shapes.push_back(shape.done());
  }
  return json_list(shapes);
}

}  // namespace espalier::dynamics::page
