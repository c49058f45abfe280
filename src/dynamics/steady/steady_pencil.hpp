/// \file
/// The quadratic problem of small motions about a steady motion.
#pragma once

#include <map>

#include "base/at.hpp"
#include "dynamics/integrators/derivatives/level_derivatives.hpp"
#include "dynamics/integrators/linearised.hpp"
#include "dynamics/steady/vector_coordinates.hpp"

namespace espalier::dynamics {

/// A matrix by columns that is added up entry by entry.
class EntrySums {
 public:
  explicit EntrySums(Index size) : columns_(at(size)) {}
  void add(Index row, Index column, double value) {
    if (value != 0) columns_[at(column)][row] += value;
  }
  [[nodiscard]] SparseMatrix matrix() const {
    SparseMatrix out;
    out.rows = out.cols = static_cast<Index>(columns_.size());
    out.col_ptr.assign(1, 0);
    for (const auto& column : columns_) {
      for (const auto& [row, value] : column) {
        out.row_ind.push_back(row);
        out.values.push_back(value);
      }
      out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
    }
    return out;
  }

 private:
  std::vector<std::map<Index, double>> columns_;
};

/// Three by three blocks on the diagonal, as they act on the velocity coordinates; the identity, or zero, elsewhere.
struct BlockDiagonal {
  std::vector<Index> block_of;  ///< n: number of the block; -1: none
  std::vector<Index> first_of;  ///< blocks: first coordinate
  std::vector<Mat3> blocks;
  double elsewhere = 0;

  /// body(row, value) for the entries of column j.
  template <class Body>
  void column(Index j, const Body& body) const {
    const Index b = block_of[at(j)];
    if (b < 0) {
      if (elsewhere != 0) body(j, elsewhere);
      return;
    }
    const Index first = first_of[at(b)];
    for (Index i = 0; i < 3; ++i) body(first + i, blocks[at(b)](i, j - first));
  }
};

/// M, C and K of steady_modes.hpp, n + r unknowns: xi and the multipliers of constraints that are kept. Rows of
/// holonomic constraints stand in K, those of the others in C and K.
struct SteadyPencil {
  SparseMatrix mass, damping, stiffness;
  std::vector<double> weights;  ///< n: diagonal of the mass matrix
  std::vector<char> holonomic;  ///< r
  BlockDiagonal axes;           ///< S
};

/// Makes it for states of one motion.
class SteadyProblem {
 public:
  /// @param q  a configuration, for the sizes of coordinates @param equations  outlives the object
  SteadyProblem(Equations& equations, const AssembledSystem& system, ConstSpan q);
  [[nodiscard]] const std::vector<VectorCoordinates>& vectors() const { return vectors_; }
  /// Angular velocities of the bodies that turn, and of points on their circles, each once; the fastest first.
  [[nodiscard]] std::vector<Vec3> rates(const State& s) const;
  /// @param rate  of the axes @param turned  what they have turned since they were the global ones
  [[nodiscard]] SteadyPencil pencil(const State& s, const Vec3& rate, const Mat3& turned);

 private:
  template <class Make>
  [[nodiscard]] BlockDiagonal with_blocks(double elsewhere, const Make& make) const;
  [[nodiscard]] SparseMatrix seen(const SparseMatrix& a, const BlockDiagonal& axes) const;
  void add_constraints(const BlockDiagonal& axes, const BlockDiagonal& of_rate, EntrySums& damping,
                       EntrySums& stiffness);
  void add_friction(const State& s, const BlockDiagonal& axes, EntrySums& stiffness);

  Equations& equations_;
  std::vector<VectorCoordinates> vectors_;
  LevelDerivatives levels_;
  Index n_;
  std::vector<Index> rows_;
  BlockDiagonal layout_;
};

}  // namespace espalier::dynamics
