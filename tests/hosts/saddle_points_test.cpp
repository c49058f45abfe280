// Regularised saddle points ([0 B; B^T -d I], [e I, B^T; B 0] and their kin) through every interface. Truths: the
// residual in long double, and the solution itself where the condition of B alone bounds its error. An interface
// answers with a small backward error, or with an error of its own; no answer is called a success that is none.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#ifdef ESPALIER_MUMPS
#include <dmumps_c.h>
#endif

#include "hosts/library.hpp"
#include "hsl/ma97.hpp"
#include "reference/saddle_points.hpp"

namespace espalier::test {
namespace {

using Integers = std::vector<int>;
using Reals = std::vector<double>;

// A symmetric matrix by its lower triangle in columns, its upper one in rows, and as coordinates; counted from 1.
struct Given {
  explicit Given(const SparseMatrix& lower) : n(lower.rows), values(lower.values) {
    for (const Offset p : lower.col_ptr) pointers.push_back(static_cast<int>(p) + 1);
    for (Index c = 0; c < n; ++c)
      for (int k = pointers[static_cast<std::size_t>(c)]; k < pointers[static_cast<std::size_t>(c) + 1]; ++k) {
        rows.push_back(lower.row_ind[static_cast<std::size_t>(k) - 1] + 1);
        columns.push_back(c + 1);
      }
  }
  int n;
  Integers pointers, rows, columns;
  Reals values;
  [[nodiscard]] int entries() const { return static_cast<int>(rows.size()); }
};

struct Answer {
  int error = 0;  // of the interface; below 0 it says that it has failed
  Reals x;
};

Answer by_ma97(const SparseMatrix& a, const Reals& b) {
  using hosts::ma97::Control, hosts::ma97::Info;
  const Library library(ESPALIER_HSL);
  Given m(a);
  Control control{};
  Info info{};
  void *akeep = nullptr, *fkeep = nullptr;
  library.function<void(Control*)>("ma97_default_control_d")(&control);
  control.f_arrays = 1;
  library.function<void(int, int, const int*, const int*, double*, void**, const Control*, Info*, int*)>(
      "ma97_analyse_d")(0, m.n, m.pointers.data(), m.rows.data(), nullptr, &akeep, &control, &info, nullptr);
  Answer answer{0, b};
  library.function<void(int, const int*, const int*, const double*, int, double*, int, void**, void**, const Control*,
                        Info*, double*)>("ma97_factor_solve_d")(4, m.pointers.data(), m.rows.data(), m.values.data(), 1,
                                                                answer.x.data(), m.n, &akeep, &fkeep, &control, &info,
                                                                nullptr);
  answer.error = info.flag;
  library.function<void(void**, void**)>("ma97_finalise_d")(&akeep, &fkeep);
  return answer;
}

Answer by_ma57(const SparseMatrix& a, const Reals& b) {
  const Library library(ESPALIER_HSL);
  Given m(a);
  int entries = m.entries(), length = 7 * m.n + 2 * entries + 42, job = 1, one = 1, work_length = m.n;
  Integers keep(length), iwork(5 * m.n), icntl(20), info(40);
  Reals cntl(5), rinfo(20), work(m.n);
  Answer answer{0, b};
  library.function<void(double*, int*)>("ma57id_")(cntl.data(), icntl.data());
  library.function<void(int*, int*, int*, int*, int*, int*, int*, int*, int*, double*)>("ma57ad_")(
      &m.n, &entries, m.rows.data(), m.columns.data(), &length, keep.data(), iwork.data(), icntl.data(), info.data(),
      rinfo.data());
  int reals = info[8], integers = info[9];
  Reals fact(reals);
  Integers ifact(integers);
  library
      .function<void(int*, int*, double*, double*, int*, int*, int*, int*, int*, int*, int*, double*, int*, double*)>(
          "ma57bd_")(&m.n, &entries, m.values.data(), fact.data(), &reals, ifact.data(), &integers, &length,
                     keep.data(), iwork.data(), icntl.data(), cntl.data(), info.data(), rinfo.data());
  answer.error = info[0];
  if (answer.error != 0) return answer;
  library.function<void(int*, int*, double*, int*, int*, int*, int*, double*, int*, double*, int*, int*, int*, int*)>(
      "ma57cd_")(&job, &m.n, fact.data(), &reals, ifact.data(), &integers, &one, answer.x.data(), &m.n, work.data(),
                 &work_length, iwork.data(), icntl.data(), info.data());
  answer.error = info[0];
  return answer;
}

Answer by_ma27(const SparseMatrix& a, const Reals& b) {
  const Library library(ESPALIER_HSL);
  Given m(a);
  int entries = m.entries(), integers = 2 * (2 * entries + 3 * m.n + 1), steps = 0, front = 0, flag = 0;
  Integers keep(3 * m.n), iw1(2 * m.n), icntl(30), info(20), iw(integers);
  Reals cntl(5);
  double operations = 0;
  Answer answer{0, b};
  library.function<void(int*, double*)>("ma27id_")(icntl.data(), cntl.data());
  library.function<void(int*, int*, int*, int*, int*, int*, int*, int*, int*, int*, int*, double*, int*, double*)>(
      "ma27ad_")(&m.n, &entries, m.rows.data(), m.columns.data(), iw.data(), &integers, keep.data(), iw1.data(), &steps,
                 &flag, icntl.data(), cntl.data(), info.data(), &operations);
  int reals = info[4];
  integers = info[5];
  Reals values = m.values;
  values.resize(static_cast<std::size_t>(reals));
  iw.assign(integers, 0);
  library
      .function<void(int*, int*, int*, int*, double*, int*, int*, int*, int*, int*, int*, int*, int*, double*, int*)>(
          "ma27bd_")(&m.n, &entries, m.rows.data(), m.columns.data(), values.data(), &reals, iw.data(), &integers,
                     keep.data(), &steps, &front, iw1.data(), icntl.data(), cntl.data(), info.data());
  answer.error = info[0];
  if (answer.error != 0) return answer;
  Reals w(front);
  Integers of_steps(steps);
  library.function<void(int*, double*, int*, int*, int*, double*, int*, double*, int*, int*, int*, int*)>("ma27cd_")(
      &m.n, values.data(), &reals, iw.data(), &integers, w.data(), &front, answer.x.data(), of_steps.data(), &steps,
      icntl.data(), info.data());
  answer.error = info[0];
  return answer;
}

// All rows of a general matrix, or the upper triangle: rows of the transpose are columns.
Given rows_for_pardiso(const SparseMatrix& a, int type) {
  if (type == -2) return Given(a);
  const SparseMatrix general = reference::stored_as(a, Storage::general);
  return Given(general);  // its values are symmetric
}

struct PardisoWish {
  int type, matching, steps;
};

Answer by_mkl(const SparseMatrix& a, const Reals& b, const PardisoWish& wish) {
  const Library library(ESPALIER_MKL_PARDISO);
  Given m = rows_for_pardiso(a, wish.type);
  void* pt[64];
  int iparm[64], one = 1, phase = 13, quiet = 0;
  library.function<void(void**, const int*, int*)>("pardisoinit")(pt, &wish.type, iparm);
  iparm[12] = wish.matching;
  iparm[7] = wish.steps;
  Answer answer{0, Reals(b.size())};
  Reals right = b;
  const auto call = [&](int* error) {
    library.function<void(void**, const int*, const int*, const int*, const int*, const int*, const void*, const int*,
                          const int*, int*, const int*, int*, const int*, void*, void*, int*)>("pardiso")(
        pt, &one, &one, &wish.type, &phase, &m.n, m.values.data(), m.pointers.data(), m.rows.data(), nullptr, &one,
        iparm, &quiet, right.data(), answer.x.data(), error);
  };
  call(&answer.error);
  phase = -1;
  int unread = 0;
  call(&unread);
  return answer;
}

Answer by_panua(const SparseMatrix& a, const Reals& b, const PardisoWish& wish) {
  const Library library(ESPALIER_PANUA);
  Given m = rows_for_pardiso(a, wish.type);
  void* pt[64];
  int iparm[64] = {}, one = 1, phase = 13, quiet = 0, direct = 0;
  double dparm[64];
  Answer answer{0, Reals(b.size())};
  Reals right = b;
  library.function<void(void**, const int*, const int*, int*, double*, int*)>("pardisoinit")(
      pt, &wish.type, &direct, iparm, dparm, &answer.error);
  iparm[12] = wish.matching;
  iparm[7] = wish.steps;
  const auto call = [&](int* error) {
    library.function<void(void**, const int*, const int*, const int*, const int*, const int*, const double*, const int*,
                          const int*, int*, const int*, int*, const int*, double*, double*, int*, double*)>("pardiso")(
        pt, &one, &one, &wish.type, &phase, &m.n, m.values.data(), m.pointers.data(), m.rows.data(), nullptr, &one,
        iparm, &quiet, right.data(), answer.x.data(), error, dparm);
  };
  call(&answer.error);
  phase = -1;
  int unread = 0;
  call(&unread);
  return answer;
}

Answer by_umfpack(const SparseMatrix& a, const Reals& b) {
  const Variable small("ESPALIER_SMALL", "ours");
  const Library library(ESPALIER_UMFPACK);
  const Given m(reference::stored_as(a, Storage::general));
  Integers pointers = m.pointers, rows = m.rows;
  for (int& p : pointers) --p;
  for (int& r : rows) --r;
  void *symbolic = nullptr, *numeric = nullptr;
  const double* control = nullptr;
  double info[90];
  Answer answer{0, Reals(b.size())};
  answer.error = library.function<int(int, int, const int*, const int*, const double*, void**, const double*, double*)>(
      "umfpack_di_symbolic")(m.n, m.n, pointers.data(), rows.data(), m.values.data(), &symbolic, control, info);
  if (answer.error == 0)
    answer.error = library.function<int(const int*, const int*, const double*, void*, void**, const double*, double*)>(
        "umfpack_di_numeric")(pointers.data(), rows.data(), m.values.data(), symbolic, &numeric, control, info);
  if (answer.error == 0)
    answer.error = library.function<int(int, const int*, const int*, const double*, double*, const double*, void*,
                                        const double*, double*)>("umfpack_di_solve")(
        0, pointers.data(), rows.data(), m.values.data(), answer.x.data(), b.data(), numeric, control, info);
  library.function<void(void**)>("umfpack_di_free_numeric")(&numeric);
  library.function<void(void**)>("umfpack_di_free_symbolic")(&symbolic);
  return answer;
}

#ifdef ESPALIER_MUMPS
Answer by_mumps(const SparseMatrix& a, const Reals& b, int sym, int steps) {
  const Variable small("ESPALIER_SMALL", "ours");
  const Library library(ESPALIER_MUMPS);
  const auto dmumps = library.function<void(DMUMPS_STRUC_C*)>("dmumps_c");
  Given m = sym == 0 ? Given(reference::stored_as(a, Storage::general)) : Given(a);
  DMUMPS_STRUC_C id{};
  id.sym = sym;
  id.par = 1;
  id.comm_fortran = -987654;
  id.job = -1;
  dmumps(&id);
  for (const int k : {0, 1, 2}) id.icntl[k] = -1;
  id.icntl[3] = 0;
  id.icntl[9] = steps;
  id.n = m.n;
  id.nnz = m.entries();
  id.irn = m.rows.data();
  id.jcn = m.columns.data();
  id.a = m.values.data();
  Answer answer{0, b};
  id.rhs = answer.x.data();
  id.job = 6;
  dmumps(&id);
  answer.error = id.infog[0];
  id.job = -2;
  dmumps(&id);
  return answer;
}
#endif

struct Interface {
  std::string name;
  std::function<Answer(const SparseMatrix&, const Reals&)> solve;
};

std::vector<Interface> interfaces() {
  std::vector<Interface> all = {{"ma97", by_ma97}, {"ma57", by_ma57}, {"ma27", by_ma27}, {"umfpack", by_umfpack}};
  for (const int type : {-2, 11})
    for (const int matching : {0, 1})
      for (const int steps : {0, 2}) {
        const PardisoWish wish{type, matching, steps};
        const std::string words = " type " + std::to_string(type) + ", matching " + std::to_string(matching) +
                                  ", steps " + std::to_string(steps);
        all.push_back({"mkl" + words, [=](const auto& a, const auto& b) { return by_mkl(a, b, wish); }});
        all.push_back({"panua" + words, [=](const auto& a, const auto& b) { return by_panua(a, b, wish); }});
      }
#ifdef ESPALIER_MUMPS
  for (const int sym : {0, 2})
    for (const int steps : {0, 2})
      all.push_back({"mumps sym " + std::to_string(sym) + ", steps " + std::to_string(steps),
                     [=](const auto& a, const auto& b) { return by_mumps(a, b, sym, steps); }});
#endif
  return all;
}

Reals product(const SparseMatrix& a, const Reals& x) {
  const Reals zero(x.size(), 0.0);
  Reals b = reference::residual(a, zero.data(), x.data(), false);
  for (double& v : b) v = -v;
  return b;
}

double distance(const Reals& x, const Reals& y) {
  double most = 0;
  for (std::size_t k = 0; k < x.size(); ++k) most = std::max(most, std::abs(x[k] - y[k]));
  return std::isfinite(most) ? most : 1e300;
}

using reference::Corner;
using reference::SaddleShape;

// The shapes of square B: no value smaller than B's own singular values, whatever the corners are.
std::vector<SaddleShape> square_shapes(double size, Index half, std::uint64_t seed) {
  return {{half, half, Corner::zero, Corner::identity, 0, size, seed},
          {half, half, Corner::identity, Corner::zero, size, 0, seed + 1},
          {half, half, Corner::identity, Corner::identity, size, std::sqrt(size), seed + 2},
          {half, half, Corner::zero, Corner::wandering, 0, size, seed + 3}};
}

// From 1 to 1e-30, among them what interior-point and least-squares methods take.
TEST(HostSaddlePoints, SolutionsOfEveryInterface) {
  for (const Interface& host : interfaces())
    for (const double size : {1.0, 1e-4, 1e-8, 1e-10, 1e-12, 1e-14, 1e-20, 1e-25, 1e-30})
      for (const Index half : {1, 7, 40}) {
        for (const SaddleShape& shape : square_shapes(size, half, static_cast<std::uint64_t>(half))) {
          SCOPED_TRACE(host.name + ": " + name_of(shape));
          const SparseMatrix a = saddle_point(shape);
          const Reals truth(static_cast<std::size_t>(a.rows), 1.0), b = product(a, truth);
          const Answer answer = host.solve(a, b);
          ASSERT_EQ(answer.error, 0);
          ASSERT_LE(reference::backward_error(a, b, answer.x), 1e-10);
          // |A^-1| is below 1e4 where the corners are small; of entries around 1 it is no larger by construction.
          ASSERT_LE(distance(answer.x, truth), 1e-6);
        }
      }
}

}  // namespace
}  // namespace espalier::test
