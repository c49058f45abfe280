/// \file
/// Linear equations between displacements of single nodes of solids: exact, or by springs and dashpots.
#pragma once

#include <string>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/capabilities.hpp"

namespace espalier::dynamics {

/// factor_1 x_1 + factor_2 x_2 + ... = rest, x: coordinates of vertices.
struct NodeEquation {
  struct Term {
    const FlexibleBody* body = nullptr;
    Index vertex = 0;
    int direction = 0;  ///< 0, 1, 2: x, y, z
    double factor = 0;
    [[nodiscard]] Index configuration() const { return body->configuration(vertex) + direction; }
    [[nodiscard]] Index coordinate() const { return body->coordinate(vertex) + direction; }
    [[nodiscard]] bool same_coordinate(const Term& o) const {
      return body == o.body && vertex == o.vertex && direction == o.direction;
    }
  };
  std::vector<Term> terms;  ///< each coordinate once
  double rest = 0;
  std::string label;  ///< "node 7, x"
};

/// Equations that hold exactly.
class NodeEquations final : public Component, public Constrains {
 public:
  /// @param equations  of bodies of a system already, which outlive this
  NodeEquations(std::string name, std::vector<NodeEquation> equations);
  [[nodiscard]] Sizes sizes() const override { return {0, 0, static_cast<Index>(equations_.size())}; }
  [[nodiscard]] std::string constraint_name(Index local_row) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& /*s*/, Span /*f*/) override {}
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  void tangent(const StateView& /*s*/, const TangentWeights& /*weights*/, Span /*w_values*/) override {}

 private:
  std::vector<NodeEquation> equations_;
  std::vector<std::size_t> position_;  // of the entries of Phi_q, term by term
};

/// What an equation has left, e = sum factor x - rest, is drawn back: energy 1/2 stiffness e^2, force -damping e'.
class NodeSpring final : public Component {
 public:
  NodeSpring(std::string name, NodeEquation equation, double stiffness, double damping);
  [[nodiscard]] Sizes sizes() const override { return {0, 0, 0}; }
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;

 private:
  [[nodiscard]] double value(ConstSpan q) const;
  NodeEquation equation_;
  double stiffness_, damping_;
  std::vector<std::size_t> position_;  // of the pairs of terms in W, row after row
};

}  // namespace espalier::dynamics
