/// \file
/// Threaded assembly of element forces and tangents, with the same bits for any number of threads.
///
/// Elements are evaluated into buffers, as many side by side as their group has lanes; then sums are made by position
/// (gather.hpp). The tangents of a whole body would be some gigabytes, so they are made and added in batches of
/// consecutive elements that stay in cache; a sum over several batches goes on where the last one ended, so batches do
/// not change a bit either.
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/elements/element.hpp"
#include "dynamics/elements/gather.hpp"

namespace espalier::dynamics {

/// The coordinates of all vertices of a body, 3 per vertex.
struct AssemblyState {
  const double* reference;
  const double* position;
  const double* velocity;  ///< may be null: zero
  double damping = 0;      ///< stiffness-proportional damping factor in seconds
  /// Whether tangents are symmetric: forces are gradients of an energy where there is no viscous stress.
  [[nodiscard]] bool symmetric() const { return damping == 0 || velocity == nullptr; }
};

/// Where 3 x 3 blocks of a tangent go: entry e of the vertex pattern in column b has its column j (0..2) at
/// values[column_start[3 b + j] + shift[3 e + j]], three consecutive rows.
struct BlockTarget {
  double* values;
  const Offset* column_start;
  const std::int32_t* shift;
  [[nodiscard]] double* place(Index column, Offset entry, int j) const {
    return values + column_start[3 * at(column) + at(j)] + shift[3 * at(entry) + at(j)];
  }
};

/// All elements of one body. Calls on one object exclude each other: they share the buffers.
class ElementAssembly {
 public:
  /// @param vertices number of vertices of the body
  /// @param pool threads that make the lists; may be null
  /// @throws std::invalid_argument when an element names a vertex that the body has not; Error(invalid_input) when
  /// there are more elements than 32-bit lists can name
  ElementAssembly(Index vertices, std::vector<std::unique_ptr<ElementGroup>> groups, base::ThreadPool* pool = nullptr);
  ~ElementAssembly();

  [[nodiscard]] const VertexPattern& pattern() const { return pattern_; }
  [[nodiscard]] Index vertices() const { return pattern_.columns(); }
  [[nodiscard]] Index elements() const { return elements_; }
  /// use(group, vertices of the body, element by element) for all groups, in the order in which elements are counted.
  template <class Use>
  void for_each_group(const Use& use) const {
    for (const Kind& kind : kinds_) use(*kind.group, std::span<const Index>(kind.vertex));
  }
  /// Elements with a mark (one for each, in the order in which they are counted; empty: none) give no force, tangent or
  /// energy from now on, whatever their state is, and their pairs of vertices leave pattern() unless other elements
  /// have them. Their mass stays, lumped: see mass(). What a mark stands for may be taken back by another call.
  void set_failed(std::vector<char> failed, base::ThreadPool* pool = nullptr);
  [[nodiscard]] std::span<const char> failed() const { return failed_; }
  /// Masses of an element: between its n vertices (n x n), and one for each where it has failed.
  struct ElementMass {
    std::span<const Index> vertices;
    std::vector<double> consistent, lumped;
  };
  /// Lumped by scaling the diagonal to the whole mass, so that none is negative whatever the shape: E. Hinton, T. Rock,
  /// O. C. Zienkiewicz, Earthquake Engng. Struct. Dyn. 4 (1976). @pre 0 <= element < elements()
  [[nodiscard]] ElementMass element_mass(Index element, const double* reference) const;
  /// What messages call element number `element` over all groups; -1: none has this number.
  [[nodiscard]] std::int64_t label(std::int64_t element) const;
  /// Numbers of the elements by what messages call them; of several with one label the first.
  [[nodiscard]] std::unordered_map<std::int64_t, Index> numbers_by_label() const;
  /// Number of batches that a tangent is made in.
  [[nodiscard]] int batches() const;

  /// Adds the internal forces to f (3 per vertex) and the strain energy to `energy`. The forces of an inverted
  /// element are NaN. @return the label of the first inverted element in order of the groups, or -1
  std::int64_t add_forces(base::ThreadPool* pool, const AssemblyState& state, double* f, double& energy);
  /// add_forces() as tasks of two stages, for who has more to do beside them. Those of a stage may run at the same
  /// time, after all of the stage before. The arrays of the state stay until the end.
  void begin_forces(const AssemblyState& state);
  [[nodiscard]] std::int64_t element_tasks() const;
  void run_element_task(std::int64_t task);
  [[nodiscard]] std::int64_t vertex_tasks() const;
  /// The vertices first .. last - 1 whose forces a task of the second stage adds up.
  struct VertexRange {
    Index first, last;
  };
  VertexRange run_vertex_task(std::int64_t task, double* f);
  /// @param energy  the strain energy is added to it; null: it is not wanted @return as add_forces()
  std::int64_t end_forces(double* energy);
  /// Adds position_weight * df/dq + velocity_weight * df/dv. @return as add_forces (its block is NaN)
  std::int64_t add_tangent(base::ThreadPool* pool, const AssemblyState& state, double position_weight,
                           double velocity_weight, const BlockTarget& target);
  /// Consistent mass, one number per entry of pattern(); that of elements that have failed is lumped to their vertices.
  [[nodiscard]] std::vector<double> mass(const double* reference, base::ThreadPool* pool = nullptr) const;

 private:
  /// Elements of one kind and their lists.
  struct Kind {
    std::unique_ptr<ElementGroup> group;
    ResultLayout layout;
    std::vector<Index> vertex;             // of element e: [e * n .. (e + 1) * n)
    std::int64_t first_element;            // number of its first element over all kinds
    std::int64_t first_task, first_force;  // of begin_forces(), in the buffer
    ForceList forces;
    std::vector<PairList> batches;
    [[nodiscard]] Connectivity connectivity() const { return {layout.vertices(), vertex}; }
    [[nodiscard]] Index count() const { return static_cast<Index>(vertex.size()) / layout.vertices(); }
    /// The marks of its own elements, of those of all.
    [[nodiscard]] std::span<const char> part_of(std::span<const char> failed) const {
      return failed.empty() ? failed : failed.subspan(at(first_element), at(count()));
    }
  };
  struct Evaluation;
  void add_kind(std::unique_ptr<ElementGroup> group, Index vertices);
  void build_pattern(Index vertices, base::ThreadPool* pool);
  void build_batches(Kind& kind, base::ThreadPool* pool) const;
  static void evaluate_tangents(const Kind& kind, Evaluation& evaluation, Index first, Index begin, Index end,
                                double* tangents);
  void add_tangent_of(const Kind& kind, base::ThreadPool* pool, Evaluation& evaluation, const BlockTarget& target);

  std::vector<Kind> kinds_;
  Index elements_ = 0;
  std::vector<char> failed_;                    // a mark for each element; empty: none has failed
  std::int64_t tasks_ = 0, force_numbers_ = 0;  // of begin_forces()
  VertexPattern pattern_;
  std::vector<double> buffer_[2];       // results of elements: forces; tangents of a batch and of the one before
  std::vector<double> energies_;        // of the elements
  std::unique_ptr<Evaluation> forces_;  // between begin_forces() and end_forces()
};

}  // namespace espalier::dynamics
