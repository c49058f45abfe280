/// \file
/// The modes that were found so far, and what is said of them in the end.
#pragma once

#include <memory>
#include <vector>

#include "modes/lanczos.hpp"
#include "modes/pencil.hpp"
#include "modes/product.hpp"
#include "modes/resources.hpp"

namespace espalier::modes {

class Harvest {
 public:
  struct Found {
    double eigenvalue = 0, bound = 0;
    const double* vector = nullptr;  ///< n values, in a batch
  };

  /// Takes a batch of vectors with their eigenvalues and error bounds, one for each column; sorts.
  void add(Tall batch, const std::vector<double>& eigenvalues, const std::vector<double>& bounds);
  /// Takes out of the columns of `v` what lies in the direction of modes found, in the inner product of B.
  void project_out(base::ThreadPool& pool, const Apply& b, Tall& v, Tall& work) const;
  [[nodiscard]] Index below(double at) const;
  [[nodiscard]] Index size() const { return static_cast<Index>(sorted_.size()); }
  [[nodiscard]] const Found& operator[](Index i) const { return sorted_[static_cast<std::size_t>(i)]; }

  /// Moves the `count` first ones into the result: eigenvalues, vectors, bounds.
  void deliver(Index count, Index n, base::ThreadPool& pool, ModesResult& result);

 private:
  std::vector<std::unique_ptr<Tall>> batches_;
  std::vector<Found> sorted_;
};

/// What the search took.
void note_costs(const Pencil& pencil, const LanczosClock& clock, ModesResult& result);

/// Residuals of K x = l M x and orthogonality in the inner product of `inner` (M or K), of what stands in the result.
/// Where one of them is too large, nothing is proven.
/// @throws Error(accuracy_not_reached) then, after all are in the result
/// @param k_full, m_full  of these matrices
void examine(const SparseMatrix& k, const SparseMatrix& m, const Product& k_full, const Product& m_full,
             bool inner_is_k, Resources& shop, ModesResult& result);

}  // namespace espalier::modes
