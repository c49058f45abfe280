/// \file
/// Random systems whose pattern changes again and again, for analyze_change() of both solvers: for a short share in
/// test_solver and for the campaign (tests/verdict/change_campaign.cpp).
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "reference/reference.hpp"

namespace espalier::verdict {

/// A system of which entries come and go; regular at any time.
class ChangingSystem {
 public:
  /// How many sorts there are.
  static int sorts();
  /// @param sort  0 to sorts() - 1
  ChangingSystem(int sort, Index n, std::uint64_t seed);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] Kind kind() const { return kind_; }
  /// As it is now, in the storage of its sort.
  [[nodiscard]] SparseMatrix matrix() const;
  /// Some entries go that came earlier, some others come: near each other, anywhere, or between two bodies.
  void change();

 private:
  struct Contact {
    Index u, v;
    double value;
  };
  void add(Index u, Index v);

  std::string name_;
  Kind kind_ = Kind::automatic;
  bool symmetric_ = true, definite_ = true;
  SparseMatrix base_;
  std::vector<Contact> contacts_;
  std::mt19937_64 random_;
};

/// What one comparison came to; `wrong` is empty where all was as it should be.
struct ChangeVerdict {
  std::string wrong;
  bool full = false;
  double fill = 1;  ///< over that of the last full analysis
};

/// Lets `solver` follow the system as it is now, or its complex twin (twin_of()), and holds it against a fresh
/// analysis: status, inertia, rank, backward errors of a solution, the promise about the factor's entries.
/// @param hermitian  of the twin
template <class T>
ChangeVerdict follow(SolverOf<T>& solver, const ChangingSystem& system, Offset& fill_of_ordering, bool hermitian);
inline ChangeVerdict follow(Solver& solver, const ChangingSystem& system, Offset& fill_of_ordering) {
  return follow<double>(solver, system, fill_of_ordering, false);
}

}  // namespace espalier::verdict
