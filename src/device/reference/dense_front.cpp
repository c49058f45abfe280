#include "device/reference/dense_front.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace espalier::device::reference {

namespace {

// The ratio of the largest diagonal entry to the largest beside the diagonal, from which on a 1x1 pivot grows no faster
// than a 2x2 one: (1 + sqrt(17)) / 8.
constexpr double kOneByOne = 0.6403882032022076;

// The largest magnitudes in the rest of a pivot block, and where they stand.
struct Largest {
  double diagonal = 0, beside = 0;
  Index at = 0, row = 0, col = 0;
};

template <class T>
Largest largest_from(const DenseFront<T>& f, Index begin) {
  Largest found;
  found.at = begin;
  for (Index j = begin; j < f.pivots(); ++j) {
    if (const auto d = std::abs(static_cast<double>(f(j, j))); d > found.diagonal) {
      found.diagonal = d;
      found.at = j;
    }
    for (Index i = j + 1; i < f.pivots(); ++i)
      if (const auto b = std::abs(static_cast<double>(f(i, j))); b > found.beside) {
        found.beside = b;
        found.row = i;
        found.col = j;
      }
  }
  return found;
}

}  // namespace

template <class T>
DenseFront<T>::DenseFront(Index position, Index pivots, Index rows, base::MemoryBudget* budget)
    : position_(position),
      pivots_(pivots),
      rows_(rows),
      values_(static_cast<Offset>(rows) * rows, budget),
      order_(static_cast<std::size_t>(pivots)),
      d_(static_cast<std::size_t>(pivots)),
      e_(static_cast<std::size_t>(pivots)) {}

template <class T>
void DenseFront<T>::clear() {
  std::fill_n(values_.data(), values_.size(), T(0));
  std::iota(order_.begin(), order_.end(), 0);
  std::fill(e_.begin(), e_.end(), T(0));
}

template <class T>
void DenseFront<T>::exchange_rows(Index a, Index b) {
  for (Index j = 0; j < rows_; ++j) std::swap((*this)(a, j), (*this)(b, j));
  std::swap(order_[static_cast<std::size_t>(a)], order_[static_cast<std::size_t>(b)]);
}

template <class T>
void DenseFront<T>::exchange_columns(Index a, Index b) {
  for (Index i = 0; i < rows_; ++i) std::swap((*this)(i, a), (*this)(i, b));
}

template <class T>
void DenseFront<T>::exchange_unknowns(Index a, Index b) {
  if (a == b) return;
  exchange_rows(a, b);
  exchange_columns(a, b);
}

template <class T>
bool DenseFront<T>::llt(const PivotRule& rule, FactorOutcome& out, Determinant& determinant) {
  DenseFront& f = *this;
  for (Index j = 0; j < pivots_; ++j) {
    const auto d = static_cast<double>(f(j, j));
    if (!(d > 0)) {
      out.not_positive = position_ + j;
      return false;
    }
    const auto at = static_cast<std::size_t>(position_ + j);
    if (!rule.smallest.empty() && d <= rule.smallest[at]) out.replaced.push_back(position_ + j);
    determinant.multiply(d);
    const T root = std::sqrt(f(j, j));
    f(j, j) = root;
    for (Index i = j + 1; i < rows_; ++i) f(i, j) /= root;
    for (Index c = j + 1; c < rows_; ++c)
      for (Index i = c; i < rows_; ++i) f(i, c) -= f(i, j) * f(c, j);
  }
  for (Index c = pivots_; c < rows_; ++c)  // the contribution has both triangles
    for (Index i = c + 1; i < rows_; ++i) f(c, i) = f(i, c);
  return true;
}

template <class T>
void DenseFront<T>::judge_size(Index unknown, double eigenvalue, const PivotRule& rule, FactorOutcome& out) const {
  if (!(std::abs(eigenvalue) < rule.suspect)) return;
  out.small.push_back(position_ + unknown);
  if (eigenvalue < 0) ++out.small_negative;
}

