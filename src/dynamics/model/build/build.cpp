#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "dynamics/bodies/modal_damping.hpp"
#include "dynamics/forces/body_load.hpp"
#include "dynamics/joints/relative.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/assembly/line_loads.hpp"
#include "dynamics/model/assembly/shell_body.hpp"
#include "dynamics/model/assembly/solid_materials.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/build/element_notices.hpp"
#include "dynamics/model/build/hold_joint.hpp"
#include "dynamics/model/build/joint_frames.hpp"
#include "dynamics/model/build/reach.hpp"
#include "dynamics/model/erosion/erosion.hpp"
#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

/// Joints and forces, once the bodies stand.
class Builder {
 public:
  Builder(const Description& model, Mechanism& out) : model_(model), out_(out), frames_(model, out) {}

  void run() {
    add_drives();
    for (const BodySpec& body : model_.bodies)
      at_place(body.place, [&] { out_.bodies.push_back(build_body(body, model_, frames_, out_)); });
    add_modal_damping();
    frames_.note_initial_state();
    check_places();
    for (const auto& [name, marker] : model_.markers) out_.markers[name] = frames_.make(marker);
    for (const JointSpec& joint : model_.joints) at_place(joint.place, [&] { add_joint(joint); });
    for (const SupportSpec& support : model_.supports)
      at_place(support.place, [&] { build_support(support, frames_, out_); });
    for (const EquationSpec& equation : model_.equations)
      at_place(equation.place, [&] { build_equation(equation, frames_, out_); });
    for (const TieSpec& tie : model_.ties) at_place(tie.place, [&] { build_tie(tie, frames_, out_); });
    for (const ForceSpec& force : model_.forces) at_place(force.place, [&] { add_force(force); });
    for (std::size_t k = 0; k < joints_.size(); ++k)
      at_place(joints_[k].place, [&] { build_contacts(joints_[k], frames_, *out_.joints[k], out_); });
    build_surface_contacts(model_, frames_, out_);
    build_controls(model_, out_);
    add_erosion(out_);
    build_controllers(model_, out_);
    build_functions(model_, out_);
    out_.system.finish();
  }

 private:
  void check_places() const {
    const Reach reach(out_.bodies);
    for (const BuiltBody& body : out_.bodies)
      if (const auto* rigid = std::get_if<RigidSpec>(&body.spec.shape)) {
        reach.check(rigid->data.position, body.spec.place, fmt::format("body '{}'", body.spec.name));
      } else if (body.flexible != nullptr) {
        reach.check(body.spec.position, body.spec.place, fmt::format("body '{}'", body.spec.name));
      }
    const auto check = [&](const auto& what, const char* noun) {
      for (std::size_t k = 0; k < what.frames.size(); ++k)
        reach.check(frames_.initial_motion(what.frames[k]).r, what.place,
                    fmt::format("frame {} of the {} '{}'", static_cast<char>('a' + k), noun, what.name));
    };
    for (const JointSpec& joint : model_.joints) at_place(joint.place, [&] { check(joint, "joint"); });
    for (const ForceSpec& force : model_.forces) at_place(force.place, [&] { check(force, "force"); });
  }

  /// The value of a relative coordinate of the first two frames in the initial state.
  double measure(Relative kind, int axis, const std::vector<MarkerSpec>& frames) {
    return model::measure(kind, axis, frames_.initial_motion(frames[0]), frames_.initial_motion(frames[1]));
  }

  void add_modal_damping() {
    constexpr Index kMostCoupled = 1000;  // coordinates, each with each other one, in Newton's matrix
    auto damping = std::make_unique<ModalDamping>("modal damping");
    for (const BuiltBody& body : out_.bodies) {
      if (body.spec.modal_damping == 0) continue;
      if (body.reduced != nullptr)
        damping->add(*body.reduced, body.spec.modal_damping);
      else
        damping->add(*body.flexible, body.spec.modal_damping);
      if (damping->coordinates() > kMostCoupled)
        fail(body.spec.place,
             fmt::format("damping by ratio couples all coordinates of the bodies that have it, {} with this one; up to "
                         "{} are possible. Reduce the bodies (reduce = {{ modes = ... }}), or give the ratio at two "
                         "frequencies (damping = {{ ratio = {}, frequencies = [f1, f2] }})",
                         damping->coordinates(), kMostCoupled, body.spec.modal_damping));
    }
    if (damping->coordinates() > 0) out_.modal_damping = &out_.system.add(std::move(damping));
  }

  void add_drives() {
    if (!model_.harmonic) return;
    for (const HarmonicSpec::Load& load : model_.harmonic->loads)
      for (const HarmonicSpec::Excitation& part : load.parts) {
        const auto named = [&](const auto& spec) { return spec.name == part.of; };
        if (std::any_of(model_.forces.begin(), model_.forces.end(), named) ||
            std::any_of(model_.joints.begin(), model_.joints.end(), named))
          out_.drives.emplace(part.of, std::make_shared<double>(0));
      }
  }

