/// \file
/// PARDISO as Panua and the PARDISO project have it (libpardiso.so): a 17th argument, and indices from 1 on always.
/// Ipopt and Clarabel load it. Words of iparm are numbered from 0.
#include <algorithm>

#include "pardiso/pardiso.hpp"

namespace espalier::hosts::pardiso {

namespace {

constexpr int kWords = 64, kReals = 64;

Settings settings_of(const int* iparm) {
  Settings s;
  s.into_b = iparm[5] != 0;
  s.refinement_steps = std::clamp(iparm[7], -1000, 1000);
  s.perturbation = iparm[9] > 0 ? std::min(iparm[9], 300) : 12;
  s.matching = iparm[12] != 0;
  s.transpose = iparm[11];
  return s;
}

void initialize(void** pt, const int* type, const int* solver, int* iparm, double* dparm, int* error) noexcept {
  if (pt != nullptr) std::fill_n(pt, kWords, nullptr);
  const int processors = iparm == nullptr ? 0 : iparm[2];
  if (iparm != nullptr) {
    std::fill_n(iparm, kWords, 0);
    iparm[0] = 1;
    iparm[1] = 2;
    iparm[2] = processors;
    iparm[7] = 2;
    iparm[9] = type != nullptr && *type == kIndefinite ? 8 : 13;
    if (type != nullptr && *type == kUnsymmetric) iparm[10] = iparm[12] = 1;
    iparm[17] = -1;
  }
  if (dparm != nullptr) std::fill_n(dparm, kReals, 0.0);
  if (error != nullptr) *error = solver != nullptr && *solver != 0 ? int{kBadInput} : int{kOk};
}

// The lengths and the range of indices; 0 or -1. The matrices of our types are checked again by the analysis.
int check_matrix(const int* n, const double* values, const int* pointers, const int* indices) {
  if (n == nullptr || *n < 1 || pointers == nullptr || values == nullptr || indices == nullptr) return kBadInput;
  if (pointers[0] != 1 || !std::is_sorted(pointers, pointers + *n + 1)) return kBadInput;
  const bool inside = std::all_of(indices, indices + pointers[*n] - 1, [&](int i) { return i >= 1 && i <= *n; });
  return inside ? kOk : kBadInput;
}

}  // namespace

// Ipopt clears 64 bytes of pt, pardisoinit all.
ESPALIER_HOST_CALL void pardiso(void** pt, const int* maxfct, const int* mnum, const int* type, const int* phase,
                                const int* n, const double* values, const int* pointers, const int* indices, int*,
                                const int* columns, int* iparm, const int*, double* b, double* x, int* error, double*) {
  const auto settings = [&](Settings& to) {
    to = settings_of(iparm);
    return iparm[31] != 0 ? kBadInput : kOk;  // the iterative solver
  };
  const auto tell = [&](Report r) {
    r.bad_row = -1;  // has no word
    hand_out(r, iparm);
  };
  const HostCall<int> host{pt, maxfct, mnum, type, phase, n, values, pointers, indices, columns, iparm, b, x};
  answer(error, [&] { return serve("panua", host, false, settings, tell); });
}
ESPALIER_HOST_CALL void pardisoinit(void** pt, const int* type, const int* solver, int* iparm, double* dparm,
                                    int* error) {
  initialize(pt, type, solver, iparm, dparm, error);
}
ESPALIER_HOST_CALL __attribute__((alias("pardiso"))) decltype(pardiso) pardiso_;
ESPALIER_HOST_CALL __attribute__((alias("pardisoinit"))) decltype(pardisoinit) pardisoinit_;
ESPALIER_HOST_CALL void pardiso_chkmatrix_(const int*, const int* n, const double* values, const int* pointers,
                                           const int* indices, int* error) {
  if (error != nullptr) *error = check_matrix(n, values, pointers, indices);
}
ESPALIER_HOST_CALL void pardiso_chkvec_(const int* n, const int* columns, const double* b, int* error) {
  if (error != nullptr)
    *error = n != nullptr && *n > 0 && columns != nullptr && *columns > 0 && b != nullptr ? kOk : kBadInput;
}
ESPALIER_HOST_CALL void pardiso_printstats_(const int*, const int* n, const double* values, const int* pointers,
                                            const int* indices, const int*, const double*, int* error) {
  if (error != nullptr) *error = check_matrix(n, values, pointers, indices);
}
// Ipopt asks whether they are there, and calls neither.
ESPALIER_HOST_CALL void pardiso_ipopt_newinterface(void) {}
ESPALIER_HOST_CALL void pardiso_exist_parallel(void) {}

}  // namespace espalier::hosts::pardiso
