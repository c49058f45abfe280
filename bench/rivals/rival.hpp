/// \file
/// The one interface behind which every solver of the benchmark stands: rivals and Espalier alike.
///
/// A rival is a plug-in (a shared module named rival_<name>.so) that runs in a process of its own, so a rival that is
/// missing, crashes, hangs or eats all memory costs one row of the table and nothing else. Only the plug-ins link or
/// load foreign solvers; nothing here does.
#pragma once

#include <chrono>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "espalier/solver.hpp"
#include "rivals/system_view.hpp"

namespace espalier::bench {

/// How a rival fared; everything but `ok` is a row that says so.
enum class Outcome {
  ok,
  missing,        ///< the library (or the device it needs) is not on this machine
  not_offered,    ///< the rival has no such factorization
  failed,         ///< the rival reported an error
  out_of_memory,  ///< the rival reported it, an allocation failed, or the kernel killed the process
  wrong_answer,   ///< the independent residual is above the bound
  crashed,        ///< the process ended by a signal or in mid-command
  timed_out,      ///< no answer within the time limit; the process was ended
};

/// An outcome and, unless it is ok, one line that says what happened.
struct Verdict {
  Outcome outcome = Outcome::ok;
  std::string message;
  [[nodiscard]] bool ok() const { return outcome == Outcome::ok; }
};

/// Thrown inside a plug-in; the process that hosts the plug-in turns it into the verdict of the report.
class Failure : public std::runtime_error {
 public:
  Failure(Outcome outcome, const std::string& message) : std::runtime_error(message), outcome_(outcome) {}
  [[nodiscard]] Outcome outcome() const { return outcome_; }

 private:
  Outcome outcome_;
};

/// What analyze() found; -1 where the rival does not tell.
struct AnalyzeReport {
  Verdict verdict;
  double seconds = 0;           ///< the library's analysis alone, without conversions of format
  Offset nonzeros_factor = -1;  ///< entries of the factor as the rival counts them
  double flops = -1;            ///< operations of the numeric factorization as the rival counts them
  Offset predicted_bytes = -1;  ///< memory that the rival says the factorization will take
};

/// What factorize() or refactorize() did; -1 where the rival does not tell.
struct FactorReport {
  Verdict verdict;
  double seconds = 0;           ///< the library's numeric factorization alone
  Offset nonzeros_factor = -1;  ///< known only after the numbers with some rivals
  double flops = -1;
  Inertia inertia;
  Index perturbed = -1;               ///< pivots replaced because they were too small
  Offset device_bytes = -1;           ///< memory held on the GPUs
  std::vector<DeviceReport> devices;  ///< one per device that took part
};

/// What solve() did.
struct SolveReport {
  Verdict verdict;
  double seconds = 0;         ///< the library's solve alone
  int refinement_steps = -1;  ///< steps of iterative refinement inside the solve; -1 where not told
};

/// A direct solver. The clock of every report covers the library's call only: conversions between storage formats and
/// transfers to a device stand outside of it. Methods throw Failure. One object serves one matrix pattern at a time.
class Rival {
 public:
  Rival() = default;
  Rival(const Rival&) = delete;
  Rival& operator=(const Rival&) = delete;
  virtual ~Rival() = default;

  [[nodiscard]] virtual std::string name() const = 0;
  /// Library, its version, its BLAS and every setting that differs from the library's defaults.
  [[nodiscard]] virtual std::string version() const = 0;

  /// Whether there are factorizations of complex matrices; without, those are not offered and no call is made.
  [[nodiscard]] virtual bool has_complex() const { return false; }

  /// Pattern of `a` (values present: matching and scaling may use them). `kind` is llt, ldlt or lu. May be called
  /// again: everything earlier is dropped.
  virtual AnalyzeReport analyze(const SystemView& a, Kind kind, int threads) = 0;
  /// First numbers for the analyzed pattern. @pre analyze() ended ok
  virtual FactorReport factorize(const SystemView& a) = 0;
  /// New numbers in the order of the analyzed matrix. @pre factorize() ended ok
  virtual FactorReport refactorize(std::span<const double> values) = 0;
  /// A x = b for `columns` right-hand sides, n values each (complex ones: 2 n doubles), column by column. @pre
  /// factorize() ended ok
  virtual SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) = 0;

  /// Bytes that only the benchmark needs (maps between storage formats); they are taken off the peak memory.
  [[nodiscard]] virtual Offset overhead_bytes() const { return 0; }
};

/// Seconds of wall-clock time that `call` took.
template <typename Call>
double timed(Call&& call) {
  const auto start = std::chrono::steady_clock::now();
  std::forward<Call>(call)();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// The one symbol of a plug-in: makes the rival, or throws Failure (Outcome::missing where its library is absent).
/// `variant` is what followed the first colon of the rival's name on the command line, such as "hybrid=4096".
using MakeRival = Rival* (*)(const char* variant);
inline constexpr const char* kMakeRivalSymbol = "espalier_make_rival";

}  // namespace espalier::bench

/// Defines a plug-in's symbol; `Type` is constructed from a std::string with the variant.
#define ESPALIER_RIVAL_PLUGIN(Type)                                                                                    \
  extern "C" __attribute__((visibility("default"))) espalier::bench::Rival* espalier_make_rival(const char* variant) { \
    return new Type(std::string(variant));                                                                             \
  }
