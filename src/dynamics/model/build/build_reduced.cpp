// Reduced bodies: which of a body's frames joints and forces hold on to, and what is kept of its motions.
#include <fmt/format.h>

#include "dynamics/bodies/reduced_frame.hpp"
#include "dynamics/elements/pressure.hpp"
#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {
namespace {

using FlexibleFrames = std::vector<std::unique_ptr<FlexibleFrame>>;

/// Frames of joints and forces on this body; frames that are outputs alone do not count.
FlexibleFrames interfaces_of(const BuiltBody& body, const Description& model, const FrameBuilder& frames) {
  FlexibleFrames result;
  const auto take = [&](const MarkerSpec& marker) {
    const MarkerSpec& resolved = frames.resolve(marker);
    if (resolved.body != body.spec.name) return;
    at_place(resolved.place, [&] { result.push_back(frames.make_nodal(resolved, body)); });
  };
  for (const JointSpec& joint : model.joints)
    for (const MarkerSpec& marker : joint.frames) take(marker);
  for (const ForceSpec& force : model.forces)
    for (const MarkerSpec& marker : force.frames) take(marker);
  return result;
}

/// Nodal forces of unit pressures on faces of this body.
Eigen::MatrixXd pressures_on(const BuiltBody& body, const Description& model) {
  const auto reference = body.flexible->reference();
  Eigen::MatrixXd loads(static_cast<Eigen::Index>(reference.size()), 0);
  for (const ForceSpec& force : model.forces) {
    if (force.type != ForceType::pressure || force.body != body.spec.name || !body.mesh) continue;
    loads.conservativeResize(Eigen::NoChange, loads.cols() + 1);
    loads.rightCols(1).setZero();
    at_place(force.place, [&] {
      for (const MeshFace& face : body.mesh->face_set(force.face)) {
        const std::vector<Index> nodes = body.mesh->face_nodes(face);
        std::vector<double> x, f(3 * nodes.size(), 0.0);
        for (const Index node : nodes)
          x.insert(x.end(), &reference[3 * static_cast<std::size_t>(node)],
                   &reference[3 * static_cast<std::size_t>(node)] + 3);
        const auto& shape = shape_of(body.mesh->type(face.element)).faces[static_cast<std::size_t>(face.face)];
        add_pressure_force(shape.type, 1, x.data(), f.data());
        for (std::size_t i = 0; i < f.size(); ++i)
          loads(3 * nodes[i / 3] + static_cast<Index>(i % 3), loads.cols() - 1) += f[i];
      }
    });
  }
  return loads;
}

/// What a place for each of many loads costs, and what serves instead.
void note_loaded_nodes(BuiltBody& body, const Description& model, const FrameBuilder& frames,
                       const ReducedBasis& shapes) {
  constexpr std::size_t kMany = 4;
  std::size_t nodes = 0;
  for (const ForceSpec& force : model.forces)
    for (const MarkerSpec& marker : force.frames) {
      const MarkerSpec& at = frames.resolve(marker);
      if (at.body == body.spec.name && (at.node || (at.near && at.face.empty()))) ++nodes;
    }
  if (nodes < kMany) return;
  body.notices.push_back(fmt::format(
      "it is reduced, and each of the {} nodes that forces act on is an interface with static shapes of its own: {} of "
      "its {} shapes. What a step costs grows with their square. One force on a face or a node set (face = \"SET\", "
      "nodes = \"SET\") or a pressure has the shapes of one interface; loads on very many nodes are cheaper without "
      "'reduce'",
      nodes, shapes.from_interfaces, shapes.mass.size()));
}

}  // namespace

void reduce_body(std::unique_ptr<FlexibleBody> nodal, const Description& model, const FrameBuilder& frames,
                 Mechanism& out, BuiltBody& body) {
  if (!body.pieces.empty())
    throw std::invalid_argument(body.pieces + "; a reduced body is one piece: make a body of each by 'element_set'");
  auto alone = std::make_unique<NodalBody>(std::move(nodal));
  body.flexible = &alone->body();
  const FlexibleFrames held = interfaces_of(body, model, frames);
  std::vector<const FlexibleFrame*> interfaces;
  for (const auto& frame : held) interfaces.push_back(frame.get());
  Options solver;
  solver.device = "cpu";
  solver.threads = out.pool.size();
  ReducedBasis shapes = reduce(*alone, interfaces, pressures_on(body, model), *body.spec.reduction, solver);
  ReducedInertia inertia = inertia_of_mesh(alone->body(), shapes);
  note_loaded_nodes(body, model, frames, shapes);
  add_reduced(std::make_unique<ReducedBody>(std::move(alone), std::move(shapes), std::move(inertia), 0), model, out,
              body);
}

void add_reduced(std::unique_ptr<ReducedBody> reduced, const Description& model, Mechanism& out, BuiltBody& body) {
  reduced->set_damping(body_damping(body.spec, model));
  reduced->set_gravity(body.spec.gravity.value_or(model.gravity));
  const Vec3 at_origin = body.spec.velocity - body.spec.angular_velocity.cross(body.spec.position);
  reduced->set_initial_motion(body.spec.rotation, body.spec.position, at_origin, body.spec.angular_velocity);
  body.reduced = &out.system.add(std::move(reduced));
}

}  // namespace espalier::dynamics::model
