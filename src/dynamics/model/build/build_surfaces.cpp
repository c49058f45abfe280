// Surfaces and contacts between them.
#include <fmt/format.h>

#include <algorithm>

#include "base/output_file.hpp"
#include "dynamics/bodies/beam_axis.hpp"
#include "dynamics/contact/geometry/surface_file.hpp"
#include "dynamics/contact/rigid_contact.hpp"
#include "dynamics/contact/solid_contact.hpp"
#include "dynamics/mesh/file_source.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/run/start_report.hpp"

namespace espalier::dynamics::model {
namespace {

/// Whether a name fits a pattern in which * stands for any letters. Where letters do not fit, the last * takes one
/// more: an earlier one need not (at most name times pattern steps).
bool fits_pattern(std::string_view name, std::string_view pattern) {
  constexpr std::size_t kNone = std::string_view::npos;
  std::size_t n = 0, p = 0, star = kNone, taken = 0;  // the last *, and up to where it takes letters of the name
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      taken = n;
    } else if (p < pattern.size() && pattern[p] == name[n]) {
      ++n, ++p;
    } else if (star != kNone) {
      p = star + 1;
      n = ++taken;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == kNone;
}

class SurfaceBuilder {
 public:
  SurfaceBuilder(const Description& model, const FrameBuilder& frames, Mechanism& out)
      : model_(model), frames_(frames), out_(out) {}

  void run() {
    for (const SurfaceSpec& s : model_.surfaces) {
      at_place(s.place, [&] { static_cast<void>(body_of(s)); });
      note_for_pictures(s);
    }
    for (const ContactSpec& spec : model_.contacts) at_place(spec.place, [&] { add(spec); });
  }

 private:
  [[nodiscard]] std::vector<const SurfaceSpec*> chosen(const std::vector<std::string>& patterns,
                                                       const Place& place) const {
    std::vector<const SurfaceSpec*> found;
    for (const std::string& pattern : patterns) {
      bool any = false;
      for (const SurfaceSpec& s : model_.surfaces) {
        if (!fits_pattern(s.name, pattern)) continue;
        any = true;
        if (std::find(found.begin(), found.end(), &s) == found.end()) found.push_back(&s);
      }
      if (any) continue;
      std::vector<std::string> names;
      for (const SurfaceSpec& s : model_.surfaces) names.push_back(s.name);
      fail(place,
           fmt::format("there is no surface '{}' in [surfaces]{}", excerpt(pattern), suggestion(pattern, names)));
    }
    return found;
  }

  [[nodiscard]] const BuiltBody* body_of(const SurfaceSpec& s) const {
    if (s.body == "ground") return nullptr;
    const BuiltBody* body = out_.body(s.body);
    if (body == nullptr) frames_.unknown_body(s.body, s.place);
    return body;
  }

  void note_for_pictures(const SurfaceSpec& s) {
    if (s.body == "ground" && !is_flexible(s)) out_.ground_surfaces.push_back(rigid_surface(s));
    for (BuiltBody& body : out_.bodies)
      if (body.spec.name == s.body && body.rigid != nullptr && !is_flexible(s))
        body.surfaces.push_back(rigid_surface(s));
  }

  [[nodiscard]] contact::RigidSurface rigid_surface(const SurfaceSpec& s) {
    contact::RigidSurface surface;
    surface.name = s.name;
    surface.point = s.point;
    surface.axes = s.axes;
    at_place(s.place, [&] {
      const BuiltBody* body = body_of(s);
      if (body != nullptr && body->rigid == nullptr)
        throw std::invalid_argument(fmt::format(
            "'{}' is not rigid: shapes stand on rigid bodies and the ground; a solid or shell has shape = \"faces\", a "
            "cable or beam shape = \"line\"",
            s.body));
      surface.body = body == nullptr ? nullptr : body->rigid;
      if (const auto* file = std::get_if<SurfaceFile>(&s.shape))
        surface.shape = contact::MeshShape{triangles_of(*file)};
      else if (const auto* sprocket = std::get_if<contact::SprocketShape>(&s.shape))
        surface.shape =
            contact::MeshShape{std::make_shared<const contact::TriangleSurface>(contact::sprocket_surface(*sprocket))};
      else
        surface.shape = std::get<contact::Shape>(s.shape);
      contact::check_shape(surface.shape);
    });
    return surface;
  }

