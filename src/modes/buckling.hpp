/// \file
/// The smallest positive eigenvalues of K x = l Kg x.
#pragma once

#include "base/stage.hpp"
#include "modes/harvest.hpp"
#include "modes/lanczos.hpp"
#include "modes/pencil.hpp"

namespace espalier::modes {

class BucklingSearch {
 public:
  BucklingSearch(SparseMatrix k, SparseMatrix kg, const ModesOptions& options, Resources& shop, ModesResult& result);
  /// @throws Error where nothing can be found; what was found when it gives up is in the result all the same
  void run();
  /// What was found goes into the result, with its residuals.
  void deliver();

 private:
  void factorize_stiffness();
  void explore();
  void purify(Tall& batch);
  void prove();
  [[nodiscard]] double gap_after_wanted() const;

  const ModesOptions& options_;
  Resources& shop_;
  ModesResult& result_;
  base::Stage stage_{"modes", 0, "load factors"};
  Pencil pencil_;
  Product stiffness_, geometric_;
  SpectralOperator op_;
  LanczosClock clock_;
  Harvest harvest_;
  Index multipliers_ = 0;  // rows of constraints
  Index wanted_ = 0;
  double next_ = 0;  // the next eigenvalue as the search saw it; 0: none
  bool exhausted_ = false, exact_ = true;
};

}  // namespace espalier::modes
