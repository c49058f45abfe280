// Rates of the host dense kernels on one thread, beside the same operation of a BLAS/LAPACK loaded at run time:
//   espalier_bench_dense [--blas libmkl_rt.so.3] [--seconds 0.02] [--only word]
// Contestants alternate within each row; best and median of the rounds and the ratios of both are printed (a shared
// machine slows rounds down: where best and median differ much, it was busy). Operands stay in cache unless the row
// says "stream". Each product is checked once against the other.
#include <dlfcn.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "base/memory.hpp"
#include "device/host/kernels/kernels.hpp"
#include "gemm.hpp"

namespace {

using espalier::base::Buffer;
using espalier::device::host::Kernels;
using espalier::device::host::kernels;
using espalier::device::host::padded;
using Array = Buffer<double>;
using Clock = std::chrono::steady_clock;

/// Fortran entry points of a BLAS and LAPACK with 32-bit integers; null where missing.
struct Blas {
  using Gemm = void (*)(const char*, const char*, const int*, const int*, const int*, const double*, const double*,
                        const int*, const double*, const int*, const double*, double*, const int*);
  using Potrf = void (*)(const char*, const int*, double*, const int*, int*);
  using Sytrf = void (*)(const char*, const int*, double*, const int*, int*, double*, const int*, int*);
  using Getrf = void (*)(const int*, const int*, double*, const int*, int*, int*);
  using Trtri = void (*)(const char*, const char*, const int*, double*, const int*, int*);
  using Gemv = void (*)(const char*, const int*, const int*, const double*, const double*, const int*, const double*,
                        const int*, const double*, double*, const int*);
  Gemm gemm = nullptr;
  Potrf potrf = nullptr;
  Sytrf sytrf = nullptr;
  Getrf getrf = nullptr;
  Trtri trtri = nullptr;
  Gemv gemv = nullptr;
  std::string name = "none";
};

template <class F>
void look_up(void* library, const char* symbol, F& function) {
  function = reinterpret_cast<F>(dlsym(library, symbol));
}

Blas load_blas(const std::string& path) {
  setenv("MKL_THREADING_LAYER", "SEQUENTIAL", 0);
  setenv("OPENBLAS_NUM_THREADS", "1", 0);
  Blas blas;
  void* library = path.empty() ? nullptr : dlopen(path.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr) return blas;
  blas.name = path.substr(path.find_last_of('/') + 1);
  look_up(library, "dgemm_", blas.gemm);
  look_up(library, "dpotrf_", blas.potrf);
  look_up(library, "dsytrf_rook_", blas.sytrf);
  look_up(library, "dgetrf_", blas.getrf);
  look_up(library, "dtrtri_", blas.trtri);
  look_up(library, "dgemv_", blas.gemv);
  return blas;
}

Array random_array(std::int64_t size, unsigned seed, double low = -1) {
  Array x(size, nullptr);
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(low, 1);
  for (double& v : x) v = uniform(generator);
  return x;
}

/// Wall clock. The processor time of the thread would leave out other processes, but it counts too little in about 3 %
/// of short batches (measured against the time-stamp counter of a virtual machine), and a best-of picks just those.
double seconds_of(const std::function<void()>& body, std::int64_t calls) {
  const auto start = Clock::now();
  for (std::int64_t i = 0; i < calls; ++i) body();
  return std::chrono::duration<double>(Clock::now() - start).count() / static_cast<double>(calls);
}

struct Times {
  double best;
  double median;
};

/// Times of each body in alternating rounds of about `seconds` altogether, at least five.
std::vector<Times> measure(const std::vector<std::function<void()>>& bodies, double seconds) {
  std::vector<std::vector<double>> rounds(bodies.size());
  std::vector<std::int64_t> calls(bodies.size(), 1);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    bodies[i]();
    const double once = std::max(1e-8, seconds_of(bodies[i], 1));
    calls[i] = std::clamp<std::int64_t>(static_cast<std::int64_t>(1e-4 / once), 1, 10000);
  }
  const auto start = Clock::now();
  do {
    for (std::size_t i = 0; i < bodies.size(); ++i) rounds[i].push_back(seconds_of(bodies[i], calls[i]));
  } while (rounds[0].size() < 5 || std::chrono::duration<double>(Clock::now() - start).count() < seconds);
  std::vector<Times> times;
  for (std::vector<double>& r : rounds) {
    std::sort(r.begin(), r.end());
    times.push_back({r.front(), r[r.size() / 2]});
  }
  return times;
}

