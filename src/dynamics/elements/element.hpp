/// \file
/// What every deformable element offers to the bodies that are made of it.
///
/// A body's coordinates are 3-vectors, called vertices here: the positions of its nodes and, for ANCF elements, the
/// gradient vectors that stand beside them. Every force and every tangent is therefore made of 3 x 3 blocks, and the
/// mass matrix of one number per pair of vertices (times the 3 x 3 identity).
#pragma once

#include <span>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::dynamics {

struct DeviceLaw;

/// The state of one element; arrays of 3 * vertices numbers, x y z of vertex 0 first.
struct ElementInput {
  const double* reference;     ///< coordinates in the stress-free state
  const double* position;      ///< coordinates now
  const double* velocity;      ///< their rates; may be null (then taken as zero)
  double damping = 0;          ///< stiffness-proportional (Kelvin-Voigt) factor beta in seconds: stress(E + beta dE/dt)
  double position_weight = 1;  ///< the tangent is position_weight * df/dq + velocity_weight * df/dv
  double velocity_weight = 0;
};

/// What an evaluation writes. n = 3 * vertices.
struct ElementOutput {
  double* force;              ///< n: internal force f, the gradient of the strain energy plus the damping force
  double* tangent = nullptr;  ///< n x n column by column, or null when not wanted
  double energy = 0;          ///< strain energy (written, not added)
};

/// The state of several elements side by side: number k of the element in lane l at [k * width + l], k as in
/// ElementInput.
struct BlockInput {
  const double* reference;
  const double* position;
  const double* velocity;  ///< may be null: zero
  double damping = 0, position_weight = 1, velocity_weight = 0;
};

/// What they give, in the same order; arrays as in ElementOutput.
struct BlockOutput {
  double* force;
  /// May be null: not wanted. Where it is symmetric (no damping, or no velocity) only the 3 x 3 blocks of vertices a <=
  /// b need be written.
  double* tangent = nullptr;
  double* energy = nullptr;  ///< one per lane
};

/// Where an element says what is in it, for outputs: nowhere, in the middle, at the four points of a tetrahedron of
/// second order, at the 2 x 2 x 2 Gauss points of a hexahedron, the 3 x 2 of a wedge, or at -1, 0, 1 along a line.
enum class SamplePoints { none, centre, tetrahedron, hexahedron, wedge, line };

/// What is there. Solids and shells: strains of Green and Lagrange in the order 11 22 33 12 23 13, shear twice, as the
/// element assumes them. Beams: N Qy Qz T My Mz. Cables: N and the moment in global axes. All without viscous stress.
struct ElementSamples {
  double value[8][6] = {};
};

/// A set of elements of one kind. Stateless: evaluate() is a function of its arguments alone, so that calls from
/// several threads, in any order, give the same bits.
class ElementGroup {
 public:
  virtual ~ElementGroup() = default;
  [[nodiscard]] virtual Index count() const = 0;
  [[nodiscard]] virtual int vertices_per_element() const = 0;
  /// The body's vertex indices of element e.
  [[nodiscard]] virtual std::span<const Index> vertices(Index e) const = 0;
  /// Internal force, tangent and energy. @return false when the element has turned inside out (output undefined)
  [[nodiscard]] virtual bool evaluate(Index e, const ElementInput& in, ElementOutput& out) const = 0;
  /// How many elements evaluate_block() takes; 1: there is only evaluate().
  [[nodiscard]] virtual int width() const { return 1; }
  /// Evaluates width() elements side by side; what a lane gives does not depend on the others.
  /// @return bit l is set where the element of lane l is whole; the others' output is undefined
  [[nodiscard]] virtual unsigned evaluate_block(const BlockInput&, const BlockOutput&) const { return 0; }
  /// What GPUs have to know of these elements (device_law.hpp); null: the host alone evaluates them.
  [[nodiscard]] virtual const DeviceLaw* device_law() const { return nullptr; }
  /// Consistent mass, vertices x vertices, one number per pair: integral of density * N_a * N_b.
  virtual void mass(Index e, const double* reference, double* m) const = 0;
  [[nodiscard]] virtual SamplePoints sample_points() const { return SamplePoints::none; }
  /// @return false when the element has turned inside out (output undefined)
  [[nodiscard]] virtual bool sample(Index /*e*/, const double* /*reference*/, const double* /*position*/,
                                    ElementSamples& /*out*/) const {
    return false;
  }
  /// Number of the element in messages (its number in the mesh file, or its position counted from 1).
  [[nodiscard]] virtual std::int64_t label(Index e) const { return e + 1; }
};

/// Largest number of vertices of any element (hex20).
inline constexpr int kMaxVertices = 20;
inline constexpr int kMaxElementDofs = 3 * kMaxVertices;
/// Largest width().
inline constexpr int kMaxLanes = 8;
inline constexpr int kMaxBlockDofs = 24;

}  // namespace espalier::dynamics
