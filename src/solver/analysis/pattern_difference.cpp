#include "solver/analysis/pattern_difference.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "base/at.hpp"
#include "base/lazy_vector.hpp"

namespace espalier::solver {

namespace {

using ChangedEntry = PatternDifference::Entry;

constexpr std::int64_t kColumnsTogether = 4096;  // per range

std::span<const Index> column_of(const MatrixView& a, Index c) {
  return a.row_ind.subspan(at(a.col_ptr[at(c)]), at(a.col_ptr[at(c) + 1] - a.col_ptr[at(c)]));
}

// What a range of columns comes to.
struct ChangedColumns {
  std::vector<ChangedEntry> added, removed;
  std::vector<Index> columns;
  std::vector<Offset> places;  // of the entries of these columns before, one after another, in the pattern of now
};

// Rows with their places in a column, ascending.
void sort_column(std::span<const Index> rows, Offset first, std::vector<std::pair<Index, Offset>>& sorted) {
  sorted.clear();
  for (const Index r : rows) sorted.emplace_back(r, first++);
  if (!std::is_sorted(sorted.begin(), sorted.end())) std::sort(sorted.begin(), sorted.end());
}

class ColumnComparison {
 public:
  ColumnComparison(const MatrixView& before, const MatrixView& now) : before_(before), now_(now) {}

  void compare(Index c, ChangedColumns& part) {
    const auto rows = column_of(before_, c);
    sort_column(rows, 0, was_);
    sort_column(column_of(now_, c), now_.col_ptr[at(c)], is_);
    part.columns.push_back(c);
    const std::size_t first = part.places.size();
    part.places.resize(first + rows.size());
    auto next = is_.begin();
    const auto come_before = [&](Index row) {
      for (; next != is_.end() && next->first < row; ++next) part.added.emplace_back(next->first, c);
    };
    for (const auto& [row, k] : was_) {
      come_before(row);
      const bool stays = next != is_.end() && next->first == row;
      part.places[first + at(k)] = stays ? next->second : -1;
      if (stays)
        ++next;
      else
        part.removed.emplace_back(row, c);
    }
    come_before(std::numeric_limits<Index>::max());
  }

 private:
  const MatrixView &before_, &now_;
  std::vector<std::pair<Index, Offset>> was_, is_;
};

void append(const MatrixView& before, const MatrixView& now, const ChangedColumns& part, PatternDifference& to) {
  to.added.insert(to.added.end(), part.added.begin(), part.added.end());
  to.removed.insert(to.removed.end(), part.removed.begin(), part.removed.end());
  to.columns.insert(to.columns.end(), part.columns.begin(), part.columns.end());
  std::span<const Offset> places = part.places;
  for (const Index c : part.columns) {
    const Offset begin = before.col_ptr[at(c)], end = before.col_ptr[at(c) + 1];
    to.now.list(begin, places.first(at(end - begin)));
    to.now.move(end, now.col_ptr[at(c) + 1] - end);
    places = places.subspan(at(end - begin));
  }
}

}  // namespace

PatternDifference compare_patterns(const MatrixView& before, const MatrixView& now, base::ThreadPool& pool) {
  std::vector<ChangedColumns> parts(at((now.cols + kColumnsTogether - 1) / kColumnsTogether));
  pool.for_each_range(now.cols, kColumnsTogether, [&](std::int64_t begin, std::int64_t end) {
    ChangedColumns& mine = parts[at(begin / kColumnsTogether)];
    ColumnComparison comparison(before, now);
    for (auto c = static_cast<Index>(begin); c < end; ++c) {
      const auto x = column_of(before, c), y = column_of(now, c);
      if (!std::equal(x.begin(), x.end(), y.begin(), y.end())) comparison.compare(c, mine);
    }
  });
  PatternDifference all;
  all.now.move(0, 0);
  for (const ChangedColumns& part : parts) append(before, now, part, all);
  all.now.close(before.nonzeros());
  return all;
}

namespace {

// Entries of the row index that have come: row, column, place.
struct NewEntry {
  Index row, col;
  Offset source;
};

std::vector<NewEntry> new_of_index(const MatrixView& a, const std::vector<ChangedEntry>& added) {
  std::vector<NewEntry> list;
  for (const auto& [row, col] : added) {
    if (a.storage != Storage::general && row == col) continue;
    const auto column = column_of(a, col);
    const auto place = std::find(column.begin(), column.end(), row) - column.begin();
    list.push_back({row, col, a.col_ptr[at(col)] + place});
  }
  std::sort(list.begin(), list.end(),
            [](const NewEntry& x, const NewEntry& y) { return x.row != y.row ? x.row < y.row : x.col < y.col; });
  return list;
}

// By how much the entries of each column have moved.
class ColumnMoves {
 public:
  static constexpr Offset kOneByOne = std::numeric_limits<Offset>::min();

