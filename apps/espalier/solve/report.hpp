/// \file
/// What one run of the solver was and found, and its JSON form (docs/guide/command_line.md lists the fields).
#pragma once

#include <complex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/scratch_file.hpp"
#include "espalier/complex_solver.hpp"
#include "espalier/solver.hpp"

namespace espalier::cli {

/// Filled phase by phase; what a failed run did not reach stays empty.
struct RunRecord {
  std::string input;                 ///< file name or generator
  std::vector<std::string> notices;  ///< what was read otherwise than it stands in the file
  Index rows = 0;
  Offset nonzeros = 0;  ///< stored entries
  Storage storage = Storage::general;
  bool complex = false;
  Precision precision = Precision::fp64;
  Status status;
  double read_seconds = 0;
  std::optional<AnalysisResult> analysis;
  std::optional<FactorReport> factor;          ///< the last factorization
  double determinant_sign = 0;                 ///< of a real matrix
  std::complex<double> determinant_phase = 0;  ///< of a complex one
  double first_factor_seconds = 0;             ///< of the first factorization
  std::vector<double> refactor_seconds;        ///< of each refactorization
  std::optional<SolveResult> solve;
  Index columns = 1;  ///< right-hand sides
  std::optional<double> condition_estimate;

  [[nodiscard]] bool symmetric() const { return storage != Storage::general && !hermitian(); }
  [[nodiscard]] bool hermitian() const { return storage >= Storage::hermitian_lower; }
  void note(const FactorResult& result);
  void note(const ComplexFactorResult& result);
  /// The best time of the refactorizations; empty when there were none.
  [[nodiscard]] std::optional<double> best_refactor_seconds() const;
  /// Flops of the analysis over the best time of any factorization.
  [[nodiscard]] double best_rate() const;
};

/// The report: always an object with the same keys; null where the run did not get that far.
nlohmann::ordered_json to_json(const RunRecord& record);

/// The report of an analysis with its tree by tier.
nlohmann::ordered_json to_json(const std::vector<Solver::TierRow>& tiers);

/// What a factorization and a solve would move between memory and a disk of these rates.
nlohmann::ordered_json disk_forecast(const AnalysisResult& analysis, const base::DiskRates& disk);

/// The report as text, indented.
std::string to_text(const nlohmann::ordered_json& report);

/// Writes `report` to a file, if there is a name for it. Written before results are shown, so that a closed pipe does
/// not take it along; thrown after they are, so that a full disk does not take them along.
/// @return why it could not be written
[[nodiscard]] std::optional<Error> write_report(const std::string& path, const nlohmann::ordered_json& report);

}  // namespace espalier::cli