struct Bench {
  Blas blas;
  double seconds = 0.02;
  std::string only;

  [[nodiscard]] bool wanted(const std::string& group) const {
    return only.empty() || group.find(only) != std::string::npos;
  }
  /// One row: our rate and, where `theirs` is given, that of the BLAS and the ratio.
  void row(const std::string& name, double work, const char* unit, const std::function<void()>& ours,
           const std::function<void()>& theirs) const {
    std::vector<std::function<void()>> bodies{ours};
    if (theirs) bodies.push_back(theirs);
    const std::vector<Times> t = measure(bodies, seconds);
    std::printf("%-34s %9.3f us  best %7.2f median %7.2f %s", name.c_str(), t[0].best * 1e6, work / t[0].best * 1e-9,
                work / t[0].median * 1e-9, unit);
    if (theirs)
      std::printf("   rival %7.2f %7.2f   ratio %5.2f %5.2f", work / t[1].best * 1e-9, work / t[1].median * 1e-9,
                  t[1].best / t[0].best, t[1].median / t[0].median);
    std::printf("\n");
    std::fflush(stdout);
  }
};

std::string label(const char* name, std::int64_t m, std::int64_t n, std::int64_t k) {
  return std::string(name) + " " + std::to_string(m) + " " + std::to_string(n) + " " + std::to_string(k);
}

void bench_products(const Bench& bench) {
  const Kernels<double>& t = kernels<double>();
  const std::int64_t shapes[][3] = {{16, 16, 8},    {24, 24, 24},    {32, 32, 32},    {48, 48, 48},    {64, 64, 64},
                                    {60, 60, 20},   {96, 96, 96},    {128, 128, 8},   {128, 128, 16},  {128, 128, 32},
                                    {128, 128, 64}, {128, 128, 128}, {192, 192, 192}, {256, 256, 256}, {256, 64, 64}};
  const double one = 1, minus = -1;
  for (const auto& [m, n, k] : shapes) {
    const std::int64_t ld = padded<double>(m);
    Array a = random_array(ld * k, 1), b = random_array(padded<double>(n) * k, 2), x(ld * k, nullptr);
    Array c = random_array(ld * padded<double>(n), 3), w = random_array(padded<double>(n) * n, 4);
    const int mi = static_cast<int>(m), ni = static_cast<int>(n), ki = static_cast<int>(k), ldi = static_cast<int>(ld);
    const double work = 2.0 * static_cast<double>(m * n * k);
    const auto theirs = [&] {
      bench.blas.gemm("N", "T", &mi, &ni, &ki, &minus, a.data(), &ldi, b.data(), &ni, &one, c.data(), &ldi);
    };
    bench.row(
        label("gemm_nt", m, n, k), work, "GF/s", [&] { t.gemm_nt(m, n, k, a.data(), b.data(), c.data(), ld); },
        bench.blas.gemm != nullptr ? std::function<void()>(theirs) : nullptr);
    bench.row(
        label("syrk_nt", m, n, k), static_cast<double>(k * n * (2 * m - n + 1)), "GF/s",
        [&] { t.syrk_nt(m, n, k, a.data(), b.data(), c.data(), ld); }, nullptr);
    if (k == n)
      bench.row(
          label("trmm_nt", m, n, n), static_cast<double>(m * n * (n + 1)), "GF/s",
          [&] { t.trmm_nt(m, n, a.data(), w.data(), x.data()); }, nullptr);
  }
  // Operands that come from memory: 64 MiB of tiles, each used once against one C.
  for (const std::int64_t n : {64, 128}) {
    const std::int64_t tiles = (std::int64_t{64} << 20) / (n * n * 8);
    Array all = random_array(tiles * n * n, 5), c = random_array(n * n, 6);
    bench.row(
        label("gemm_nt stream", n, n, n), 2.0 * static_cast<double>(n * n * n * (tiles / 2)), "GF/s",
        [&] {
          for (std::int64_t i = 0; i + 1 < tiles; i += 2)
            t.gemm_nt(n, n, n, all.data() + i * n * n, all.data() + (i + 1) * n * n, c.data(), n);
        },
        nullptr);
  }
}

