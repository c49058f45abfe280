/// \file
/// A deformable body in absolute nodal coordinates: solids from a mesh, or chains of ANCF cables or beams, or shells.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/bodies/beam_axis.hpp"
#include "dynamics/dae/capabilities.hpp"
#include "dynamics/device/device_assembly.hpp"
#include "dynamics/elements/assembly.hpp"
#include "dynamics/elements/groups.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Damping force mass * M v + stiffness * (Kelvin-Voigt stress, which is K v at small strain). The stiffness part is
/// frame-indifferent: rigid motion is not damped by it. The mass part damps every motion, rigid motion too.
struct RayleighDamping {
  double mass = 0;       ///< alpha in 1/s
  double stiffness = 0;  ///< beta in s
};

/// What assembling has cost so far; without tasks that a system with threads has run (Component::plan_residual()).
struct AssemblyTimes {
  double force_seconds = 0;
  double tangent_seconds = 0;
  std::int64_t forces = 0;    ///< number of residual evaluations
  std::int64_t tangents = 0;  ///< number of tangent evaluations
};

/// Mass, centre and momenta of a body in a given state.
struct MassProperties {
  double mass = 0;
  Point centre{};            ///< centre of mass
  Point momentum{};          ///< linear momentum
  Point angular_momentum{};  ///< about the origin
};

/// Equations: M a + alpha M v + f_int(q, v) - M g = 0. M is constant (consistent mass).
/// The configuration holds 3 numbers per vertex: node positions and, for ANCF bodies, the gradient vectors of the
/// node behind its position (`vertices_per_node` vertices per node: solids 1, cables and shells 2, beams 4).
class FlexibleBody final : public Component, public Scaled, public HasTasks, public Turns, public OnDevice {
 public:
  /// @param reference coordinates of all vertices in the stress-free state, 3 each; also the initial configuration
  /// @param pool threads for making it and for assembly; not owned, may be null (then the calling thread works)
  FlexibleBody(std::string name, int vertices_per_node, std::vector<double> reference,
               std::vector<std::unique_ptr<ElementGroup>> groups, base::ThreadPool* pool = nullptr);

  // Settings; all before the first evaluation.
  void set_damping(const RayleighDamping& damping) { damping_ = damping; }
  [[nodiscard]] const RayleighDamping& damping() const { return damping_; }
  /// Acceleration of gravity in global axes.
  void set_gravity(const Point& gravity);
  /// Initial state: the reference turned by `rotation` (row by row), moved by `translation`, with the velocities of a
  /// rigid motion: velocity of the point at the origin, angular velocity, global axes.
  void set_initial_motion(const std::array<double, 9>& rotation, const Point& translation, const Point& velocity,
                          const Point& angular_velocity);

  [[nodiscard]] Index nodes() const { return assembly_.vertices() / vertices_per_node_; }
  [[nodiscard]] Index vertices() const { return assembly_.vertices(); }
  [[nodiscard]] int vertices_per_node() const { return vertices_per_node_; }
  [[nodiscard]] std::span<const double> reference() const { return reference_; }
  [[nodiscard]] const ElementAssembly& assembly() const { return assembly_; }
  /// Consistent mass, one number for every entry of assembly().pattern().
  [[nodiscard]] std::span<const double> mass() const { return mass_; }
  /// The longest edge of the box around the nodes in the reference state.
  [[nodiscard]] double size() const { return extent_; }
  /// Global index of the first velocity coordinate of vertex `vertex`; valid after place().
  [[nodiscard]] Index coordinate(Index vertex) const { return placement().v + 3 * vertex; }
  /// Position in the global configuration of the first number of vertex `vertex`; valid after place().
  [[nodiscard]] Index configuration(Index vertex) const { return placement().q + 3 * vertex; }
  [[nodiscard]] MassProperties mass_properties(ConstSpan q, ConstSpan v) const;
  [[nodiscard]] const AssemblyTimes& times() const { return times_; }
  /// Label of the element that the last evaluation found inverted, or -1. Its forces were NaN.
  [[nodiscard]] std::int64_t inverted_element() const { return inverted_; }

  // Elements that fail: ElementAssembly::set_failed(), with mass and weight. The pattern is another one then: the
  // system's finish() has to follow before anything is evaluated.
  /// Before the first evaluation: elements may fail, so that the host evaluates them.
  void let_elements_fail() { elements_fail_ = true; }
  void set_failed(std::vector<char> failed);

