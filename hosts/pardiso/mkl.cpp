/// \file
/// PARDISO as Intel's MKL has it: C and Fortran spellings, with integers of 32 and 64 bits. pt[0] is a handle of ours.
/// Words of iparm are numbered from 0.
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <thread>

#include "pardiso/pardiso.hpp"

namespace espalier::hosts::pardiso {

namespace {

constexpr int kWords = 64;

// iparm, by what stands there, beside ReportWord.
enum Word : int {
  kUserValues = 0,
  kOrdering = 1,
  kUserPermutation = 4,
  kIntoB = 5,
  kSteps = 7,
  kPerturbation = 9,
  kScaling = 10,
  kTranspose = 11,
  kMatching = 12,
  kPivoting = 20,
  kCheck = 26,
  kSingle = 27,
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

// What remains of a problem's factors goes with the problem: phase 0 would free the factor alone.
template <class Int>
void call_pardiso(Int* error, const HostCall<Int>& host) noexcept {
  Int* iparm = host.iparm;
  const auto settings = [&](Settings& to) {
    if (iparm[kUserValues] == 0) defaults(static_cast<int>(*host.type), iparm);
    to = settings_of(iparm);
    return asks_for_more(iparm) ? kBadInput : kOk;
  };
  const auto tell = [&](Report r) {
    if (iparm[kEntries] >= 0) r.factor_entries = -1;  // not asked for
    if (iparm[kMegaflops] >= 0) r.megaflops = -1;
    hand_out(r, iparm);
  };
  answer(error, [&] { return serve("pardiso", host, true, settings, tell); });
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
  call_pardiso<Int32>(error, {pt, maxfct, mnum, type, phase, n, values, pointers, indices, columns, iparm, b, x});
}
ESPALIER_HOST_CALL void pardiso_64(void** pt, const Int64* maxfct, const Int64* mnum, const Int64* type,
                                   const Int64* phase, const Int64* n, const void* values, const Int64* pointers,
                                   const Int64* indices, Int64*, const Int64* columns, Int64* iparm, const Int64*,
                                   void* b, void* x, Int64* error) {
  call_pardiso<Int64>(error, {pt, maxfct, mnum, type, phase, n, values, pointers, indices, columns, iparm, b, x});
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
