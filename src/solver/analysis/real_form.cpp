#include "solver/analysis/real_form.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "base/at.hpp"
#include "solve/residual.hpp"

namespace espalier::solver {

namespace {

constexpr std::int64_t kColumns = 4096;  // of the complex matrix, per range of work

// Which entries of the block of a diagonal entry are stored.
struct Triangle {
  explicit Triangle(Storage s)
      : lower(s != Storage::symmetric_upper), upper(s != Storage::symmetric_lower), whole(lower && upper) {}
  bool lower, upper, whole;
};

// Where the two columns of column c begin in the pattern of twice the size. `diagonals`: stored ones before c.
Offset first_of(const MatrixView& a, Index c, Offset diagonals, const Triangle& stored) {
  return 4 * a.col_ptr[at(c)] - (stored.whole ? 0 : diagonals);
}

// Calls use(entry, place, row part, column part) for the entries of the blocks of one column, which stand from `first`
// and `second` on.
template <class Use>
void visit_blocks(const MatrixView& a, Index c, Offset first, Offset second, const Triangle& stored, Use&& use) {
  for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q) {
    const bool diagonal = a.row_ind[at(q)] == c;
    use(q, first++, 0, 0);
    if (!diagonal || stored.lower) use(q, first++, 1, 0);
    if (!diagonal || stored.upper) use(q, second++, 0, 1);
    use(q, second++, 1, 1);
  }
}

}  // namespace

Offset RealForm::bytes() const {
  const auto of = [](const auto& v) { return static_cast<Offset>(v.size() * sizeof(v[0])); };
  return of(a.col_ptr) + of(a.row_ind) + of(row_of_col) + rows.bytes() + of(tree.order) + of(tree.rows) +
         of(tree.parent) * 4;
}

std::shared_ptr<const RealForm> make_real_form(const PreparedMatrix& p, analysis::AssemblyTree tree,
                                               base::ThreadPool& pool) {
  const Index n = p.n();
  if (n > std::numeric_limits<Index>::max() / 2)
    throw Error(StatusCode::invalid_input,
                fmt::format("{} complex unknowns are too many for a device without complex numbers, which takes a real "
                            "system of twice the size; use device cpu",
                            n));
  auto made = std::make_shared<RealForm>();
  const MatrixView a = p.a;
  const Triangle stored(a.storage);
  made->hermitian = p.numbers == base::Numbers::hermitian;
  made->tree = std::move(tree);
  made->a.rows = made->a.cols = 2 * n;
  made->a.storage = a.storage;
  made->a.col_ptr.resize(2 * at(n) + 1);
  made->a.col_ptr[0] = 0;
  Offset diagonals = 0;
  for (Index c = 0; c < n; ++c) {
    const Offset entries = a.col_ptr[at(c) + 1] - a.col_ptr[at(c)];
    Offset here = 0;
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q) here += a.row_ind[at(q)] == c ? 1 : 0;
    made->a.col_ptr[2 * at(c) + 1] = first_of(a, c, diagonals, stored) + 2 * entries - (stored.lower ? 0 : here);
    diagonals += here;
    made->a.col_ptr[2 * at(c) + 2] = first_of(a, c + 1, diagonals, stored);
  }
  made->a.row_ind.resize(at(made->a.col_ptr[2 * at(n)]));
  pool.for_each_range(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<Index>(begin); c < end; ++c)
      visit_blocks(
          a, c, made->a.col_ptr[2 * at(c)], made->a.col_ptr[2 * at(c) + 1], stored,
          [&](Offset q, Offset to, Index row, Index) { made->a.row_ind[at(to)] = 2 * a.row_ind[at(q)] + row; });
  });
  made->row_of_col.reserve(2 * p.row_of_col.size());
  for (const Index r : p.row_of_col)
    for (const Index part : {0, 1}) made->row_of_col.push_back(2 * r + part);
  if (a.storage != Storage::symmetric_both) made->rows = matrix::index_rows(made->a, pool);
  return made;
}

analysis::AssemblyTree doubled(const analysis::AssemblyTree& tree) {
  analysis::AssemblyTree two;
  two.n = 2 * tree.n;
  two.parent = tree.parent;
  two.order.reserve(2 * tree.order.size());
  two.rows.reserve(2 * tree.rows.size());
  for (const Index c : tree.order) two.order.insert(two.order.end(), {2 * c, 2 * c + 1});
  for (const Index r : tree.rows) two.rows.append({2 * r, 2 * r + 1});
  for (const Index f : tree.first) two.first.push_back(2 * f);
  for (const Offset p : tree.row_ptr) two.row_ptr.push_back(2 * p);
  return two;
}

namespace {

// What stands in a block of the number v.
template <class T>
T value_of(const RealForm& f, std::complex<T> v, Index row, Index col) {
  const T value = row == col ? v.real() : col == 1 ? -v.imag() : v.imag();
  return row == 1 && !f.hermitian ? -value : value;
}

}  // namespace

template <class T>
void real_values(const RealForm& f, const MatrixView& a, const std::complex<T>* from, T* to, base::ThreadPool& pool) {
  const Triangle stored(a.storage);
  pool.for_each_range(a.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<Index>(begin); c < end; ++c)
      visit_blocks(a, c, f.a.col_ptr[2 * at(c)], f.a.col_ptr[2 * at(c) + 1], stored,
                   [&](Offset q, Offset place, Index row, Index col) { to[place] = value_of(f, from[q], row, col); });
  });
}

template <class T>
void real_values(const RealForm& f, const MatrixView& a, const std::complex<T>* from, std::span<const Offset> entries,
                 T* to, base::ThreadPool& pool) {
  const Triangle stored(a.storage);
  const auto first_from = [&](Offset place) { return std::lower_bound(entries.begin(), entries.end(), place); };
  pool.for_each_range(a.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<Index>(begin); c < end; ++c) {
      const Offset first = f.a.col_ptr[2 * at(c)], second = f.a.col_ptr[2 * at(c) + 1];
      std::array next = {first_from(first), first_from(second)};  // of each of the two columns
      visit_blocks(a, c, first, second, stored, [&](Offset q, Offset place, Index row, Index col) {
        auto& entry = next[at(col)];
        if (entry == entries.end() || *entry != place) return;
        to[entry++ - entries.begin()] = value_of(f, from[q], row, col);
      });
    }
  });
}

#define ESPALIER_INSTANTIATE(T)                                                                                      \
  template void real_values(const RealForm&, const MatrixView&, const std::complex<T>*, T*, base::ThreadPool&);      \
  template void real_values(const RealForm&, const MatrixView&, const std::complex<T>*, std::span<const Offset>, T*, \
                            base::ThreadPool&);
ESPALIER_INSTANTIATE(float)
ESPALIER_INSTANTIATE(double)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::solver
