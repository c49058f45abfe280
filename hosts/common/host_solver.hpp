/// \file
/// A solver of the C interface as the host libraries use it: owned, with a line in the log for each factorization.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "espalier/espalier.h"

namespace espalier::hosts {

/// Results of the C interface with their sizes set.
template <class Info>
Info sized() {
  Info info{};
  info.size = sizeof info;
  return info;
}

/// +1 or -1, by a pattern that no matrix has (Knuth's multiplicative hash): for probing a factor.
inline double scattered_sign(std::size_t k) { return ((k * 2654435761U) & 0x8000U) != 0 ? -1.0 : 1.0; }

class HostSolver {
 public:
  /// What a solution of every interface keeps below.
  static constexpr double kPromised = 1e-10;

  /// @param interface  as it stands in log lines, for instance "ma97"
  explicit HostSolver(std::string interface);

  /// An option of espalier_set_option; what ESPALIER_OPTIONS says comes later and wins. @throws std::logic_error for
  /// one that there is not
  void set_default(const char* key, const std::string& value);
  /// Over the user's words: without it, the host would misread the answers.
  void insist(std::string key, std::string value) { insisted_.emplace_back(std::move(key), std::move(value)); }

  /// These return an espalier_status, like the calls of the C interface. Options count from the next analysis on.
  int analyze(const espalier_matrix_i32& a);
  int analyze(const espalier_matrix_i64& a);
  int analyze(const espalier_local_rows_i32& part);
  int factorize(const double* values, std::int64_t count);
  /// Solves and looks: where the normwise backward error is above kPromised, it is refined, however few steps the host
  /// asked for. ESPALIER_ACCURACY_NOT_REACHED: it stays above, and x holds the best that was found. A right-hand side
  /// with numbers that are not finite has such a solution, and ESPALIER_OK. @param x  may be b
  int solve(const double* b, double* x, std::int64_t columns, int transpose);
  /// The factor's substitution, which nobody looks at: to probe a factor, or where the host knows that it is singular.
  int substitute(const double* b, double* x, std::int64_t columns, int transpose);
  /// For the solves to come: steps of refinement before anybody looks.
  void set_refinement(int steps) { steps_ = steps; }
  /// Another solver on the same analysis. @returns an espalier_status
  int clone(std::unique_ptr<HostSolver>& to);

  /// The results of the last call of each sort.
  [[nodiscard]] const espalier_analysis_info& analysis() const { return analysis_; }
  [[nodiscard]] const espalier_factor_info& factor() const { return factor_; }
  [[nodiscard]] const espalier_solve_info& solution() const { return solution_; }
  /// Why the last call failed; "" after success.
  [[nodiscard]] std::string message() const { return espalier_last_error(solver_.get()); }
  /// The row that it concerns, from 0 on; -1 when none does.
  [[nodiscard]] std::int64_t row() const { return espalier_last_error_row(solver_.get()); }
  [[nodiscard]] espalier_solver* handle() { return solver_.get(); }

 private:
  struct Destroy {
    void operator()(espalier_solver* solver) const { espalier_destroy(solver); }
  };
  HostSolver(std::string interface, espalier_solver* solver) : interface_(std::move(interface)), solver_(solver) {}
  int prepare();
  void set_look(int steps, double required);
  template <class Matrix>
  int analyze_any(const Matrix& a, int (*call)(espalier_solver*, const Matrix*, espalier_analysis_info*));
  void say_factorized(int status) const;

  std::string interface_;
  std::unique_ptr<espalier_solver, Destroy> solver_;
  std::vector<std::pair<std::string, std::string>> insisted_;
  bool threads_chosen_ = false;                            // by the host
  std::int64_t rows_ = 0, vector_rows_ = 0, entries_ = 0;  // vector_rows_: those of this rank
  int steps_ = 0;
  std::pair<int, double> look_{-1, 0};  // steps and required backward error that this object has set; -1: none
  bool user_looks_ = false;             // he has said himself how solutions are refined, or what is required of them
  espalier_analysis_info analysis_ = sized<espalier_analysis_info>();
  espalier_factor_info factor_ = sized<espalier_factor_info>();
  espalier_solve_info solution_ = sized<espalier_solve_info>();
};

}  // namespace espalier::hosts