  /// Bodies that are copies of each other share one surface.
  std::shared_ptr<const contact::TriangleSurface> triangles_of(const SurfaceFile& file) {
    auto& known = files_[{file.path, {file.scale[0], file.scale[1], file.scale[2]}}];
    if (known) return known;
    base::check_path(file.path);
    if (!file_exists(file.path))
      throw Error(StatusCode::invalid_input,
                  fmt::format("there is no file '{}'; paths are relative to the folder of the model", file.path));
    return known = std::make_shared<const contact::TriangleSurface>(contact::read_surface(file.path, file.scale));
  }

  [[nodiscard]] contact::FaceSurface flexible_surface(const SurfaceSpec& s) const {
    std::optional<contact::FaceSurface> surface;
    at_place(s.place, [&] {
      const BuiltBody* body = body_of(s);
      if (body != nullptr && body->reduced != nullptr)
        throw std::invalid_argument(
            fmt::format("'{}' is reduced to shapes; only bodies with all their nodes touch", s.body));
      if (const auto* line = std::get_if<LineSurface>(&s.shape))
        surface = line_surface(s, *line, body);
      else if (body != nullptr && std::holds_alternative<ShellSpec>(body->spec.shape))
        surface = shell_surface(s, *body);
      else
        surface = solid_surface(s, body);
      if (const auto* faces = std::get_if<SolidFaces>(&s.shape)) surface->set_divisions(faces->divisions);
    });
    return std::move(*surface);
  }

  [[nodiscard]] contact::FaceSurface solid_surface(const SurfaceSpec& s, const BuiltBody* body) const {
    if (body == nullptr || !body->mesh)
      throw std::invalid_argument(fmt::format("'{}' is no solid or shell; shape = \"faces\" is of these", s.body));
    const std::string& set = std::get<SolidFaces>(s.shape).set;
    const std::vector<MeshFace>& faces = set.empty() ? no_faces_ : body->mesh->face_set(set);
    if (!set.empty() && faces.empty())
      throw std::invalid_argument(fmt::format("the face set '{}' of '{}' is empty", set, s.body));
    return {s.name, *body->flexible, *body->mesh, faces};
  }

  [[nodiscard]] static contact::FaceSurface shell_surface(const SurfaceSpec& s, const BuiltBody& body) {
    const auto& shell = std::get<ShellSpec>(body.spec.shape);
    const std::string& set = std::get<SolidFaces>(s.shape).set;
    using contact::ShellSides;
    if (!set.empty() && set != "top" && set != "bottom")
      throw std::invalid_argument(fmt::format(
          "the sides of the shell '{}' are \"top\" and \"bottom\", not '{}'; without 'set' both touch", s.body, set));
    const ShellSides sides = set.empty() ? ShellSides::both : set == "top" ? ShellSides::top : ShellSides::bottom;
    return {s.name, *body.flexible, shell_quads(shell), shell.thickness, sides};
  }

  [[nodiscard]] static contact::FaceSurface line_surface(const SurfaceSpec& s, const LineSurface& line,
                                                         const BuiltBody* body) {
    if (body != nullptr && line_file(*body) != nullptr)
      throw std::invalid_argument(fmt::format(
          "'{}' is of a mesh file; lines that touch are beams and cables that are given by their dimensions", s.body));
    if (body != nullptr) {
      if (const auto* cable = std::get_if<CableSpec>(&body->spec.shape))
        return {s.name, *body->flexible, (cable->end - cable->start).norm() / cable->elements, line.radius,
                line.divisions};
      if (const auto* beam = std::get_if<BeamSpec>(&body->spec.shape))
        return {s.name, *body->flexible, make_beam_axis(*beam->axis, beam->y, beam->elements).element_length,
                line.radius, line.divisions};
    }
    throw std::invalid_argument(fmt::format("'{}' is no cable or beam; shape = \"line\" is of these", s.body));
  }

