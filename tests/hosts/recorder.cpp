/// \file
/// Stands between a host and the library that it wants, and writes down what is said: arguments and answers of MA97 and
/// of MKL's PARDISO, one call a line, for recordings_test.cpp. In the environment: ESPALIER_RECORD_LIBRARY, the library
/// that does the work, and ESPALIER_RECORD_FILE, to which lines are appended. tests/hosts/record.sh uses it.
///
/// A line is words and numbers. `[n a b ...]` is an array of n numbers.
///
///     analyse check n base [pointers] [rows] -> flag
///     factor type u small action [values] -> flag negative rank
///     solve columns stride [b] -> flag [x]
///     pardiso type phase n columns [iparm] [pointers] [indices] [values] [b] -> error [iparm] [x]
#include <dlfcn.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "hsl/ma97.hpp"

namespace {

using espalier::hosts::ma97::Control;
using espalier::hosts::ma97::Info;

template <class Function>
Function* real(const char* name) {
  static void* library = ::dlopen(std::getenv("ESPALIER_RECORD_LIBRARY"), RTLD_NOW | RTLD_GLOBAL);
  void* found = library == nullptr ? nullptr : ::dlsym(library, name);
  if (found == nullptr) {
    std::fprintf(stderr, "espalier recorder: ESPALIER_RECORD_LIBRARY: %s\n", ::dlerror());
    std::abort();
  }
  return reinterpret_cast<Function*>(found);
}

// One line of the recording.
class Line {
 public:
  explicit Line(const char* name) : file_(std::fopen(std::getenv("ESPALIER_RECORD_FILE"), "a"), &std::fclose) {
    std::fputs(name, file_.get());
  }
  ~Line() { std::fputc('\n', file_.get()); }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;
  Line& add(double number) {
    std::fprintf(file_.get(), " %.17g", number);
    return *this;
  }
  template <class T>
  Line& array(const T* numbers, long count) {
    if (numbers == nullptr) count = 0;
    std::fprintf(file_.get(), " [%ld", count);
    for (long k = 0; k < count; ++k) add(static_cast<double>(numbers[k]));
    std::fputs(" ]", file_.get());
    return *this;
  }
  Line& answers() {
    std::fputs(" ->", file_.get());
    return *this;
  }

 private:
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

long entries = 0, rows = 0;  // of the matrix that was analyzed last

}  // namespace

#define RECORDED extern "C" __attribute__((visibility("default")))

RECORDED void ma97_default_control_d(Control* control) { real<void(Control*)>("ma97_default_control_d")(control); }

RECORDED void ma97_analyse_d(int check, int n, const int* pointers, const int* indices, double* values, void** akeep,
                             const Control* control, Info* info, int* order) {
  real<decltype(ma97_analyse_d)>("ma97_analyse_d")(check, n, pointers, indices, values, akeep, control, info, order);
  const int base = control->f_arrays != 0 ? 1 : 0;
  rows = n;
  entries = pointers[n] - base;
  Line("analyse").add(check).add(n).add(base).array(pointers, n + 1).array(indices, entries).answers().add(info->flag);
}

RECORDED void ma97_factor_d(int type, const int* pointers, const int* indices, const double* values, void** akeep,
                            void** fkeep, const Control* control, Info* info, double* scaling) {
  real<decltype(ma97_factor_d)>("ma97_factor_d")(type, pointers, indices, values, akeep, fkeep, control, info, scaling);
  Line line("factor");
  line.add(type).add(control->u).add(control->small).add(control->action).array(values, entries).answers();
  line.add(info->flag).add(info->num_neg).add(info->matrix_rank);
}

RECORDED void ma97_solve_d(int job, int columns, double* x, int stride, void** akeep, void** fkeep,
                           const Control* control, Info* info) {
  Line line("solve");
  line.add(columns).add(stride).array(x, long{stride} * columns).answers();
  real<decltype(ma97_solve_d)>("ma97_solve_d")(job, columns, x, stride, akeep, fkeep, control, info);
  line.add(info->flag).array(x, long{stride} * columns);
}

RECORDED void ma97_finalise_d(void** akeep, void** fkeep) {
  real<decltype(ma97_finalise_d)>("ma97_finalise_d")(akeep, fkeep);
}

RECORDED void ma97_free_akeep_d(void** akeep) { real<decltype(ma97_free_akeep_d)>("ma97_free_akeep_d")(akeep); }

RECORDED void ma97_factor_solve_d() { std::abort(); }  // Ipopt looks for it, and does not call it

RECORDED void pardiso(void** pt, const int* maxfct, const int* mnum, const int* type, const int* phase, const int* n,
                      const double* values, const int* pointers, const int* indices, int* order, const int* columns,
                      int* iparm, const int* verbose, double* b, double* x, int* error) {
  Line line("pardiso");
  const bool matrix = *phase > 0 && *phase<33, solves = *phase> 0 && *phase % 10 == 3;
  const int base = iparm[0] != 0 && iparm[34] != 0 ? 0 : 1;
  const long count = matrix ? pointers[*n] - base : 0, length = solves ? long{*n} * *columns : 0;
  line.add(*type).add(*phase).add(*n).add(*columns).array(iparm, 64).array(pointers, matrix ? *n + 1 : 0);
  line.array(indices, count).array(values, count).array(b, length).answers();
  real<decltype(pardiso)>("pardiso")(pt, maxfct, mnum, type, phase, n, values, pointers, indices, order, columns, iparm,
                                     verbose, b, x, error);
  line.add(*error).array(iparm, 64).array(x, length);
}

RECORDED void pardisoinit(void** pt, const int* type, int* iparm) {
  real<decltype(pardisoinit)>("pardisoinit")(pt, type, iparm);
}
// Fortran's spelling, which Clarabel looks for.
RECORDED __attribute__((alias("pardiso"))) decltype(pardiso) pardiso_;
RECORDED __attribute__((alias("pardisoinit"))) decltype(pardisoinit) pardisoinit_;

// Clarabel asks for these.
RECORDED void mkl_set_num_threads(const int*) {}
RECORDED int mkl_set_num_threads_local(const int*) { return 1; }
RECORDED int mkl_domain_set_num_threads(const int*, const int*) { return 1; }
RECORDED int mkl_get_max_threads() { return 1; }
RECORDED int mkl_domain_get_max_threads(const int*) { return 1; }
RECORDED void mkl_set_dynamic(const int*) {}
