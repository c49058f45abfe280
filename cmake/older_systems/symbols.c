/* Two functions of ours were made anew in glibc 2.35 and in the libstdc++ of GCC 12; the older ones are there as well.
 * With them a wheel runs on systems with glibc 2.34 and GCC 11 (manylinux_2_34). What it holds is linked with --wrap.
 */
#include <features.h>

#ifdef __GLIBC__
#define OLD(name, version) __asm__(".symver espalier_old_" #name "," version)
#else /* no versions: the only one */
#define OLD(name, version) struct espalier_none_##name
#define espalier_old_hypot __real_hypot
#define espalier_old_wait __real__ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE
#endif

double espalier_old_hypot(double x, double y);
OLD(hypot, "hypot@GLIBC_2.2.5");
double __wrap_hypot(double x, double y);
double __wrap_hypot(double x, double y) { return espalier_old_hypot(x, y); }

/* std::condition_variable::wait(std::unique_lock<std::mutex>&) */
void espalier_old_wait(void* variable, void* lock);
OLD(wait, "_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE@GLIBCXX_3.4.11");
void __wrap__ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE(void* variable, void* lock);
void __wrap__ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE(void* variable, void* lock) {
  espalier_old_wait(variable, lock);
}