  static bool is_line(const SurfaceSpec& s) { return std::holds_alternative<LineSurface>(s.shape); }
  static bool is_flexible(const SurfaceSpec& s) { return std::holds_alternative<SolidFaces>(s.shape) || is_line(s); }

  void add(const ContactSpec& spec) {
    std::vector<const SurfaceSpec*> all = chosen(spec.surfaces, spec.place);
    const std::vector<const SurfaceSpec*> second = chosen(spec.against, spec.place);
    const std::size_t split = second.empty() ? 0 : all.size();
    for (const SurfaceSpec* s : second) {
      if (std::find(all.begin(), all.end(), s) != all.end())
        throw std::invalid_argument(fmt::format("the surface '{}' stands in 'surfaces' and in 'against'", s->name));
      all.push_back(s);
    }
    if (spec.self && std::none_of(all.begin(), all.end(), [](const SurfaceSpec* s) { return is_flexible(*s); }))
      throw std::invalid_argument("'self' is of faces; none of the surfaces is one of shape = \"faces\"");
    BuiltContact built{spec.name, {}};
    add_rigid(spec, all, split, built);
    for (std::size_t i = 0; i < all.size(); ++i)
      for (std::size_t j = i + 1; j < all.size(); ++j)
        if ((is_flexible(*all[i]) || is_flexible(*all[j])) && (split == 0 || (i < split && j >= split)))
          add_flexible(spec, *all[i], *all[j], built);
    if (spec.self) add_self(spec, all, built);
    if (built.parts.empty())
      throw std::invalid_argument("the contact has no two surfaces on different bodies that could touch");
    for (contact::Contact* part : built.parts) part->set_active(spec.active);
    for (std::string& line : overlap_lines(spec, built, frames_.initial_configuration()))
      out_.notices.push_back(std::move(line));
    out_.surface_contacts.push_back(std::move(built));
  }

  /// All shapes on rigid bodies and the ground in one component. Where there are solids, too, they need not touch.
  void add_rigid(const ContactSpec& spec, const std::vector<const SurfaceSpec*>& all, std::size_t split,
                 BuiltContact& built) {
    std::vector<contact::RigidSurface> rigid;
    std::size_t own_split = 0, moving = 0;
    for (std::size_t k = 0; k < all.size(); ++k) {
      if (is_flexible(*all[k])) continue;
      rigid.push_back(rigid_surface(*all[k]));
      own_split += k < split ? 1 : 0;
      moving += rigid.back().body != nullptr ? 1 : 0;
    }
    const bool solids = rigid.size() < all.size();
    if (rigid.empty() || (solids && (moving == 0 || rigid.size() < 2))) return;
    if (split > 0 && (own_split == 0 || own_split == rigid.size())) return;
    try {
      auto& part = out_.system.add(
          std::make_unique<contact::RigidContact>(spec.name, spec.law, std::move(rigid), own_split, spec.margin));
      built.parts.push_back(&part);
      if (spec.law.impulse) out_.impacts.push_back(&part);
    } catch (const std::invalid_argument&) {
      if (!solids) throw;
      return;
    }
    if (spec.law.impulse) check_impulses();
    if (spec.penetration > 0)
      throw std::invalid_argument(
          "'penetration' (augmented Lagrangian) is of solids; between rigid shapes the stiffness says how deep they "
          "go");
  }

  void check_impulses() const {
    if (model_.statics || model_.initial.statics)
      throw std::invalid_argument(
          "law = \"impulse\" is of motions: at rest nothing strikes, so statics has no force; take the penalty");
  }

