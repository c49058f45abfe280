/// \file
/// Products of two vectors of flexible bodies' material that stay what they are: angles between directors of shells,
/// and between those and the sections of beams.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/capabilities.hpp"

namespace espalier::dynamics {

/// The sum of factors times vertices of a body.
struct MaterialVector {
  const FlexibleBody* body = nullptr;
  std::vector<std::pair<Index, double>> parts;  ///< vertices and their factors
};

/// u . w = rest, row by row.
class ConstantProducts final : public Component, public Constrains {
 public:
  struct Row {
    MaterialVector u, w;
    double rest = 0;
    std::string label;  ///< "node 7, angle"
  };
  /// @param rows  of bodies of a system already, which outlive this
  ConstantProducts(std::string name, std::vector<Row> rows) : Component(std::move(name)), rows_(std::move(rows)) {}
  [[nodiscard]] Sizes sizes() const override { return {0, 0, static_cast<Index>(rows_.size())}; }
  [[nodiscard]] std::string constraint_name(Index local_row) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& /*s*/, Span /*f*/) override {}
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;

 private:
  std::vector<Row> rows_;
  std::vector<std::size_t> position_;  // of the entries of Phi_q: of u, then of w, three for each part, row by row
  std::vector<std::size_t> pairs_;     // of W: parts of u with those of w, three each, and their mirror images
};

}  // namespace espalier::dynamics