template <class T>
void DenseFront<T>::judge_growth(Index j, Index unknown, const PivotRule& rule, FactorOutcome& out) const {
  const double limit = 1 / rule.threshold;
  for (Index i = j + 1; i < rows_; ++i)
    if (!(std::abs(static_cast<double>((*this)(i, j))) <= limit)) {
      out.failed.push_back(position_ + unknown);
      return;
    }
}

// F(j+1.., j+1..) -= l d l^T with l = F(j+1.., j) / d.
template <class T>
void DenseFront<T>::eliminate_one(Index j, T d, const PivotRule& rule, FactorOutcome& out) {
  DenseFront& f = *this;
  d_[static_cast<std::size_t>(j)] = d;
  for (Index c = j + 1; c < rows_; ++c)
    for (Index i = j + 1; i < rows_; ++i) f(i, c) -= f(i, j) / d * f(j, c);
  for (Index i = j + 1; i < rows_; ++i) f(i, j) /= d;
  judge_growth(j, order_[static_cast<std::size_t>(j)], rule, out);
}

// The same with the block [a b; b c] of rows j and j + 1: (l1, l2) = (f1, f2) [a b; b c]^-1.
template <class T>
void DenseFront<T>::eliminate_two(Index j, const PivotRule& rule, FactorOutcome& out) {
  DenseFront& f = *this;
  const auto at = static_cast<std::size_t>(j);
  const T a = f(j, j), b = f(j + 1, j), c = f(j + 1, j + 1);
  const T det_by_b = a / b * c - b;  // b is the largest of the three
  d_[at] = a;
  d_[at + 1] = c;
  e_[at] = b;
  for (Index i = j + 2; i < rows_; ++i) {
    const T f1 = f(i, j), f2 = f(i, j + 1);
    f(i, j) = (c / b * f1 - f2) / det_by_b;
    f(i, j + 1) = (a / b * f2 - f1) / det_by_b;
  }
  f(j + 1, j) = T(0);  // L is unit there
  for (Index k = j + 2; k < rows_; ++k)
    for (Index i = j + 2; i < rows_; ++i) f(i, k) -= f(i, j) * f(j, k) + f(i, j + 1) * f(j + 1, k);
  judge_growth(j, order_[at], rule, out);
  judge_growth(j + 1, order_[at + 1], rule, out);
}

template <class T>
void DenseFront<T>::ldlt(const PivotRule& rule, FactorOutcome& out, Determinant& determinant) {
  DenseFront& f = *this;
  for (Index j = 0; j < pivots_;) {
    const Largest rest = largest_from(f, j);
    if (rest.diagonal < kOneByOne * rest.beside && rest.beside > rule.tiny) {
      exchange_unknowns(j, rest.col);
      exchange_unknowns(j + 1, rest.row);
      const auto a = static_cast<double>(f(j, j)), b = static_cast<double>(f(j + 1, j)),
                 c = static_cast<double>(f(j + 1, j + 1));
      determinant.multiply(a / b * c - b);
      determinant.multiply(b);
      ++out.two_by_two;
      ++out.negative;  // |a c| <= kOneByOne^2 b^2 < b^2: one eigenvalue of each sign
      const double root = std::hypot((a - c) / 2, b);
      judge_size(order_[static_cast<std::size_t>(j)], (a + c) / 2 - root, rule, out);
      judge_size(order_[static_cast<std::size_t>(j) + 1], (a + c) / 2 + root, rule, out);
      eliminate_two(j, rule, out);
      j += 2;
      continue;
    }
    exchange_unknowns(j, rest.at);
    T d = f(j, j);
    const bool vanishes = !(std::abs(static_cast<double>(d)) > rule.tiny);
    if (vanishes) {
      d = static_cast<T>(std::copysign(rule.tiny, static_cast<double>(d)));
      out.replaced.push_back(position_ + order_[static_cast<std::size_t>(j)]);
    } else {
      if (d < T(0)) ++out.negative;
      judge_size(order_[static_cast<std::size_t>(j)], static_cast<double>(d), rule, out);
    }
    determinant.multiply(static_cast<double>(d));
    eliminate_one(j, d, rule, out);
    ++j;
  }
}