  /// @param initial  value of its coordinate; used where the text counts from there
  TimeFunction motion(const JointSpec& j, double initial) {
    TimeFunction f = motion_of_text(j, initial);
    if (const auto drive = out_.drives.find(j.name); drive != out_.drives.end())
      f.value = [g = f.value, more = drive->second](double t) { return g(t) + *more; };
    return f;
  }

  TimeFunction motion_of_text(const JointSpec& j, double initial) {
    TimeFunction f = j.function->function(j.place.text());
    if (!j.relative) return f;
    if (const double still = j.function->value(); j.function->is_constant() && still != 0)
      fail(j.place, fmt::format("'motion' with from = \"initial\" counts from its own value at the start, so that the "
                                "constant {:g} moves nothing; write \"0\" to hold the coordinate, a function of t to "
                                "move it, or leave 'from' out",
                                still));
    const double start = initial - j.function->value(model_.integrator.start);
    f.value = [g = f.value, start](double t) { return start + g(t); };
    return f;
  }

  void add_joint(const JointSpec& given) {
    joints_.push_back(completed(given, frames_, out_, out_.notices));
    for (const MarkerSpec& marker : joints_.back().frames) hold_rigidly(marker, frames_, out_);
    out_.joints.push_back(&out_.system.add(make_joint(joints_.back())));
  }

  std::unique_ptr<Joint> make_joint(const JointSpec& j) {
    std::vector<FramePtr> f;
    if (j.frames.size() == 2) {
      f = held_frames(j, frames_, out_, out_.notices);
    } else {
      for (const MarkerSpec& marker : j.frames) f.push_back(frames_.make(marker));
    }
    const JointKind& kind = joint_kind(j.type);
    const bool starts = kind.starts || j.measured || j.relative;
    return kind.make(j, std::move(f),
                     start_of(starts ? j.frames : std::vector<MarkerSpec>{}, frames_,
                              [&](double initial) { return motion(j, initial); }));
  }

  void add_force(const ForceSpec& given) {
    if (given.type == ForceType::pressure) {
      add_pressure(given);
    } else if (given.material) {
      add_body_load(given);
    } else if (given.type == ForceType::line_load) {
      add_line_load(given);
    } else if (given.type == ForceType::cable) {
      const ForceSpec f = completed(given, frames_, out_);
      for (const MarkerSpec& marker : f.frames) hold_rigidly(marker, frames_, out_);
      out_.cables.push_back(&out_.system.add(make_cable_force(f, frames_)));
    } else {
      const ForceSpec f = completed(given, frames_, out_);
      for (const MarkerSpec& marker : f.frames) hold_rigidly(marker, frames_, out_);
      out_.forces.push_back({&out_.system.add(make_force(f)), f.frames.size() > 1 ? 1 : 0});
    }
  }

