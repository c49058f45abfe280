// The public entry of reduced matrices: one body of a model by itself; failures become a status.
#include "espalier/reduced_matrices.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <new>
#include <numbers>

#include "dynamics/bodies/craig_bampton.hpp"
#include "dynamics/bodies/fixed_interfaces.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/frames/names.hpp"
#include "dynamics/model/read/expand.hpp"

namespace espalier {
namespace dynamics::model {
namespace {

[[noreturn]] void refuse_reduction(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

const BodySpec& flexible_body(const Description& model, const std::string& name) {
  std::vector<std::string> names;
  const BodySpec* found = nullptr;
  for (const BodySpec& body : model.bodies) {
    const bool flexible = !body.rigid() && !std::holds_alternative<PointSpec>(body.shape) &&
                          !std::holds_alternative<SubstructureSpec>(body.shape);
    if (flexible) names.push_back(body.name);
    if (name.empty() ? flexible : body.name == name) found = &body;
    if (body.name != name || flexible) continue;
    refuse_reduction(std::holds_alternative<SubstructureSpec>(body.shape)
                         ? fmt::format("'{}' is made of matrices from files already; take these", name)
                         : fmt::format("'{}' is rigid: it has no stiffness; its mass and inertia say all", name));
  }
  if (name.empty() && names.size() > 1)
    refuse_reduction(fmt::format("say which body is to be reduced: {}", fmt::join(names, ", ")));
  if (found == nullptr)
    refuse_reduction(name.empty() ? "the model has no flexible body"
                                  : fmt::format("there is no body '{}'{}", name, suggestion(name, names)));
  return *found;
}

struct NamedFrame {
  std::string name;
  MarkerSpec marker;
};

/// Frames by their names, or those of joints and forces on the body; each place once.
std::vector<NamedFrame> wanted_frames(const Description& model, const BodySpec& body, const FrameBuilder& frames,
                                      const std::vector<std::string>& names) {
  std::vector<NamedFrame> out;
  Description lookup = model;
  for (const std::string& name : names) {
    MarkerSpec& marker = lookup.markers["\n"];  // no name of a text
    marker = {};
    marker.reference = name;
    marker.place = {model.file, 0, "interfaces"};
    settle_frame_names(lookup);
    const MarkerSpec& resolved = frames.resolve(marker);
    if (resolved.body != body.name)
      refuse_reduction(fmt::format("the interface '{}' is on '{}', not on '{}'", name, resolved.body, body.name));
    out.push_back({name, resolved});
  }
  if (!names.empty()) return out;
  const auto take = [&](const std::string& owner, const std::vector<MarkerSpec>& list) {
    for (std::size_t k = 0; k < list.size(); ++k) {
      const MarkerSpec& resolved = frames.resolve(list[k]);
      if (resolved.body != body.name) continue;
      out.push_back({list[k].reference.empty() ? fmt::format("{}.{}", owner, "abcd"[k]) : list[k].reference, resolved});
    }
  };
  for (const JointSpec& joint : model.joints) take(joint.name, joint.frames);
  for (const ForceSpec& force : model.forces) take(force.name, force.frames);
  return out;
}

/// Two joints may hold on to the same place.
bool same_place(const FlexibleFrame& a, const FlexibleFrame& b) {
  const auto& x = a.vertices();
  const auto& y = b.vertices();
  return std::equal(x.begin(), x.end(), y.begin(), y.end(), [](const FrameVertex& p, const FrameVertex& q) {
    return p.vertex == q.vertex && p.weight == q.weight && p.arm == q.arm;
  });
}

/// The body alone, as a model of its own.
Description alone(const Description& model, const BodySpec& body, const FrameBuilder& frames) {
  Description one;
  one.file = model.file;
  one.folder = model.folder;
  one.units = model.units;
  one.bodies = {body};
  one.bodies.front().reduction.reset();
  one.bodies.front().modal_damping = 0;
  for (const auto& [name, marker] : model.markers)
    if (frames.resolve(marker).body == body.name) one.markers[name] = frames.resolve(marker);
  return one;
}

ReductionOptions kept(const BodySpec& body, const ReducedMatricesOptions& what) {
  constexpr double kModes = 20;
  ReductionOptions out = body.reduction.value_or(ReductionOptions{});
  if (what.modes >= 0 || what.frequency > 0) out = ReductionOptions{};
  if (what.modes >= 0) out.modes = what.modes;
  if (what.frequency > 0) out.frequency = what.frequency;
  if (!std::isfinite(out.modes) && !std::isfinite(out.frequency)) out.modes = kModes;
  return out;
}

std::array<double, 3> three(const Vec3& x) { return {x.x(), x.y(), x.z()}; }

std::vector<double> flat(const Eigen::MatrixXd& a) { return {a.data(), a.data() + a.size()}; }

void fill_places(const FlexibleBody& body, const BuiltBody& built, ReducedMatrices& out) {
  const auto reference = body.reference();
  const auto step = 3 * at(body.vertices_per_node());
  out.vectors_per_node = body.vertices_per_node();
  for (Index k = 0; k < body.nodes(); ++k) {
    out.nodes.push_back(built.mesh ? built.mesh->node_label(k) : k + 1);
    const double* x = reference.data() + at(k) * step;
    out.node_positions.insert(out.node_positions.end(), x, x + 3);
  }
}

void fill(const Description& model, const ReducedMatricesOptions& what, const Options& solver, ReducedMatrices& out) {
  const BodySpec body = flexible_body(model, what.body);
  Mechanism none(1);  // names need no bodies
  const FrameBuilder names(model, none);
  const std::vector<NamedFrame> wanted = wanted_frames(model, body, names, what.interfaces);
  const Description one = alone(model, body, names);
  const std::unique_ptr<Mechanism> built = build(one, solver.threads);
  const BuiltBody& flexible = built->bodies.front();
  if (flexible.spec.massless)
    refuse_reduction(fmt::format("'{}' has no density, and so no mass matrix; give its material a density", body.name));
  if (!flexible.pieces.empty())
    refuse_reduction(flexible.pieces + "; a reduced body is one piece: make a body of each by 'element_set'");
  const FlexibleBody& nodal = *flexible.flexible;
  const FrameBuilder frames(one, *built);
  std::vector<std::unique_ptr<FlexibleFrame>> held;
  std::vector<const FlexibleFrame*> interfaces;
  std::vector<std::string> labels;
  for (const NamedFrame& frame : wanted)
    at_place(frame.marker.place, [&] {
      auto made = frames.make_nodal(frame.marker, flexible);
      const bool known = std::any_of(interfaces.begin(), interfaces.end(),
                                     [&](const FlexibleFrame* other) { return same_place(*made, *other); });
      if (known) return;
      labels.push_back(frame.name);
      held.push_back(std::move(made));
      interfaces.push_back(held.back().get());
    });
  const SparseMatrix mass = fixed_interfaces::reference_matrix(built->system, nodal, {1, 0, 0});
  const SparseMatrix stiffness = fixed_interfaces::reference_matrix(built->system, nodal, {0, 0, 1});
  const ReductionOptions options = kept(body, what);
  const CraigBampton reduced = craig_bampton(nodal, mass, stiffness, interfaces, labels, options, solver);

  out.body = body.name;
  out.units = model.units;
  out.size = static_cast<Index>(reduced.mass.cols());
  std::int64_t node = what.first_node;
  Index row = 0;
  for (std::size_t k = 0; k < interfaces.size(); ++k) {
    FrameMotion motion;
    interfaces[k]->motion(nodal.reference(), {}, motion);
    const int components = interfaces[k]->has_rotation() ? 6 : 3;
    out.interfaces.push_back({labels[k], node++, three(motion.r), components, row});
    row += components;
  }
  out.first_scalar = node;
  for (const double square : reduced.squares)
    out.frequencies.push_back(std::sqrt(std::max(0.0, square)) / (2 * std::numbers::pi));
  const RayleighDamping rayleigh = body_damping(body, model);
  Eigen::MatrixXd damping = rayleigh.mass * reduced.mass + rayleigh.stiffness * reduced.stiffness;
  for (Eigen::Index k = 0; k < reduced.squares.size(); ++k)
    damping(row + k, row + k) += 2 * body.modal_damping * std::sqrt(std::max(0.0, reduced.squares[k]));
  if (body.modal_damping > 0)
    out.notices.push_back(
        "damping by 'ratio' is that of the modes with the interfaces at rest; motions of the interfaces have none of "
        "it");
  out.stiffness = flat(reduced.stiffness);
  out.mass = flat(reduced.mass);
  if (!damping.isZero(0)) out.damping = flat(damping);
  out.shapes = flat(reduced.shapes);
  out.position = three(body.position);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.rotation[at(3 * i + j)] = body.rotation(i, j);
  const std::vector<double> rest(nodal.reference().size(), 0.0);
  const MassProperties properties = nodal.mass_properties(nodal.reference(), rest);
  out.total_mass = properties.mass;
  out.centre = properties.centre;
  fill_places(nodal, flexible, out);
  out.notices.insert(out.notices.end(), flexible.notices.begin(), flexible.notices.end());
}

}  // namespace
}  // namespace dynamics::model

ReducedMatrices reduced_matrices_of_text(const std::string& text, const std::string& name,
                                         const ReducedMatricesOptions& what, const SimulationOptions& options) {
  using namespace dynamics::model;
  ReducedMatrices result;
  try {
    constexpr std::int64_t kMostNode = 90'000'000;  // Nastran's numbers have eight digits
    if (what.first_node < 1 || what.first_node > kMostNode)
      refuse_reduction(fmt::format("the number of the first node must lie between 1 and {}", kMostNode));
    Value root = parse_toml(text, name);
    expand(root, options.set);
    if (root.find("integrator") == nullptr && root.find("statics") == nullptr)  // nothing is run
      set_value(root, "integrator.end", parse_assignment("end=1").value);
    Options solver;
    for (const auto& [key, value] : options.solver)
      if (key == "threads") solver.threads = std::stoi(value);
    solver.device = "cpu";
    solver.interrupted = options.interrupted;
    fill(read_description(root, name), what, solver, result);
  } catch (const Error& error) {
    result.status = error.status();
  } catch (const std::invalid_argument& error) {
    result.status = {StatusCode::invalid_input, error.what(), -1};
  } catch (const std::bad_alloc&) {
    result.status = {StatusCode::out_of_memory, "the machine's memory is too small for this body", -1};
  }
  return result;
}

ReducedMatrices reduced_matrices(const std::string& path, const ReducedMatricesOptions& what,
                                 const SimulationOptions& options) {
  std::string text;
  try {
    text = dynamics::read_whole_file(path);
  } catch (const Error& error) {
    ReducedMatrices result;
    result.status = error.status();
    return result;
  }
  return reduced_matrices_of_text(text, path, what, options);
}

}  // namespace espalier
