#include "modes/components.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>
#include <unordered_map>

#include "base/at.hpp"
#include "base/mix.hpp"

namespace espalier::modes {

namespace {

constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15;  // mix(0) is 0

class Components {
 public:
  explicit Components(const SparseMatrix& a) : a_(a), of_(at(a.rows)), place_(at(a.rows)) {
    join();
    number();
  }

  [[nodiscard]] std::vector<char> first_of_equal() const {
    std::unordered_map<std::uint64_t, std::vector<Index>> firsts;  // by fingerprint
    const std::vector<std::uint64_t> prints = fingerprints();
    std::vector<char> keep(prints.size(), 1);
    for (Index c = 0; c < count(); ++c) {
      std::vector<Index>& known = firsts[prints[at(c)]];
      for (const Index first : known) keep[at(c)] = keep[at(c)] != 0 && !equal(first, c) ? 1 : 0;
      if (keep[at(c)] != 0) known.push_back(c);
    }
    std::vector<char> rows(of_.size());
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = keep[at(of_[i])];
    return rows;
  }

 private:
  [[nodiscard]] Index count() const { return static_cast<Index>(first_.size()) - 1; }
  [[nodiscard]] std::size_t begin(Index column) const { return static_cast<std::size_t>(a_.col_ptr[at(column)]); }
  [[nodiscard]] std::size_t end(Index column) const { return static_cast<std::size_t>(a_.col_ptr[at(column) + 1]); }

  Index root(Index i) {
    while (of_[at(i)] != i) i = of_[at(i)] = of_[at(of_[at(i)])];
    return i;
  }

  // of_ := the smallest row of the component (Tarjan 1975, with halved paths).
  void join() {
    std::iota(of_.begin(), of_.end(), 0);
    for (Index j = 0; j < a_.cols; ++j)
      for (std::size_t p = begin(j); p < end(j); ++p) {
        const Index i = root(a_.row_ind[p]), k = root(j);
        of_[at(std::max(i, k))] = std::min(i, k);
      }
    for (Index i = 0; i < a_.rows; ++i) of_[at(i)] = root(i);
  }

  // Components by their first rows, from 0; their rows one after the other.
  void number() {
    std::vector<Index> size;
    for (std::size_t i = 0; i < of_.size(); ++i) {
      const bool first = of_[i] == static_cast<Index>(i);
      of_[i] = first ? static_cast<Index>(size.size()) : of_[at(of_[i])];
      if (first) size.push_back(0);
      place_[i] = size[at(of_[i])]++;
    }
    first_.assign(size.size() + 1, 0);
    std::partial_sum(size.begin(), size.end(), first_.begin() + 1);
    rows_.resize(of_.size());
    for (std::size_t i = 0; i < of_.size(); ++i) rows_[at(first_[at(of_[i])] + place_[i])] = static_cast<Index>(i);
  }

  [[nodiscard]] std::vector<std::uint64_t> fingerprints() const {
    std::vector<std::uint64_t> prints(at(count()), 0);
    for (Index j = 0; j < a_.cols; ++j) {
      std::uint64_t& print = prints[at(of_[at(j)])];
      for (std::size_t p = begin(j); p < end(j); ++p) {
        const auto row = static_cast<std::uint64_t>(place_[at(a_.row_ind[p])]);
        print = base::mix(print + kStep + row) ^ std::bit_cast<std::uint64_t>(a_.values[p]);
      }
      print = base::mix(print + kStep);
    }
    return prints;
  }

  [[nodiscard]] bool equal(Index one, Index other) const {
    const Index size = first_[at(one) + 1] - first_[at(one)];
    if (first_[at(other) + 1] - first_[at(other)] != size) return false;
    for (Index k = 0; k < size; ++k) {
      const Index i = rows_[at(first_[at(one)] + k)], j = rows_[at(first_[at(other)] + k)];
      if (end(i) - begin(i) != end(j) - begin(j)) return false;
      for (std::size_t p = begin(i), q = begin(j); p < end(i); ++p, ++q)
        if (place_[at(a_.row_ind[p])] != place_[at(a_.row_ind[q])] || a_.values[p] != a_.values[q]) return false;
    }
    return true;
  }

  const SparseMatrix& a_;
  std::vector<Index> of_, place_;    // rows: component, place in it
  std::vector<Index> first_, rows_;  // by component, ascending
};

}  // namespace

std::vector<char> in_first_of_equal_components(const SparseMatrix& a) { return Components(a).first_of_equal(); }

}  // namespace espalier::modes