void bench_layout(const Bench& bench) {
  const Kernels<double>& t = kernels<double>();
  for (const std::int64_t n : {32, 64, 128}) {
    Array c = random_array(n * n, 1), p = random_array(n * n, 2), d = random_array(n, 3), e(n, nullptr);
    std::fill(e.begin(), e.end(), 0.0);
    const double bytes = 16.0 * static_cast<double>(n * n);
    bench.row(
        label("pack", n, n, 0), bytes, "GB/s", [&] { t.pack(n, n, c.data(), n, p.data()); }, nullptr);
    bench.row(
        label("unpack", n, n, 0), bytes, "GB/s", [&] { t.unpack(n, n, p.data(), c.data(), n); }, nullptr);
    bench.row(
        label("pack_transposed", n, n, 0), bytes, "GB/s", [&] { t.pack_transposed(n, n, c.data(), n, p.data()); },
        nullptr);
    Array x(n * n, nullptr);
    bench.row(
        label("scale_columns", n, n, 0), bytes, "GB/s",
        [&] { t.scale_columns(n, n, p.data(), d.data(), e.data(), x.data()); }, nullptr);
    bench.row(
        label("column_max", n, n, 0), bytes / 2, "GB/s", [&] { t.column_max(n, n, p.data(), d.data()); }, nullptr);
  }
}

/// A symmetric matrix; definite when `shift` is n.
Array symmetric(std::int64_t n, double shift) {
  const std::int64_t ld = padded<double>(n);
  Array c = random_array(ld * ld, 7);
  for (std::int64_t j = 0; j < n; ++j) {
    for (std::int64_t i = 0; i < j; ++i) c[j * ld + i] = c[i * ld + j];
    c[j * ld + j] += shift;
  }
  return c;
}

void copy(const Array& from, Array& to) { std::copy(from.data(), from.data() + from.size(), to.data()); }

/// Factorizations overwrite their input, so each call copies it first (on both sides).
void bench_factorizations(const Bench& bench) {
  const Kernels<double>& t = kernels<double>();
  for (const std::int64_t n : {8, 16, 24, 32, 48, 64, 96, 128, 256, 512}) {
    const std::int64_t ld = padded<double>(n);
    const Array spd = symmetric(n, static_cast<double>(n)), kkt = symmetric(n, 0), full = random_array(ld * ld, 8);
    Array x(ld * ld, nullptr), w(ld * n, nullptr), d(n, nullptr), e(n, nullptr), work(64 * n, nullptr);
    Buffer<std::int32_t> perm(n, nullptr);
    Buffer<char> replaced(n, nullptr);
    const int ni = static_cast<int>(n), ldi = static_cast<int>(ld), size = static_cast<int>(work.size());
    int info = 0;
    const double cube = static_cast<double>(n * n * n);
    const bool rival = bench.blas.potrf != nullptr && bench.blas.getrf != nullptr && bench.blas.sytrf != nullptr;
    const auto against = [&](std::function<void()> f) { return rival ? f : nullptr; };
    bench.row(
        label("copy", n, n, 0), 8.0 * static_cast<double>(ld * ld), "GB/s", [&] { copy(spd, x); }, nullptr);
    bench.row(
        label("potrf", n, n, n), cube / 3, "GF/s", [&] { copy(spd, x), t.potrf(n, x.data(), ld); },
        against([&] { copy(spd, x), bench.blas.potrf("L", &ni, x.data(), &ldi, &info); }));
    bench.row(
        label("ldlt random", n, n, n), cube / 3, "GF/s",
        [&] { copy(kkt, x), t.ldlt(n, x.data(), ld, {}, perm.data(), d.data(), e.data(), replaced.data()); },
        against(
            [&] { copy(kkt, x), bench.blas.sytrf("L", &ni, x.data(), &ldi, perm.data(), work.data(), &size, &info); }));
    bench.row(
        label("ldlt definite", n, n, n), cube / 3, "GF/s",
        [&] { copy(spd, x), t.ldlt(n, x.data(), ld, {}, perm.data(), d.data(), e.data(), replaced.data()); },
        against(
            [&] { copy(spd, x), bench.blas.sytrf("L", &ni, x.data(), &ldi, perm.data(), work.data(), &size, &info); }));
    bench.row(
        label("getrf", n, n, n), 2 * cube / 3, "GF/s",
        [&] { copy(full, x), t.getrf(n, x.data(), ld, {}, perm.data(), replaced.data()); },
        against([&] { copy(full, x), bench.blas.getrf(&ni, &ni, x.data(), &ldi, perm.data(), &info); }));
    bench.row(
        label("invert_lower", n, n, n), cube / 3, "GF/s", [&] { t.invert_lower(n, spd.data(), ld, false, w.data()); },
        against([&] { copy(spd, x), bench.blas.trtri("L", "N", &ni, x.data(), &ldi, &info); }));
    bench.row(
        label("invert_upper_transposed", n, n, n), cube / 3, "GF/s",
        [&] { t.invert_upper_transposed(n, spd.data(), ld, w.data()); }, nullptr);
  }
}

