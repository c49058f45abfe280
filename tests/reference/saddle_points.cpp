#include "reference/saddle_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "matrix/generators/random.hpp"

namespace espalier::reference {

namespace {

constexpr std::array<const char*, 4> kCorners = {"zero", "identity", "wandering", "chain"};

std::string name_of(Corner corner, double size) {
  return std::string(kCorners[static_cast<std::size_t>(corner)]) + " " + std::to_string(std::log10(size));
}

/// Entries in the order of the blocks.
class Blocks {
 public:
  explicit Blocks(const SaddleShape& shape) : shape_(shape), random_(shape.seed) {}

  std::vector<Triple> entries() {
    corner(0, shape_.top, shape_.upper, shape_.upper_size);
    coupling();
    corner(shape_.top, shape_.bottom, shape_.lower, -shape_.lower_size);
    return std::move(entries_);
  }

 private:
  double number() { return 2 * matrix::random_unit(random_, count_++) - 1; }
  Index below(Index n) {
    return static_cast<Index>(matrix::random_below(random_, count_++, static_cast<std::uint64_t>(n)));
  }

  void corner(Index first, Index n, Corner what, double size) {
    for (Index k = 0; k < n && what != Corner::zero; ++k) {
      const bool linked = what != Corner::chain || k % 2 == 0;
      double v = linked ? size : std::copysign(1.0, size);
      if (what == Corner::wandering) v = std::copysign(std::pow(std::abs(size), 1 + number()), size);
      entries_.push_back({first + k, first + k, (what == Corner::chain && linked ? 4 : 1) * v});
      if (what == Corner::chain && linked && k + 2 < n) entries_.push_back({first + k + 2, first + k, -size});
    }
  }

  // Dominated by entries (k, k modulo the shorter side), so that no direction is nearly lost.
  void coupling() {
    const Index longer = std::max(shape_.top, shape_.bottom), shorter = std::min(shape_.top, shape_.bottom);
    const auto add = [&](Index along, Index across, double v) {
      const Index row = shape_.top >= shape_.bottom ? along : across;
      const Index column = shape_.top >= shape_.bottom ? across : along;
      entries_.push_back({shape_.top + column, row, v});
    };
    for (Index k = 0; k < longer; ++k) {
      add(k, k % shorter, k < shorter ? 2 + number() : 0.5 * number());
      for (int more = 0; more < 2; ++more)
        if (const Index j = below(shorter); j != k % shorter) add(k, j, 0.5 * number());
    }
  }

  SaddleShape shape_;
  std::uint64_t random_, count_ = 0;
  std::vector<Triple> entries_;
};

}  // namespace

std::string name_of(const SaddleShape& s) {
  return std::to_string(s.top) + " + " + std::to_string(s.bottom) + ", upper " + name_of(s.upper, s.upper_size) +
         ", lower " + name_of(s.lower, s.lower_size) + ", seed " + std::to_string(s.seed);
}

SparseMatrix saddle_point(const SaddleShape& shape) {
  const Index n = shape.top + shape.bottom;
  const std::vector<Index> name = matrix::random_permutation(n, shape.seed + 1000);
  std::vector<Triple> triples = Blocks(shape).entries();
  for (Triple& t : triples) {
    const auto [low, high] =
        std::minmax({name[static_cast<std::size_t>(t.row)], name[static_cast<std::size_t>(t.col)]});
    t.row = high;
    t.col = low;
  }
  std::sort(triples.begin(), triples.end(),
            [](const Triple& s, const Triple& t) { return std::pair(s.col, s.row) < std::pair(t.col, t.row); });
  // Some interfaces refuse entries that stand twice.
  std::vector<Triple> once;
  for (const Triple& t : triples) {
    const bool again = !once.empty() && once.back().row == t.row && once.back().col == t.col;
    if (again)
      once.back().value += t.value;
    else
      once.push_back(t);
  }
  return from_triples(n, once, Storage::symmetric_lower);
}

SparseMatrix in_units(SparseMatrix a, int exponent) {
  for (double& v : a.values) v = std::ldexp(v, exponent);
  return a;
}

SparseMatrix shuffled_rows(const MatrixView& a, std::uint64_t seed) {
  const std::vector<Index> name = matrix::random_permutation(a.rows, seed);
  SparseMatrix general = stored_as(a, Storage::general);
  for (Index& r : general.row_ind) r = name[static_cast<std::size_t>(r)];
  return general;
}

ComplexSparseMatrix turned(const MatrixView& a, bool hermitian, std::uint64_t seed) {
  using Number = std::complex<double>;
  constexpr std::array<Number, 4> kTurns = {Number{1, 0}, Number{0, 1}, Number{-1, 0}, Number{0, -1}};
  const auto turn = [&](Index k) {
    return kTurns[matrix::random_below(seed, static_cast<std::uint64_t>(k), kTurns.size())];
  };
  ComplexSparseMatrix c{a.rows,
                        a.cols,
                        {a.col_ptr.begin(), a.col_ptr.end()},
                        {a.row_ind.begin(), a.row_ind.end()},
                        {},
                        hermitian && a.storage == Storage::symmetric_lower ? Storage::hermitian_lower : a.storage};
  for (Index j = 0; j < a.cols; ++j)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(j)]; q < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++q) {
      const Index i = a.row_ind[static_cast<std::size_t>(q)];
      const Number left = turn(i), right = hermitian ? std::conj(turn(j)) : turn(j);
      c.values.push_back(a.values[static_cast<std::size_t>(q)] * (left * right));
    }
  return c;
}

}  // namespace espalier::reference
