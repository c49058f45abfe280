/// \file
/// Threaded assembly of element forces and tangents, with the same bits for any number of threads.
///
/// Elements are cut into chunks of consecutive elements, and the chunks are coloured so that two chunks of one colour
/// share no vertex. Colours are worked off one after the other, the chunks of a colour in parallel, the elements of a
/// chunk in order: every sum has a fixed order, and no two threads ever write to the same place. Chunks and colours
/// depend on the mesh alone.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/elements/element.hpp"

namespace espalier::dynamics {

/// Pairs of vertices that share an element, by columns: rows of column b are ind[ptr[b] .. ptr[b + 1]), sorted.
/// The pattern is symmetric and holds the diagonal.
struct VertexPattern {
  std::vector<Offset> ptr;
  std::vector<Index> ind;
  [[nodiscard]] Index columns() const { return static_cast<Index>(ptr.size()) - 1; }
  /// Position of (row, column) in ind. @throws std::logic_error when the pair shares no element
  [[nodiscard]] Offset entry(Index row, Index column) const;
};

/// The coordinates of all vertices of a body, 3 per vertex.
struct AssemblyState {
  const double* reference;
  const double* position;
  const double* velocity;  ///< may be null: zero
  double damping = 0;      ///< stiffness-proportional damping factor in seconds
};

/// Where 3 x 3 blocks of a tangent go: entry e of the vertex pattern in column b has its column j (0..2) at
/// values[column_start[3 b + j] + shift[3 e + j]], three consecutive rows.
struct BlockTarget {
  double* values;
  const Offset* column_start;
  const std::int32_t* shift;
};

/// What one element gives; number k stands at [k * stride].
struct ElementResult {
  const double* force;
  const double* tangent;  ///< null when not wanted
  double energy = 0;
  int stride = 1;
  bool whole = true;  ///< false: turned inside out, the rest is not defined
};

/// All elements of one body.
class ElementAssembly {
 public:
  /// @param vertices number of vertices of the body
  ElementAssembly(Index vertices, std::vector<std::unique_ptr<ElementGroup>> groups);

  [[nodiscard]] const VertexPattern& pattern() const { return pattern_; }
  [[nodiscard]] Index vertices() const { return pattern_.columns(); }
  [[nodiscard]] Index elements() const { return elements_; }
  [[nodiscard]] int colours() const { return static_cast<int>(colour_ptr_.size()) - 1; }

  /// Adds the internal forces to f (3 per vertex) and the strain energy to `energy`. The forces of an inverted
  /// element are NaN. @return the label of the first inverted element in order of the groups, or -1
  std::int64_t add_forces(base::ThreadPool* pool, const AssemblyState& state, double* f, double& energy) const;
  /// Adds position_weight * df/dq + velocity_weight * df/dv. @return as add_forces (its block is NaN)
  std::int64_t add_tangent(base::ThreadPool* pool, const AssemblyState& state, double position_weight,
                           double velocity_weight, const BlockTarget& target) const;
  /// Consistent mass, one number per entry of pattern().
  [[nodiscard]] std::vector<double> mass(const double* reference) const;

 private:
  struct Chunk {
    std::int32_t group;
    Index begin, end;      // elements of the group
    Offset first_element;  // number of the first one over all groups
    Offset first_pair;     // position of its first pair in pairs_
  };
  void build_pattern(Index vertices);
  void build_pairs();
  void build_chunks();
  void colour_chunks();
  template <class Body>
  void for_each_chunk(base::ThreadPool* pool, const Body& body) const;
  template <class Body>
  std::int64_t evaluate_all(base::ThreadPool* pool, const AssemblyState& state, bool tangent, double position_weight,
                            double velocity_weight, const Body& body) const;

  std::vector<std::unique_ptr<ElementGroup>> groups_;
  Index elements_ = 0;
  VertexPattern pattern_;
  std::vector<std::int32_t> pairs_;  // per element: entry - ptr[column] of every (row, column) pair, column by column
  std::vector<Chunk> chunks_;        // by colour
  std::vector<Index> colour_ptr_;
};

}  // namespace espalier::dynamics