double front_work(std::int64_t m, std::int64_t k) {
  double work = 0;
  for (std::int64_t j = 0; j < k; ++j) work += static_cast<double>((m - j) * (m - j));
  return work;
}

void bench_fronts(const Bench& bench) {
  const Kernels<double>& t = kernels<double>();
  const std::int64_t shapes[][2] = {{6, 3},   {12, 6},  {18, 6},  {24, 12}, {30, 10},  {30, 30},
                                    {48, 16}, {60, 20}, {64, 32}, {96, 32}, {128, 32}, {128, 64}};
  for (const auto& [m, k] : shapes) {
    const std::int64_t ld = padded<double>(m);
    const Array spd = symmetric(m, static_cast<double>(m)), kkt = symmetric(m, 0), full = random_array(ld * ld, 8);
    Array x(ld * ld, nullptr), d(k, nullptr), e(k, nullptr);
    Buffer<std::int32_t> perm(k, nullptr);
    Buffer<char> replaced(k, nullptr);
    bench.row(
        label("front copy", m, k, 0), 8.0 * static_cast<double>(ld * ld), "GB/s", [&] { copy(spd, x); }, nullptr);
    bench.row(
        label("front potrf", m, k, 0), front_work(m, k), "GF/s",
        [&] { copy(spd, x), t.partial_potrf(m, k, x.data(), ld); }, nullptr);
    bench.row(
        label("front ldlt random", m, k, 0), front_work(m, k), "GF/s",
        [&] { copy(kkt, x), t.partial_ldlt(m, k, x.data(), ld, {}, perm.data(), d.data(), e.data(), replaced.data()); },
        nullptr);
    bench.row(
        label("front ldlt definite", m, k, 0), front_work(m, k), "GF/s",
        [&] { copy(spd, x), t.partial_ldlt(m, k, x.data(), ld, {}, perm.data(), d.data(), e.data(), replaced.data()); },
        nullptr);
    bench.row(
        label("front getrf", m, k, 0), 2 * front_work(m, k), "GF/s",
        [&] { copy(full, x), t.partial_getrf(m, k, x.data(), ld, {}, perm.data(), replaced.data()); }, nullptr);
  }
}

