/// \file
/// What the interfaces of PARDISO have in common: phases, types of matrices, errors.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "common/border.hpp"
#include "common/handles.hpp"
#include "common/host_solver.hpp"

namespace espalier::hosts::pardiso {

/// Matrices that are solved. Complex ones (3, 4, -4, 6, 13) are refused.
enum Type : int { kStructurallySymmetric = 1, kPositiveDefinite = 2, kIndefinite = -2, kUnsymmetric = 11 };

enum Error : int {
  kOk = 0,
  kBadInput = -1,  ///< inconsistent, or not offered by us
  kNoMemory = -2,
  kNoOrder = -3,    ///< the structure has no factorization
  kZeroPivot = -4,  ///< or a solution that refinement does not bring below HostSolver::kPromised
  kInternal = -5,
};

/// What a call asks for, from whatever array the host keeps it in.
struct Settings {
  bool zero_based = false;
  bool into_b = false;       ///< the solution also overwrites the right-hand side
  bool single = false;       ///< values and vectors are floats
  bool check = false;        ///< refuse unsorted rows and entries below the diagonal of a symmetric matrix
  bool matching = false;     ///< the analysis may look at values
  int transpose = 0;         ///< 0: A, else A^T
  int refinement_steps = 0;  ///< at most; 0: two where pivots were perturbed
  int threads = 0;           ///< 0: ours or the user's choice
  int perturbation = 13;     ///< pivots below 10^-this are replaced
};

/// The arguments of a call, as the host gives them.
template <class Int>
struct Call {
  Int maxfct = 1, mnum = 1, type = 0, phase = 0, n = 0, columns = 0;
  const void* values = nullptr;
  const Int* pointers = nullptr;
  const Int* indices = nullptr;
  void* b = nullptr;
  void* x = nullptr;
  Settings settings;
};

/// What a call leaves for the host to read. Below 0: nothing new.
struct Report {
  std::int64_t refinement_steps = -1, perturbed = -1, positive = -1, negative = -1;
  std::int64_t analysis_kilobytes = -1, factor_kilobytes = -1;
  std::int64_t factor_entries = -1, megaflops = -1;
  std::int64_t bad_row = -1;  ///< from 1 on: where a pivot vanished
};

/// Words of iparm that mean the same in all interfaces of PARDISO, from 0 on.
enum ReportWord : int {
  kStepsDone = 6,
  kPerturbed = 13,
  kPeakKilobytes = 14,
  kAnalysisKilobytes = 15,
  kFactorKilobytes = 16,
  kEntries = 17,
  kMegaflops = 18,
  kPositive = 21,
  kNegative = 22,
  kBadRow = 29,
};

template <class Int>
void hand_out(const Report& r, Int* iparm) {
  const auto set = [&](ReportWord word, std::int64_t value) {
    if (value >= 0) iparm[word] = static_cast<Int>(std::min<std::int64_t>(value, std::numeric_limits<Int>::max()));
  };
  set(kStepsDone, r.refinement_steps);
  set(kPerturbed, r.perturbed);
  set(kPositive, r.positive);
  set(kNegative, r.negative);
  set(kPeakKilobytes, r.analysis_kilobytes);
  set(kAnalysisKilobytes, r.analysis_kilobytes);
  set(kFactorKilobytes, r.factor_kilobytes);
  set(kEntries, r.factor_entries);
  set(kMegaflops, r.megaflops);
  set(kBadRow, r.bad_row);
}

/// The factors behind one handle of the host: up to maxfct of one pattern.
class Problem {
 public:
  explicit Problem(const char* interface) : interface_(interface) {}
  /// @returns an Error
  template <class Int>
  int run(const Call<Int>& call, Report& report);

 private:
  template <class Int>
  int analyze(const Call<Int>& call, Report& report);
  template <class Int>
  int factorize(const Call<Int>& call, Report& report);
  template <class Int>
  int solve(const Call<Int>& call, Report& report);
  int analyze_again(const double* values);
  int give_solver(std::size_t slot);
  const double* as_doubles(const void* from, std::int64_t count, bool single, std::vector<double>& buffer) const;

  struct Slot {
    std::unique_ptr<HostSolver> solver;
    bool factorized = false;
  };
  const char* interface_;
  std::mutex mutex_;
  int type_ = 0;
  std::int64_t n_ = -1, entries_ = 0;
  bool values_pending_ = false;                   // the analysis wants values, and has seen none
  std::vector<std::int64_t> pointers_, indices_;  // 0-based, while values are pending
  std::vector<Slot> slots_;
  std::vector<double> values_, right_hand_sides_;  // where the host's are floats
};

/// All that live in this library.
Handles<Problem>& problems();

/// The arguments as they stand in the call, any of them null.
template <class Int>
struct HostCall {
  void** pt;
  const Int *maxfct, *mnum, *type, *phase, *n;
  const void* values;
  const Int *pointers, *indices, *columns;
  Int* iparm;
  void *b, *x;
};

/// Does what the host asks for. pt[0] is a handle of ours.
/// @param must_be_clear  whether the host must have cleared pt[0] before the first call
/// @param settings      of an iparm; an Error where it asks for what is not offered
/// @param tell          writes a Report to iparm
/// @returns an Error
template <class Int, class SettingsOf, class Tell>
int serve(const char* interface, const HostCall<Int>& host, bool must_be_clear, SettingsOf&& settings, Tell&& tell) {
  if (host.pt == nullptr || host.phase == nullptr) return kBadInput;
  if (*host.phase == -1 || *host.phase == 0) {
    problems().end(host.pt[0]);
    host.pt[0] = nullptr;
    return kOk;
  }
  if (host.maxfct == nullptr || host.mnum == nullptr || host.type == nullptr || host.n == nullptr ||
      host.iparm == nullptr)
    return kBadInput;
  Call<Int> call;
  if (const int error = settings(call.settings); error != kOk) return error;
  std::shared_ptr<Problem> problem = problems().find(host.pt[0]);
  if (problem == nullptr) {
    if (*host.phase / 10 != 1 || (must_be_clear && host.pt[0] != nullptr)) return kBadInput;
    problem = std::make_shared<Problem>(interface);
    host.pt[0] = problems().add(problem);
  }
  call.maxfct = *host.maxfct;
  call.mnum = *host.mnum;
  call.type = *host.type;
  call.phase = *host.phase;
  call.n = *host.n;
  call.columns = host.columns == nullptr ? 0 : *host.columns;
  call.values = host.values;
  call.pointers = host.pointers;
  call.indices = host.indices;
  call.b = host.b;
  call.x = host.x;
  Report report;
  const int error = problem->run(call, report);
  tell(report);
  return error;
}

/// serve() with nothing that leaves it but `error`, which may be null.
template <class Int, class Body>
void answer(Int* error, Body&& body) noexcept {
  Int unread = 0;
  Int& to = error == nullptr ? unread : *error;
  guarded([&] { to = body(); }, [&] { to = kNoMemory; }, [&] { to = kInternal; });
}

}  // namespace espalier::hosts::pardiso
