/// \file
/// A body of brick elements whose pattern changes step by step: for tests and measurements of what follows changes.
#pragma once

#include <array>
#include <random>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

enum class BodyChange {
  contacts,  ///< springs between nodes of one face and nodes two layers away come and go as the contact slides
  elements,  ///< clusters of elements are taken out, earlier ones are put back
  crack,     ///< elements of a plane fail, row by row
  remesh,    ///< patches get another mesh on the same nodes: what was far within a patch is coupled
};
/// @throws std::invalid_argument for a word that names none
BodyChange parse_body_change(std::string_view word);

/// Boxes of n^3 bricks, three unknowns a node, (n + 1)^3 nodes in natural order (from 0, x slowest). Couplings are -1,
/// the diagonal is their number + 1: symmetric and positive definite by dominance. The same seed, the same body.
class ChangingBody {
 public:
  /// @param share  of the nodes that a step touches, about
  ChangingBody(BodyChange sort, Index n, double share, std::uint64_t seed);
  /// The next step.
  void change();
  /// Lower triangle, rows ascending.
  [[nodiscard]] SparseMatrix matrix() const;

 private:
  [[nodiscard]] Index node(Index x, Index y, Index z) const { return (x * (n_ + 1) + y) * (n_ + 1) + z; }
  [[nodiscard]] std::size_t element(Index x, Index y, Index z) const { return at((x * n_ + y) * n_ + z); }
  [[nodiscard]] Index below(Index end) { return static_cast<Index>(random_() % static_cast<std::uint64_t>(end)); }
  void slide();
  void swap_elements();
  void grow_crack();
  void remesh();

  BodyChange sort_;
  Index n_;
  Index nodes_a_step_;
  std::mt19937_64 random_;
  Index step_ = 0;
  std::vector<std::array<Index, 8>> elements_;
  std::vector<char> alive_;                    // elements
  std::vector<std::size_t> out_;               // elements, the earliest first
  std::set<std::pair<Index, Index>> springs_;  // pairs of nodes
};

}  // namespace espalier::matrix