/// A set of tiles that does not fit in cache ("stream") and one tile that does.
void bench_substitution(const Bench& bench) {
  const Kernels<double>& t = kernels<double>();
  for (const std::int64_t n : {32, 64, 128}) {
    for (const std::int64_t tiles : {std::int64_t{1}, (std::int64_t{128} << 20) / (n * n * 8)}) {
      Array a = random_array(tiles * n * n, 1);
      for (const std::int64_t nr : {1, 8, 16, 32}) {
        if (tiles > 1 && nr > 8) continue;
        Array x = random_array(n * nr, 2), y = random_array(n * nr, 3);
        const double count = static_cast<double>(tiles * n * n);
        const double work = nr == 1 ? 8 * count : 2 * count * static_cast<double>(nr);
        const char* unit = nr == 1 ? "GB/s" : "GF/s";
        const std::string kind = tiles > 1 ? " stream" : "";
        const auto over_tiles = [&](auto kernel) {
          return [&, kernel] {
            for (std::int64_t i = 0; i < tiles; ++i) kernel(a.data() + i * n * n);
          };
        };
        bench.row(label(("apply" + kind).c_str(), n, n, nr), work, unit,
                  over_tiles([&](const double* p) { t.apply(n, n, nr, p, x.data(), y.data()); }), nullptr);
        bench.row(label(("apply_transposed" + kind).c_str(), n, n, nr), work, unit,
                  over_tiles([&](const double* p) { t.apply_transposed(n, n, nr, p, x.data(), y.data()); }), nullptr);
        if (tiles > 1) continue;
        bench.row(label("apply_lower", n, n, nr), work / 2, unit,
                  over_tiles([&](const double* p) { t.apply_lower(n, nr, p, x.data(), y.data()); }), nullptr);
        bench.row(label("apply_lower_transposed", n, n, nr), work / 2, unit,
                  over_tiles([&](const double* p) { t.apply_lower_transposed(n, nr, p, x.data(), y.data()); }),
                  nullptr);
      }
    }
  }
}

void bench_gemm(const Bench& bench) {
  for (const std::int64_t n : {4, 8, 16, 24, 32, 48, 64, 96, 128, 256, 512, 1000, 1024, 2048}) {
    const Array a = random_array(n * n, 1), b = random_array(n * n, 2);
    Array c = random_array(n * n, 3), r(n * n, nullptr);
    copy(c, r);
    const int ni = static_cast<int>(n);
    const double one = 1;
    for (const char* form : {"NN", "NT", "TN"}) {
      const bool ta = form[0] == 'T', tb = form[1] == 'T';
      const auto ours = [&, ta, tb] {
        espalier::device::host::gemm(ta, tb, n, n, n, 1.0, a.data(), n, b.data(), n, 1.0, c.data(), n);
      };
      const auto theirs = [&, form] {
        bench.blas.gemm(form, form + 1, &ni, &ni, &ni, &one, a.data(), &ni, b.data(), &ni, &one, r.data(), &ni);
      };
      const bool rival = bench.blas.gemm != nullptr;
      if (rival) {
        copy(c, r), ours(), theirs();
        double difference = 0;
        for (std::int64_t i = 0; i < n * n; ++i) difference = std::max(difference, std::abs(c[i] - r[i]));
        if (!(difference < 1e-13 * static_cast<double>(n))) std::printf("gemm differs by %g\n", difference);
      }
      bench.row(label((std::string("gemm ") + form).c_str(), n, n, n), 2.0 * static_cast<double>(n * n * n), "GF/s",
                ours, rival ? std::function<void()>(theirs) : nullptr);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Rates of the host dense kernels");
  std::string library;
  Bench bench;
  app.add_option("--blas", library, "shared library with dgemm_ and friends (32-bit integers)");
  app.add_option("--seconds", bench.seconds, "time per row");
  app.add_option("--only", bench.only, "products, layout, factor, fronts, substitution or gemm");
  CLI11_PARSE(app, argc, argv);
  bench.blas = load_blas(library);
  std::printf("target %s, rival %s, gemm_nt in cache %.1f GF/s\n", kernels<double>().target, bench.blas.name.c_str(),
              espalier::device::host::measure_gemm_rate(0.1) * 1e-9);
  if (bench.wanted("products")) bench_products(bench);
  if (bench.wanted("layout")) bench_layout(bench);
  if (bench.wanted("factor")) bench_factorizations(bench);
  if (bench.wanted("fronts")) bench_fronts(bench);
  if (bench.wanted("substitution")) bench_substitution(bench);
  if (bench.wanted("gemm")) bench_gemm(bench);
  return 0;
}