  void add_pressure(const ForceSpec& f) {
    for (BuiltBody& body : out_.bodies) {
      if (body.spec.name != f.body) continue;
      if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape)) {
        const PressedSide pressed = pressed_side(*shell, f.face);
        if (body.reduced != nullptr)
          throw std::invalid_argument(
              fmt::format("'{}' is reduced: pressure on a shell needs all its nodes; take out 'reduce'", f.body));
        auto side = press_shell(*body.flexible, pressed.quads, pressed.height);
        out_.pressures.push_back(&out_.system.add(std::make_unique<FacePressure>(f.name, std::move(side))));
        return;
      }
      if (!body.mesh) throw std::invalid_argument("pressure acts on faces of solids, and on shells");
      if (!body.mesh->face_sets.contains(f.face) && body.mesh->node_sets.contains(f.face))
        throw std::invalid_argument(
            fmt::format("the node set '{}' has no outer face with all its nodes in it, and pressure needs faces; nodes "
                        "take a force: "
                        "type = \"load\", a = {{ body = \"{}\", nodes = \"{}\" }}, force = [x, y, z]",
                        f.face, f.body, f.face));
      const std::vector<MeshFace>& faces = body.mesh->face_set(f.face);
      auto pressed = body.reduced != nullptr ? press_reduced(*body.reduced, *body.mesh, faces)
                                             : press_nodal(*body.flexible, *body.mesh, faces);
      out_.pressures.push_back(&out_.system.add(std::make_unique<FacePressure>(f.name, std::move(pressed))));
      return;
    }
    frames_.unknown_body(f.body, f.place);
  }

  void add_body_load(const ForceSpec& f) {
    const BuiltBody* body = out_.body(f.body);
    if (body == nullptr) frames_.unknown_body(f.body, f.place);
    if (body->flexible == nullptr || body->reduced != nullptr)
      throw std::invalid_argument("body loads act on flexible bodies, which are not reduced");
    const BodyLoadLaw& law = *f.material;
    if (!body->mesh && (!f.element_set.empty() || !law.per_volume.isZero(0)))
      throw std::invalid_argument(fmt::format(
          "'{}' is no solid: an acceleration or a rotation acts on all of it; forces per volume and sets of elements "
          "are those of solids. Take a line-load, a pressure, or a body for each part (element_set)",
          f.body));
    const std::span<const Index> elements =
        f.element_set.empty() ? std::span<const Index>() : std::span(body->mesh->element_set(f.element_set));
    if (body->spec.massless && (!law.acceleration.isZero(0) || !law.spin.isZero(0)))
      throw std::invalid_argument(fmt::format("'{}' has no density: give its material one", f.body));
    auto load = body->mesh ? load_material(*body->flexible, *body->mesh, elements, materials_of(*body), law)
                           : load_mass(*body->flexible, law);
    out_.pressures.push_back(&out_.system.add(std::make_unique<FacePressure>(f.name, std::move(load))));
  }

  void add_line_load(const ForceSpec& f) {
    const BuiltBody* body = out_.body(f.body);
    if (body == nullptr) frames_.unknown_body(f.body, f.place);
    const LineLoadLaw law{f.linear, f.angular, f.follower};
    std::vector<LoadedPoint> points = points_of_line(f.where, f.element_set, *body, frames_);
    if ((law.follower || !law.moment.isZero()) && !points.front().frame->has_rotation())
      throw std::invalid_argument(
          fmt::format("'{}' is a cable, which has no axes: forces of constant direction act on it", f.body));
    out_.pressures.push_back(
        &out_.system.add(std::make_unique<FacePressure>(f.name, load_line(std::move(points), law))));
  }

  /// Moments and directions of a place without axes would be lost without a word.
  static void check_axes(const ForceSpec& f, const Frame& a, const Frame* b) {
    const ForceKind& kind = force_kind(f.type);
    const bool moments =
        kind.moments || !f.angular.isZero() || !f.angular_damping.isZero() ||
        std::any_of(f.components.begin() + 3, f.components.end(), [](const auto& c) { return c.has_value(); });
    const bool directions = moments || f.follower || kind.directions;
    if ((directions && !a.has_rotation()) || (moments && b != nullptr && !b->has_rotation()))
      throw std::invalid_argument(
          "needs a frame with axes, which nodes and point masses do not have; attach it to a rigid body, to a face, or "
          "to three nodes and "
          "more (nodes = [...])");
  }

  std::unique_ptr<FrameForce> make_force(const ForceSpec& f) {
    FramePtr a = frames_.make(f.frames[0]), b = f.frames.size() > 1 ? frames_.make(f.frames[1]) : nullptr;
    check_axes(f, *a, b.get());
    const ForceStart start{[&](Relative kind, int axis) { return measure(kind, axis, f.frames); },
                           out_.drives.contains(f.name)};
    return force_kind(f.type).make(f, std::move(a), std::move(b), start);
  }

  const Description& model_;
  Mechanism& out_;
  FrameBuilder frames_;
  std::vector<JointSpec> joints_;  // with all that the text leaves out
};

}  // namespace

std::unique_ptr<Mechanism> build(const Description& model, int threads) {
  // Loops of a step over fewer velocities take as long alone: other threads spin and wake up longer than they work
  // (engine of ./run, 1,659 of them, to 0.01 s: 0.82 s of processor time alone, 1.1 on two threads and no sooner).
  constexpr Index kShared = 2000;
  auto result = std::make_unique<Mechanism>(threads);
  Builder(model, *result).run();
  if (threads == 0 && result->system.sizes().velocity < kShared) {
    result->step_pool = nullptr;
    result->system.set_pool(nullptr);
  }
  result->keys = model.keys;
  for (const BuiltBody& body : result->bodies) {
    if (const std::optional<std::string> notice = locking_notice(body)) result->notices.push_back(*notice);
    const auto* solid = std::get_if<SolidSpec>(&body.spec.shape);
    if (solid != nullptr && std::holds_alternative<MeshFile>(solid->mesh))
      result->keys.emplace_back(fmt::format("bodies.{}.mesh.file (its content)", body.spec.name),
                                mesh_digest(*body.mesh));
    if (const LineFile* lines = line_file(body))
      result->keys.emplace_back(fmt::format("bodies.{}.mesh.file (its content)", body.spec.name),
                                mesh_digest(*lines->mesh));
    if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape); shell != nullptr && shell->file)
      result->keys.emplace_back(fmt::format("bodies.{}.mesh.file (its content)", body.spec.name),
                                mesh_digest(*shell->mesh));
  }
  return result;
}

}  // namespace espalier::dynamics::model
