/// \file
/// PARDISO as Intel's MKL has it: C and Fortran spellings, with integers of 32 and 64 bits. pt[0] is a handle of ours.
/// Words of iparm are numbered from 0.
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <limits>
#include <thread>

#include "common/border.hpp"
#include "common/handles.hpp"
#include "pardiso/pardiso.hpp"

namespace espalier::hosts::pardiso {

namespace {

constexpr int kWords = 64;

// iparm, by what stands there.
enum Word : int {
  kUserValues = 0,
  kOrdering = 1,
  kUserPermutation = 4,
  kIntoB = 5,
  kStepsDone = 6,
  kSteps = 7,
  kPerturbation = 9,
  kScaling = 10,
  kTranspose = 11,
  kMatching = 12,
  kPerturbed = 13,
  kPeakKilobytes = 14,
  kAnalysisKilobytes = 15,
  kFactorKilobytes = 16,
  kEntries = 17,
  kMegaflops = 18,
  kPivoting = 20,
  kPositive = 21,
  kNegative = 22,
  kCheck = 26,
  kSingle = 27,
  kBadRow = 29,
  kZeroBased = 34,
  kSchur = 35,
  kBlocks = 36,
  kDiagonal = 55,
  kOutOfCore = 59,
};

// Threads of the solvers to come: what the host has said to MKL, or the user in MKL_NUM_THREADS; 0: neither.
std::atomic<int> threads_asked_for{0};

int ask_for(int count) { return threads_asked_for.exchange(std::max(count, 0)); }

int threads_wanted() {
  if (const int asked = threads_asked_for; asked > 0) return asked;
  const char* text = std::getenv("MKL_NUM_THREADS");
  return text == nullptr ? 0 : std::max(std::atoi(text), 0);
}

int threads() {
  const int wanted = threads_wanted();
  return wanted > 0 ? wanted : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

// Some hosts pass the number itself, which is no address.
int number_at(const int* address) {
  const auto value = reinterpret_cast<std::uintptr_t>(address);
  return value < 4096 ? static_cast<int>(value) : *address;
}

Handles<Problem>& problems() {
  static auto& live = *new Handles<Problem>;
  return live;
}

template <class Int>
void defaults(int type, Int* iparm) {
  std::fill_n(iparm, kWords, Int{0});
  iparm[kUserValues] = 1;
  iparm[kOrdering] = 3;
  iparm[kSteps] = 2;
  iparm[kEntries] = iparm[kMegaflops] = -1;
  if (type == kIndefinite || type == -4 || type == 6) {
    iparm[kPerturbation] = 8;
    iparm[kPivoting] = 1;
  } else if (type == kStructurallySymmetric || type == 3 || type == kUnsymmetric || type == 13) {
    iparm[kPerturbation] = 13;
  }
  if (type == kUnsymmetric || type == 13) iparm[kScaling] = iparm[kMatching] = 1;
}

// A Schur complement, blocks instead of entries, the elimination order or the factor's diagonal handed out: not ours.
template <class Int>
bool asks_for_more(const Int* iparm) {
  return iparm[kSchur] != 0 || iparm[kBlocks] != 0 || iparm[kUserPermutation] == 2 || iparm[kDiagonal] != 0;
}

template <class Int>
Settings settings_of(const Int* iparm) {
  Settings s;
  s.zero_based = iparm[kZeroBased] != 0;
  s.into_b = iparm[kIntoB] != 0;
  s.single = iparm[kSingle] != 0;
  s.check = iparm[kCheck] != 0;
  s.matching = iparm[kMatching] != 0;
  s.transpose = static_cast<int>(iparm[kTranspose]);
  s.refinement_steps = static_cast<int>(std::clamp<Int>(iparm[kSteps], -1000, 1000));
  s.perturbation = static_cast<int>(std::clamp<Int>(iparm[kPerturbation], 0, 300));
  s.threads = threads_wanted();
  return s;
}

template <class Int>
void hand_out(const Report& r, Int* iparm) {
  const auto set = [&](Word word, std::int64_t value) {
    if (value >= 0) iparm[word] = static_cast<Int>(std::min<std::int64_t>(value, std::numeric_limits<Int>::max()));
  };
  set(kStepsDone, r.refinement_steps);
  set(kPerturbed, r.perturbed);
  set(kPositive, r.positive);
  set(kNegative, r.negative);
  set(kPeakKilobytes, r.analysis_kilobytes);
  set(kAnalysisKilobytes, r.analysis_kilobytes);
  set(kFactorKilobytes, r.factor_kilobytes);
  set(kBadRow, r.bad_row);
  if (iparm[kEntries] < 0) set(kEntries, r.factor_entries);
  if (iparm[kMegaflops] < 0) set(kMegaflops, r.megaflops);
}

// What remains of a problem's factors goes with the problem: phase 0 would free the factor alone.
template <class Int>
int run(void** pt, const Int* maxfct, const Int* mnum, const Int* type, const Int* phase, const Int* n,
        const void* values, const Int* pointers, const Int* indices, const Int* columns, Int* iparm, void* b, void* x) {
  if (pt == nullptr || phase == nullptr) return kBadInput;
  if (*phase == -1 || *phase == 0) {
    problems().end(pt[0]);
    pt[0] = nullptr;
    return kOk;
  }
  if (maxfct == nullptr || mnum == nullptr || type == nullptr || n == nullptr || iparm == nullptr) return kBadInput;
  if (iparm[kUserValues] == 0) defaults(static_cast<int>(*type), iparm);
  if (asks_for_more(iparm)) return kBadInput;
  std::shared_ptr<Problem> problem = problems().find(pt[0]);
  if (problem == nullptr) {
    if (pt[0] != nullptr || *phase / 10 != 1) return kBadInput;  // not cleared by the host, or out of order
    problem = std::make_shared<Problem>("pardiso");
    pt[0] = problems().add(problem);
  }
  Call<Int> call;
  call.maxfct = *maxfct;
  call.mnum = *mnum;
  call.type = *type;
  call.phase = *phase;
  call.n = *n;
  call.columns = columns == nullptr ? 0 : *columns;
  call.values = values;
  call.pointers = pointers;
  call.indices = indices;
  call.b = b;
  call.x = x;
  call.settings = settings_of(iparm);
  Report report;
  const int error = problem->run(call, report);
  hand_out(report, iparm);
  return error;
}

template <class Int, class... Arguments>
void answer(Int* error, Arguments... arguments) noexcept {
  Int unread = 0;
  Int& to = error == nullptr ? unread : *error;
  guarded([&] { to = run<Int>(arguments...); }, [&] { to = kNoMemory; }, [&] { to = kInternal; });
}

template <class Int>
void initialize(void** pt, const Int* type, Int* iparm) noexcept {
  if (pt != nullptr) std::fill_n(pt, kWords, nullptr);
  if (type != nullptr && iparm != nullptr) defaults(static_cast<int>(*type), iparm);
}

}  // namespace

using Int32 = std::int32_t;
using Int64 = std::int64_t;

ESPALIER_HOST_CALL void pardiso(void** pt, const Int32* maxfct, const Int32* mnum, const Int32* type,
                                const Int32* phase, const Int32* n, const void* values, const Int32* pointers,
                                const Int32* indices, Int32*, const Int32* columns, Int32* iparm, const Int32*, void* b,
                                void* x, Int32* error) {
  answer(error, pt, maxfct, mnum, type, phase, n, values, pointers, indices, columns, iparm, b, x);
}
ESPALIER_HOST_CALL void pardiso_64(void** pt, const Int64* maxfct, const Int64* mnum, const Int64* type,
                                   const Int64* phase, const Int64* n, const void* values, const Int64* pointers,
                                   const Int64* indices, Int64*, const Int64* columns, Int64* iparm, const Int64*,
                                   void* b, void* x, Int64* error) {
  answer(error, pt, maxfct, mnum, type, phase, n, values, pointers, indices, columns, iparm, b, x);
}
ESPALIER_HOST_CALL void pardisoinit(void** pt, const Int32* type, Int32* iparm) { initialize(pt, type, iparm); }

// Other spellings.
ESPALIER_HOST_CALL __attribute__((alias("pardiso"))) decltype(pardiso) pardiso_;
ESPALIER_HOST_CALL __attribute__((alias("pardiso"))) decltype(pardiso) PARDISO;
ESPALIER_HOST_CALL __attribute__((alias("pardiso"))) decltype(pardiso) PARDISO_;
ESPALIER_HOST_CALL __attribute__((alias("pardiso_64"))) decltype(pardiso_64) pardiso_64_;
ESPALIER_HOST_CALL __attribute__((alias("pardiso_64"))) decltype(pardiso_64) PARDISO_64;
ESPALIER_HOST_CALL __attribute__((alias("pardisoinit"))) decltype(pardisoinit) pardisoinit_;
ESPALIER_HOST_CALL __attribute__((alias("pardisoinit"))) decltype(pardisoinit) PARDISOINIT;

// MKL's functions that hosts of PARDISO call besides. Those in small letters are Fortran's: they take addresses.
ESPALIER_HOST_CALL void mkl_set_num_threads(const int* count) { ask_for(number_at(count)); }
ESPALIER_HOST_CALL void mkl_set_num_threads_(const int* count) { ask_for(number_at(count)); }
ESPALIER_HOST_CALL void MKL_Set_Num_Threads(int count) { ask_for(count); }
ESPALIER_HOST_CALL int mkl_set_num_threads_local(const int* count) { return ask_for(number_at(count)); }
ESPALIER_HOST_CALL int MKL_Set_Num_Threads_Local(int count) { return ask_for(count); }
ESPALIER_HOST_CALL int mkl_get_max_threads(void) { return threads(); }
ESPALIER_HOST_CALL int mkl_get_max_threads_(void) { return threads(); }
ESPALIER_HOST_CALL int MKL_Get_Max_Threads(void) { return threads(); }
ESPALIER_HOST_CALL int mkl_domain_set_num_threads(const int* count, const int*) {
  ask_for(number_at(count));
  return 1;
}
ESPALIER_HOST_CALL int MKL_Domain_Set_Num_Threads(int count, int) {
  ask_for(count);
  return 1;
}
ESPALIER_HOST_CALL int mkl_domain_get_max_threads(const int*) { return threads(); }
ESPALIER_HOST_CALL int MKL_Domain_Get_Max_Threads(int) { return threads(); }
ESPALIER_HOST_CALL void mkl_set_dynamic(const int*) {}
ESPALIER_HOST_CALL void MKL_Set_Dynamic(int) {}
ESPALIER_HOST_CALL void mkl_free_buffers(void) {}
ESPALIER_HOST_CALL void MKL_Free_Buffers(void) {}

}  // namespace espalier::hosts::pardiso