  ColumnMoves(const MatrixView& before, const MatrixView& now, const PatternDifference& difference,
              base::ThreadPool& pool)
      : now_(difference.now), move_(at(now.cols)) {
    pool.for_each_range(now.cols, kColumnsTogether, [&](std::int64_t begin, std::int64_t end) {
      for (auto c = at(begin); c < at(end); ++c) move_[c] = now.col_ptr[c] - before.col_ptr[c];
    });
    for (const Index c : difference.columns) move_[at(c)] = kOneByOne;
  }
  // -1: the entry is gone.
  [[nodiscard]] Offset operator()(Index col, Offset source) const {
    const Offset move = move_[at(col)];
    return move != kOneByOne ? source + move : now_(source);
  }

 private:
  const plan::SourceMap& now_;
  base::LazyVector<Offset> move_;
};

}  // namespace

std::shared_ptr<const matrix::RowIndex> follow_rows(const matrix::RowIndex& was, const MatrixView& before,
                                                    const MatrixView& now, const PatternDifference& difference,
                                                    base::ThreadPool& pool) {
  auto made = std::make_shared<matrix::RowIndex>();
  if (was.ptr.empty()) return made;
  const std::vector<NewEntry> added = new_of_index(now, difference.added);
  std::vector<std::pair<Index, Offset>> more;  // rows that have others, ascending; entries won less lost, summed
  for (const NewEntry& e : added) more.emplace_back(e.row, 1);
  for (const auto& [row, col] : difference.removed)
    if (now.storage == Storage::general || row != col) more.emplace_back(row, -1);
  std::sort(more.begin(), more.end());
  for (std::size_t k = 1; k < more.size(); ++k) more[k].second += more[k - 1].second;
  made->ptr.resize(was.ptr.size());
  pool.for_each_range(static_cast<std::int64_t>(was.ptr.size()), kColumnsTogether,
                      [&](std::int64_t begin, std::int64_t end) {
                        auto next = std::lower_bound(more.begin(), more.end(), begin,
                                                     [](const auto& m, std::int64_t r) { return m.first < r; });
                        for (auto r = begin; r < end; ++r) {
                          for (; next != more.end() && next->first < r; ++next) {
                          }
                          made->ptr[at(r)] = was.ptr[at(r)] + (next == more.begin() ? 0 : std::prev(next)->second);
                        }
                      });
  made->col = base::Buffer<Index>(made->ptr.back(), nullptr);
  made->source = base::Buffer<Offset>(made->ptr.back(), nullptr);
  const ColumnMoves moves(before, now, difference, pool);
  pool.for_each_range(now.rows, kColumnsTogether, [&](std::int64_t begin, std::int64_t end) {
    auto next = std::lower_bound(added.begin(), added.end(), begin,
                                 [](const NewEntry& e, std::int64_t row) { return e.row < row; });
    for (auto r = at(begin); r < at(end); ++r) {
      Offset to = made->ptr[r];
      const auto append_entry = [&](Index col, Offset source) {
        made->col[to] = col;
        made->source[to++] = source;
      };
      const auto append_new_before = [&](Index end_col) {
        for (; next != added.end() && at(next->row) == r && next->col < end_col; ++next)
          append_entry(next->col, next->source);
      };
      const bool has_new = next != added.end() && at(next->row) == r;
      for (Offset q = was.ptr[r]; q < was.ptr[r + 1]; ++q) {
        const Index col = was.col[q];
        if (has_new) append_new_before(col);
        if (const Offset source = moves(col, was.source[q]); source >= 0) append_entry(col, source);
      }
      append_new_before(now.cols);
    }
  });
  return made;
}

}  // namespace espalier::solver
