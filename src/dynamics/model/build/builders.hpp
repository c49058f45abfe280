/// \file
/// Pieces of the builder: bodies and frames.
#pragma once

#include <array>
#include <stdexcept>
#include <utility>

#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// Runs `make`; what the library finds wrong gets the place in the model text.
template <class Make>
void at_place(const Place& place, const Make& make) {
  try {
    make();
  } catch (const std::invalid_argument& error) {
    fail(place, error.what());
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code != StatusCode::invalid_input && code != StatusCode::singular) throw;  // singular: of the given positions
    const std::string text = error.what();
    if (text.rfind(place.file + ":", 0) == 0) throw;  // has its place already
    fail(place, text);
  }
}

class FrameBuilder;

/// A point of a flexible body's material at nodes that are held: a node of a solid; of a shell one on either side.
struct HeldPoint {
  std::string name;
  std::vector<std::pair<Index, double>> parts;  ///< x = the sum of factors times vertices
  Vec3 reference = Vec3::Zero();                ///< mesh coordinates
};
[[nodiscard]] std::unique_ptr<FlexibleFrame> make_point_frame(const FlexibleBody& body, const HeldPoint& point);

/// As the file has it, with the sets that entries of the model name which its deck stands for. @param body  that it is
/// of
[[nodiscard]] Mesh mesh_of_file(const MeshFile& file, const std::string& body);

/// The quadrilaterals of its grid of nodes, x fastest.
[[nodiscard]] std::vector<std::array<Index, 4>> shell_quads(const ShellSpec& shell);
/// Makes one body and adds it to the system.
[[nodiscard]] BuiltBody build_body(const BodySpec& spec, const Description& model, const FrameBuilder& frames,
                                   Mechanism& out);
/// The same for what is kept of a flexible body.
void reduce_body(std::unique_ptr<FlexibleBody> nodal, const Description& model, const FrameBuilder& frames,
                 Mechanism& out, BuiltBody& body);

/// Rayleigh's damping of a body, with what stands in motions for its structural damping. @throws Error(invalid_input)
/// where there is nothing that could
[[nodiscard]] RayleighDamping body_damping(const BodySpec& spec, const Description& model);
/// What both have in common: damping, gravity, motion at the start.
void add_reduced(std::unique_ptr<ReducedBody> reduced, const Description& model, Mechanism& out, BuiltBody& body);
/// A body given by matrices from files.
void build_substructure(const Description& model, Mechanism& out, BuiltBody& body);

/// Makes frames of markers.
class FrameBuilder {
 public:
  FrameBuilder(const Description& model, const Mechanism& built) : model_(model), built_(built) {}

  /// To be called when all bodies stand and before anything else.
  void note_initial_state();
  /// @throws Error(invalid_input) with the place of the marker
  [[nodiscard]] std::unique_ptr<Frame> make(const MarkerSpec& marker) const;
  /// Where the frame is in the initial state of the model.
  [[nodiscard]] FrameMotion initial_motion(const MarkerSpec& marker) const;
  /// The configuration that note_initial_state() found.
  [[nodiscard]] ConstSpan initial_configuration() const { return q_; }
  [[noreturn]] void unknown_body(const std::string& name, const Place& place) const;
  /// Follows references. @throws on a cycle and on unknown names
  [[nodiscard]] const MarkerSpec& resolve(const MarkerSpec& marker) const;
  /// A frame on the nodes of a flexible body, which need not be in the system yet. @pre the marker is resolved
  [[nodiscard]] std::unique_ptr<FlexibleFrame> make_nodal(const MarkerSpec& marker, const BuiltBody& body) const;
  /// Nodes of a flexible body where a marker is, ascending: a node, those of a face, a bore, a node set, an edge.
  [[nodiscard]] std::vector<Index> nodes_of(const MarkerSpec& marker, const BuiltBody& body) const;
  /// Points of a marker's face, edge, bore or node set that are to be one rigid piece, by their nodes.
  [[nodiscard]] std::vector<HeldPoint> held_points(const MarkerSpec& marker, const BuiltBody& body) const;
  /// Three of them, far from each other and from a line.
  [[nodiscard]] static std::array<std::size_t, 3> base_points(const std::vector<HeldPoint>& points);
  /// The frame that stands on these three alone, and its origin in mesh coordinates.
  [[nodiscard]] static std::pair<std::unique_ptr<FlexibleFrame>, Vec3> make_base(const MarkerSpec& marker,
                                                                                 const BuiltBody& body,
                                                                                 const std::vector<HeldPoint>& points);

 private:
  [[nodiscard]] std::unique_ptr<FlexibleFrame> make_face(const MarkerSpec& marker, const BuiltBody& body,
                                                         const Mat3& axes) const;
  [[nodiscard]] std::vector<HeldPoint> points_of(const MarkerSpec& marker, const BuiltBody& body) const;
  /// Mean position and rotation of an edge or a node set.
  [[nodiscard]] std::unique_ptr<FlexibleFrame> make_mean(const MarkerSpec& marker, const BuiltBody& body,
                                                         const Mat3& axes) const;
  /// Where the mean would be, carried by the frame on three nodes.
  [[nodiscard]] std::unique_ptr<Frame> make_rigid(const MarkerSpec& marker, const BuiltBody& body) const;
  [[nodiscard]] std::vector<MeshFace> faces_of(const MarkerSpec& marker, const BuiltBody& body) const;
  [[nodiscard]] Index node(const MarkerSpec& marker, const BuiltBody& body) const;

  const Description& model_;
  const Mechanism& built_;
  std::vector<double> q_, v_;
};

/// Surfaces and the contacts between them. @throws Error(invalid_input) with the place, for surfaces that are missing,
/// empty, inside out, or overlap in the configuration q by more than is allowed
void build_surface_contacts(const Description& model, const FrameBuilder& frames, Mechanism& out);
/// After all frames. @throws Error(invalid_input) with the place
void build_support(const SupportSpec& spec, const FrameBuilder& frames, Mechanism& out);
/// Adds an equation of a model in the same way.
void build_equation(const EquationSpec& spec, const FrameBuilder& frames, Mechanism& out);
void build_tie(const TieSpec& spec, const FrameBuilder& frames, Mechanism& out);
/// Stops and friction of a joint that is in the system already.
void build_contacts(const JointSpec& spec, const FrameBuilder& frames, Joint& joint, Mechanism& out);
/// Inputs of the program and switches; before build_functions().
void build_controls(const Description& model, Mechanism& out);
/// Loads FMUs and asks them for what they tell at the start; before functions are made of that.
void build_controllers(const Description& model, Mechanism& out);
/// What forces, sensors and events are functions of; when all joints and forces stand, before the system is finished.
void build_functions(const Description& model, Mechanism& out);

}  // namespace espalier::dynamics::model