  /// The first surface is the one on which is integrated: of two flexible ones a line, or the one that is named first.
  void add_flexible(const ContactSpec& spec, const SurfaceSpec& a, const SurfaceSpec& b, BuiltContact& built) {
    if (a.body == b.body && (!is_flexible(a) || !is_flexible(b))) return;
    const std::string name = fmt::format("{}: {}, {}", spec.name, a.name, b.name);
    const bool both = is_flexible(a) && is_flexible(b);
    const bool reversed = both ? is_line(b) && !is_line(a) : is_flexible(b);
    const SurfaceSpec &first = reversed ? b : a, &second = reversed ? a : b;
    auto part = both ? std::make_unique<contact::SolidContact>(name, spec.law, flexible_surface(first),
                                                               flexible_surface(second), spec.penetration, spec.margin)
                     : std::make_unique<contact::SolidContact>(name, spec.law, flexible_surface(first),
                                                               rigid_surface(second), spec.penetration);
    part->set_reversed(reversed);
    built.parts.push_back(&out_.system.add(std::move(part)));
  }

  void add_self(const ContactSpec& spec, const std::vector<const SurfaceSpec*>& all, BuiltContact& built) {
    for (const SurfaceSpec* s : all)
      if (is_flexible(*s))
        built.parts.push_back(&out_.system.add(
            contact::SolidContact::with_itself(fmt::format("{}: {} with itself", spec.name, s->name), spec.law,
                                               flexible_surface(*s), spec.penetration, spec.margin)));
  }

  const std::vector<MeshFace> no_faces_;
  const Description& model_;
  const FrameBuilder& frames_;
  Mechanism& out_;
  std::map<std::pair<std::string, std::array<double, 3>>, std::shared_ptr<const contact::TriangleSurface>> files_;
};

}  // namespace

void build_surface_contacts(const Description& model, const FrameBuilder& frames, Mechanism& out) {
  SurfaceBuilder(model, frames, out).run();
}

std::vector<std::string> overlap_lines(const ContactSpec& spec, const BuiltContact& built, ConstSpan q) {
  constexpr double kAllowed = 0.01;  // of the smaller surface
  constexpr double kRounding = 1e-9;
  std::vector<std::string> lines;
  for (contact::Contact* part : built.parts)
    for (const contact::Overlap& o : part->overlaps(q)) {
      const std::string text =
          fmt::format("the surfaces '{}' and '{}' overlap by {:.3g} at the start", o.a, o.b, o.depth);
      if (o.depth > spec.overlap.value_or(kAllowed * o.extent))
        throw std::invalid_argument(
            text + "; move the bodies apart, or allow it with 'overlap' (their contact pushes them apart then)");
      if (o.depth > kRounding * o.extent) lines.push_back(fmt::format("contact '{}': {}", spec.name, text));
    }
  return lines;
}

void check_overlaps(const Description& model, const Mechanism& mechanism, const State& now) {
  for (const BuiltContact& built : mechanism.surface_contacts)
    for (const ContactSpec& spec : model.contacts)
      if (spec.name == built.name) {
        try {
          static_cast<void>(overlap_lines(spec, built, now.q));
        } catch (const std::invalid_argument& error) {
          fail(spec.place, fmt::format("with all joints closed {}", error.what()));
        }
      }
}

contact::ContactReport BuiltContact::report(const StateView& s) const {
  contact::ContactReport sum;
  for (contact::Contact* part : parts) {
    const contact::ContactReport r = part->report(s);
    sum.force += r.force;
    sum.moment += r.moment;
    sum.normal_force += r.normal_force;
    sum.friction_force += r.friction_force;
    sum.penetration = std::max(sum.penetration, r.penetration);
    sum.pressure = std::max(sum.pressure, r.pressure);
    sum.area += r.area;
    sum.slip_speed = std::max(sum.slip_speed, r.slip_speed);
    sum.points += r.points;
    sum.slipping += r.slipping;
    sum.energy += r.energy;
    sum.impulse += r.impulse;
    sum.impacts += r.impacts;
  }
  return sum;
}

}  // namespace espalier::dynamics::model
