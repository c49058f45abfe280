/// \file
/// Nodes of a flexible body that are held, or led, one by one: clamps, symmetry planes, prescribed displacements.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/capabilities.hpp"
#include "dynamics/forces/vector_function.hpp"
#include "dynamics/joints/time_function.hpp"

namespace espalier::dynamics {

/// Equations e . x - rest - f(t) = 0 for vertices x of one body and constant directions e, or sums of such products.
/// Vertices behind that of a node's position are its directors or slopes.
class Support final : public Component, public Constrains, public Switching {
 public:
  struct Term {
    Index vertex = 0;               ///< of the body
    Vec3 direction = Vec3::Zero();  ///< e, global axes
  };
  struct Row {
    std::vector<Term> parts;  ///< vertices of one node, each once
    double rest = 0;          ///< the sum of e . x at the start
    int motion = -1;          ///< f: which of the motions; -1: zero
    std::string label;        ///< "node 7, x"
  };
  /// @param body of a system already; outlives it
  Support(std::string name, const FlexibleBody& body, std::vector<Row> rows, std::vector<TimeFunction> motions);

  [[nodiscard]] const std::vector<Row>& rows() const { return rows_; }
  [[nodiscard]] const FlexibleBody& body() const { return body_; }
  /// The list of the vertices' places, each once.
  [[nodiscard]] const std::vector<Index>& places() const { return places_; }

  [[nodiscard]] Sizes sizes() const override { return {0, 0, static_cast<Index>(rows_.size())}; }
  [[nodiscard]] std::string constraint_name(Index local_row) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& /*s*/, Span /*f*/) override {}
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  void tangent(const StateView& /*s*/, const TangentWeights& /*weights*/, Span /*w_values*/) override {}
  void branches(const StateView& s, Branches& out) const override;

 private:
  /// use(row of the system, vertex, 0 to 2, value) for all entries of Phi_q that are not zero.
  template <class Use>
  void for_each_entry(const Use& use) const;

  const FlexibleBody& body_;
  std::vector<Row> rows_;
  std::vector<TimeFunction> motions_;
  std::vector<Index> places_;
  std::vector<std::size_t> position_;  // of the entries of Phi_q that are not zero, row by row
};

/// Force of a support on its body, or moment about the mean of its nodes as they stand.
[[nodiscard]] VectorFunctionPtr reaction_of(const Support& support, bool moment);

}  // namespace espalier::dynamics