  // Component
  [[nodiscard]] Sizes sizes() const override;
  [[nodiscard]] std::string coordinate_name(Index local_coordinate) const override;
  void initial(Span q, Span v) const override;
  void magnitude(ConstSpan q, Span out) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  Stages plan_residual(const StateView& s) override;
  void residual_task(int stage, std::int64_t task, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  /// The rotation that brings the nodes (and, for ANCF bodies, the gradients) of one configuration nearest to those of
  /// the other: Kabsch, Acta Cryst. A32 (1976). None for points on a line, which leave it open.
  [[nodiscard]] std::optional<BodyTurn> turn(ConstSpan from, ConstSpan to) const override;
  /// Bodies whose laws GPUs know; of shells, cables and beams those that have some elements: the launches of one body
  /// take as long as 500 cables on one core.
  [[nodiscard]] bool fits_device() const override;
  /// Whatever the number of elements.
  void fit_device_always() { fewest_on_device_ = 0; }
  void use_device(DeviceAssembly& device, std::span<const Offset> k_ptr) override;
  void leave_device() override {
    device_.reset();
    residual_started_ = tangent_started_ = false;  // what failed
  }
  [[nodiscard]] bool on_device() const { return device_ != nullptr; }
  void start_residual(const StateView& s) override;
  void start_tangent(const StateView& s, const TangentWeights& weights, double* device_values) override;
  void start_residual_there(const StateView& there, double* f_there) override;
  void start_tangent_there(const StateView& there, const TangentWeights& weights, double* device_values) override;

 private:
  [[nodiscard]] BodyState own(const StateView& s) const;
  [[nodiscard]] BodyState own_there(const StateView& there) const;
  /// body(begin, end) over ranges of vertices, in parallel.
  template <class Body>
  void for_ranges_of_vertices(const Body& body) const;
  void add_inertia(ElementAssembly::VertexRange range, const double* a, const double* v, double* f) const;
  [[nodiscard]] AssemblyState state(const StateView& s) const;
  [[nodiscard]] bool is_position(Index vertex) const { return vertex % vertices_per_node_ == 0; }
  [[nodiscard]] double largest_extent() const;

  int vertices_per_node_;
  std::vector<double> reference_, initial_position_, initial_velocity_;
  double extent_;  // of the reference: the longest edge of the box around its nodes
  ElementAssembly assembly_;
  std::vector<double> mass_;    // per entry of the vertex pattern
  std::vector<double> weight_;  // M g, 3 per vertex
  Point gravity_{};
  RayleighDamping damping_;
  std::vector<Offset> column_start_;  // per velocity coordinate: start of its column in W
  std::vector<std::int32_t> shift_;   // see BlockTarget
  std::unique_ptr<DeviceBody> device_;
  Index fewest_on_device_ = 500;  // elements, where a node has more than its position
  bool residual_started_ = false, tangent_started_ = false;
  bool elements_fail_ = false;
  bool forces_stay_ = false;  // of the residual that was started: on the GPU
  BodyState planned_;         // of plan_residual()
  bool residual_planned_ = false;
  AssemblyTimes times_;
  std::int64_t inverted_ = -1;
};

/// A solid body of the elements of one mesh (an empty list: all of its elements).
std::unique_ptr<FlexibleBody> make_solid_body(std::string name, const Mesh& mesh, const Material& material,
                                              const SolidOptions& options = {}, std::span<const Index> elements = {},
                                              base::ThreadPool* pool = nullptr);
/// A straight chain of `elements` beams from `start` to `end`; the section's y axis lies in the plane of the axis
/// and `y_direction`.
std::unique_ptr<FlexibleBody> make_beam_body(std::string name, const Point& start, const Point& end,
                                             const Point& y_direction, Index elements, const BeamSection& section);
/// The same along any axis; the unstressed beam has its shape.
/// @throws std::invalid_argument as make_beam_axis()
std::unique_ptr<FlexibleBody> make_beam_body(std::string name, const AxisShape& axis, const Point& y_direction,
                                             Index elements, const BeamSection& section);
/// A straight chain of `elements` cables from `start` to `end`.
std::unique_ptr<FlexibleBody> make_cable_body(std::string name, const Point& start, const Point& end, Index elements,
                                              const CableSection& section);
/// Shells: positions and unit directors of the nodes, quadrilaterals.
std::unique_ptr<FlexibleBody> make_shell_body(std::string name, const std::vector<Point>& positions,
                                              const std::vector<Point>& directors,
                                              const std::vector<std::array<Index, 4>>& quads, const Material& material,
                                              double thickness);

}  // namespace espalier::dynamics
