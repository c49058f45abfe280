#include "changes/folding.hpp"

#include <cmath>
#include <utility>
#include <vector>

#include "base/at.hpp"

namespace espalier::changes {

namespace {

template <class T>
class Folding {
 public:
  Folding(const ChangedMatrix<T>& matrix, Base<T>& original)
      : matrix_(matrix), original_(original), a_(original.pattern()), more_(at(matrix.entities())) {
    folded_.rows = folded_.cols = matrix.entities();
    folded_.storage = symmetric(matrix, original) ? a_.storage : Storage::general;
  }

  SparseMatrixOf<T> make(bool as_given) {
    for (Index e = matrix_.n(); e < matrix_.entities(); ++e) place_item(e);
    if (a_.storage != folded_.storage && a_.storage != Storage::symmetric_both) turn_triangle();
    const std::span<const T> values = original_.values();
    folded_.col_ptr.push_back(0);
    for (Index c = 0; c < matrix_.entities(); ++c) {
      bool diagonal = false;
      for (Offset q = c < matrix_.n() ? a_.col_ptr[c] : 0; c < matrix_.n() && q < a_.col_ptr[c + 1]; ++q) {
        const Index r = a_.row_ind[q];
        diagonal = diagonal || r == c;
        add_entry(r, r == c && !matrix_.alive(c) ? T(scale(c)) : kept(r, c) ? values[at(q)] : T(0));
      }
      if (c < matrix_.n() && !diagonal && !matrix_.alive(c)) add_entry(c, scale(c));
      for (const auto& [row, value] : more_[at(c)]) add_entry(row, value);
      folded_.col_ptr.push_back(static_cast<Offset>(folded_.row_ind.size()));
    }
    // As the caller gave it, so that its pattern is known.
    const bool hermitian = folded_.storage != Storage::general && original_.hermitian();
    if (folded_.storage != Storage::general && original_.session().current().system->prepared.symmetric_values &&
        (as_given || !hermitian))
      folded_.storage = Storage::general;
    else if (hermitian)
      folded_.storage = hermitian_storage(folded_.storage);
    return std::move(folded_);
  }

 private:
  static Storage hermitian_storage(Storage s) {
    return s == Storage::symmetric_lower   ? Storage::hermitian_lower
           : s == Storage::symmetric_upper ? Storage::hermitian_upper
                                           : Storage::hermitian_both;
  }
  [[nodiscard]] bool kept(Index r, Index c) const { return matrix_.alive(r) && matrix_.alive(c); }
  void add_entry(Index row, T value) {
    folded_.row_ind.push_back(row);
    folded_.values.push_back(value);
  }
  // The diagonal entry of the identity's row in the place of one that is not alive.
  double scale(Index e) {
    const double usual = e < matrix_.n() ? original_.row_sums()[at(e)] : std::abs(matrix_.item(e).corner);
    return usual > 0 && std::isfinite(usual) ? usual : 1;
  }
  void place_item(Index e) {
    const Item<T>& item = matrix_.item(e);
    if (!matrix_.alive(e)) {
      more_[at(e)].emplace_back(e, scale(e));
      return;
    }
    if (folded_.storage != Storage::symmetric_lower)
      for (std::size_t q = 0; q < item.column.size(); ++q)
        if (matrix_.alive(item.column.place[q])) more_[at(e)].emplace_back(item.column.place[q], item.column.value[q]);
    if (folded_.storage != Storage::symmetric_upper)
      for (std::size_t q = 0; q < item.row.size(); ++q)
        if (matrix_.alive(item.row.place[q])) more_[at(item.row.place[q])].emplace_back(e, item.row.value[q]);
    more_[at(e)].emplace_back(e, item.corner);
  }
  // The other triangle, where one is stored and the changes are not symmetric.
  void turn_triangle() {
    for (Index c = 0; c < a_.cols; ++c)
      for (Offset q = a_.col_ptr[c]; q < a_.col_ptr[c + 1]; ++q)
        if (const Index r = a_.row_ind[q]; r != c) {
          const T v = kept(r, c) ? original_.values()[at(q)] : T(0);
          more_[at(r)].emplace_back(c, original_.hermitian() ? base::conjugate(v) : v);
        }
  }

  const ChangedMatrix<T>& matrix_;
  Base<T>& original_;
  const solver::StoredMatrix& a_;
  std::vector<std::vector<std::pair<Index, T>>> more_;  // by column, besides the entries of A: row, value
  SparseMatrixOf<T> folded_;
};

}  // namespace

template <class T>
SparseMatrixOf<T> folded(const ChangedMatrix<T>& matrix, Base<T>& original, bool as_given) {
  return Folding<T>(matrix, original).make(as_given);
}

#define ESPALIER_INSTANTIATE(T) template SparseMatrixOf<T> folded(const ChangedMatrix<T>&, Base<T>&, bool);
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
