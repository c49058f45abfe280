/// \file
/// Faces of solids under a pressure of one: forces and their change, in the coordinates of the body.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "dynamics/bodies/reduced_body.hpp"

namespace espalier::dynamics {

/// Even over the faces, normal to them, on their deformed area (a follower): F = p * integral of N_a (dx/dxi x
/// dx/deta).
class PressedFaces {
 public:
  virtual ~PressedFaces() = default;
  /// Velocity coordinates of the body that the faces depend on, each once.
  [[nodiscard]] const std::vector<Index>& rows() const { return rows_; }
  /// What the pressure is called in outputs.
  [[nodiscard]] virtual const char* value_name() const { return "pressure"; }
  virtual void declare(PatternBuilder& w) const = 0;
  virtual void bind(const SparsePattern& w) = 0;
  /// The force of a pressure of -1, one entry for each of rows().
  [[nodiscard]] virtual std::vector<double> slope(ConstSpan q) const = 0;
  /// Adds scale times the derivative of slope().
  virtual void add_tangent(ConstSpan q, double scale, Span w_values) const = 0;

 protected:
  std::vector<Index> rows_;
};

/// @param body of a system already @param mesh the one that the body was made of
/// @throws std::invalid_argument unless the body is a solid; std::logic_error if the faces belong to another mesh
[[nodiscard]] std::unique_ptr<PressedFaces> press_nodal(const FlexibleBody& body, const Mesh& mesh,
                                                        std::span<const MeshFace> faces);
/// A side of a shell, at an offset from the middle along its directors: on top > 0, below < 0.
/// @param quads nodes, anticlockwise seen from the top
[[nodiscard]] std::unique_ptr<PressedFaces> press_shell(const FlexibleBody& body,
                                                        std::span<const std::array<Index, 4>> quads, double offset);
/// The same of a reduced body.
[[nodiscard]] std::unique_ptr<PressedFaces> press_reduced(const ReducedBody& body, const Mesh& mesh,
                                                          std::span<const MeshFace> faces);

}  // namespace espalier::dynamics