template <class T>
void DenseFront<T>::lu(const PivotRule& rule, FactorOutcome& out, Determinant& determinant) {
  DenseFront& f = *this;
  for (Index j = 0; j < pivots_; ++j) {
    Index best = j;
    for (Index i = j + 1; i < pivots_; ++i)
      if (std::abs(f(i, j)) > std::abs(f(best, j))) best = i;
    if (best != j) {
      exchange_rows(j, best);
      determinant.multiply(-1.0);
    }
    T& pivot = f(j, j);
    if (!(std::abs(static_cast<double>(pivot)) > rule.tiny)) {
      pivot = static_cast<T>(std::copysign(rule.tiny, static_cast<double>(pivot)));
      out.replaced.push_back(position_ + j);
      out.failed.push_back(position_ + order_[static_cast<std::size_t>(j)]);  // its row had better leave as well
    } else {
      judge_size(j, std::abs(static_cast<double>(pivot)), rule, out);
    }
    determinant.multiply(static_cast<double>(pivot));
    for (Index i = j + 1; i < rows_; ++i) f(i, j) /= pivot;
    for (Index c = j + 1; c < rows_; ++c)
      for (Index i = j + 1; i < rows_; ++i) f(i, c) -= f(i, j) * f(j, c);
    judge_growth(j, j, rule, out);
  }
}

template <class T>
void DenseFront<T>::divide_by_d(std::vector<T>& x) const {
  for (std::size_t j = 0; j < d_.size(); ++j) {
    if (e_[j] == T(0)) {
      x[j] /= d_[j];
      continue;
    }
    const T a = d_[j], b = e_[j], c = d_[j + 1];
    const T det_by_b = a / b * c - b, x1 = x[j], x2 = x[j + 1];
    x[j] = (c / b * x1 - x2) / det_by_b;
    x[j + 1] = (a / b * x2 - x1) / det_by_b;
    ++j;
  }
}

template <class T>
void DenseFront<T>::forward(Kind kind, bool transpose, std::vector<T>& x) const {
  const DenseFront& f = *this;
  const bool upper = kind == Kind::lu && transpose;  // U^T instead of L
  if (!upper) {
    const std::vector<T> before(x.begin(), x.begin() + pivots_);
    for (std::size_t j = 0; j < order_.size(); ++j) x[j] = before[static_cast<std::size_t>(order_[j])];
  }
  for (Index j = 0; j < pivots_; ++j) {
    T& known = x[static_cast<std::size_t>(j)];
    if (upper || kind == Kind::llt) known /= f(j, j);
    for (Index i = j + 1; i < rows_; ++i) x[static_cast<std::size_t>(i)] -= (upper ? f(j, i) : f(i, j)) * known;
  }
}

template <class T>
void DenseFront<T>::backward(Kind kind, bool transpose, std::vector<T>& x) const {
  const DenseFront& f = *this;
  if (kind == Kind::ldlt) divide_by_d(x);
  const bool upper = kind == Kind::lu && !transpose;  // U instead of L^T
  for (Index j = pivots_ - 1; j >= 0; --j) {
    T& wanted = x[static_cast<std::size_t>(j)];
    for (Index i = j + 1; i < rows_; ++i) wanted -= (upper ? f(j, i) : f(i, j)) * x[static_cast<std::size_t>(i)];
    if (upper || kind == Kind::llt) wanted /= f(j, j);
  }
  if (upper) return;
  const std::vector<T> before(x.begin(), x.begin() + pivots_);
  for (std::size_t j = 0; j < order_.size(); ++j) x[static_cast<std::size_t>(order_[j])] = before[j];
}

template class DenseFront<double>;
template class DenseFront<float>;

}  // namespace espalier::device::reference
