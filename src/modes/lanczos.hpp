/// \file
/// Block Lanczos for an operator that is symmetric in a semi-definite inner product: full reorthogonalization, thick
/// restarts, eigenvectors that are known are kept out.
#pragma once

#include <string>
#include <vector>

#include "modes/blocks.hpp"

namespace espalier::modes {

/// OP = F^-1 A in the inner product of B: B OP is symmetric.
struct SpectralOperator {
  Index n = 0;
  /// y = A x and y = B x for so many columns; where A is B, `a` is empty.
  Apply a, b;
  Apply solve;        ///< y = F^-1 x; y may be x
  std::string inner;  ///< the name of B, for messages
  /// sum_i B_ii w_ij^2 of so many columns.
  std::function<Eigen::VectorXd(const double* w, Index columns)> weights;
};

/// Vectors that a search works in, n rows each, where `blocks` says.
struct Workspace {
  const Blocks& blocks;
  double* basis;  ///< at least known + 3 block columns
  Index columns;
  double* image;  ///< a block to work with
  Index block;    ///< its columns
};

/// How many eigenvalues theta are sought at each end of the spectrum, largest magnitude first.
struct Wanted {
  Index negative = 0, positive = 0;
};

struct LanczosOptions {
  Wanted wanted;
  Index block = 8;
  Index dimension = 0;  ///< rank of B, less those kept out: no basis is larger
  double tolerance = 1e-9;
  int restarts = 60;  ///< most of them
  std::uint64_t seed = 1;
  std::function<void(Index)> converged;  ///< told of how many there are, now and then; may be empty
};

/// What was found: theta with its residual ||OP v - theta v||_B; vectors are columns of the basis.
struct LanczosResult {
  std::vector<double> theta, residual;
  Wanted found;                                 ///< of these; unbroken from each end
  Dense combination;                            ///< vectors = basis times this
  double next_positive = 0, next_negative = 0;  ///< the first Ritz value of each side that is not among them; 0: none
  int restarts = 0;
  bool exhausted = false;  ///< the basis spans all there is: nothing else exists
};

struct LanczosClock {
  double solves = 0, orthogonalization = 0, products = 0;
  Offset columns = 0;
};

/// The operator works where the vectors are. The first `known` columns of the basis are B-orthonormal and kept out;
/// what is found is made of the columns after them.
class Lanczos {
 public:
  Lanczos(const SpectralOperator& op, const Workspace& space, Index known, base::ThreadPool& pool, LanczosClock& clock);
  /// @throws Error(invalid_input) where B is not semi-definite
  LanczosResult run(const LanczosOptions& options);

 private:
  struct Ritz;
  Index begin();
  Index expand(Index width);
  Index orthonormalize(Index columns, Index width, Dense* h, Dense* r);
  struct Dropping {
    double size;  ///< of the vectors of which a direction is to be a part that counts
    Index room;   ///< so many are left at most
    bool first;
    bool last;  ///< no other step follows
  };
  Index independent(double* w, double* image, Index width, const Dropping& dropping, Dense& total, Dense& r);
  Index new_directions(Index columns, Index width);
  [[nodiscard]] Ritz ritz(Index width) const;
  [[nodiscard]] bool enough(const Ritz& ritz) const;
  bool stalled(const Ritz& ritz);
  void restart(const Ritz& ritz, Index width);
  [[nodiscard]] LanczosResult result(const Ritz& ritz, bool exhausted) const;
  [[nodiscard]] double* v(Index j) { return space_.basis + static_cast<std::int64_t>(op_.n) * (known_ + j); }

  const SpectralOperator& op_;
  Workspace space_;  // its image: B times the block that comes next, or a block to work with
  Index known_;
  base::ThreadPool& pool_;
  LanczosClock& clock_;
  LanczosOptions options_;
  Index j_ = 0;         // columns of the basis whose images are known: OP V = V T + V_next C
  Index capacity_ = 0;  // most of them
  Dense t_;             // capacity + block
  Dense coupling_;      // C: rows of the next block, columns of the basis
  int restarts_ = 0;
  int still_ = 0;  // looks at which nothing has changed
  Index last_good_ = -1;
  std::uint64_t draws_ = 0;
};

}  // namespace espalier::modes
