#include "solver/gathered_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "matrix/triplets.hpp"

namespace espalier::solver {

namespace {

// What one rank has, checked, and what all must say alike.
struct Head {
  std::int64_t n, storage, has_values, entries;
};

void check_part(const LocalEntries& a) {
  if (a.row.size() != a.col.size() || (!a.values.empty() && a.values.size() != a.row.size()))
    throw Error(StatusCode::invalid_input,
                fmt::format("{} rows, {} columns and {} values of entries: give as many of each", a.row.size(),
                            a.col.size(), a.values.size()));
  for (std::size_t k = 0; k < a.row.size(); ++k)
    if (a.row[k] < 0 || a.row[k] >= a.n || a.col[k] < 0 || a.col[k] >= a.n)
      throw Error(StatusCode::invalid_input,
                  fmt::format("entry {} is at ({}, {}) of a matrix of {} rows and columns (0-based)", k, a.row[k],
                              a.col[k], a.n));
}

void check_part(const LocalRows& a) {
  const auto bad = [](std::string_view what) { throw Error(StatusCode::invalid_input, std::string(what)); };
  if (a.first_row < 0 || a.first_row > a.n || a.rows() > a.n - a.first_row)
    throw Error(StatusCode::invalid_input, fmt::format("rows {} to {} of a matrix of {} rows", a.first_row,
                                                       Offset{a.first_row} + a.rows() - 1, a.n));
  if (a.row_ptr.empty()) {
    if (!a.col.empty()) bad("there are columns, but no pointers to rows");
    return;
  }
  if (a.row_ptr.front() != 0) bad("the pointers to rows do not begin with 0");
  for (std::size_t r = 1; r < a.row_ptr.size(); ++r)
    if (a.row_ptr[r] < a.row_ptr[r - 1]) bad(fmt::format("the pointers to rows fall at row {} of this part", r - 1));
  if (static_cast<std::size_t>(a.row_ptr.back()) != a.col.size())
    bad("the last pointer to rows is not the number of entries");
}

// All say alike whether there are values, how large the matrix is, and what is stored.
std::vector<Head> exchange_heads(const LocalEntries& a, ranks::Link* link) {
  const Head mine{a.n, static_cast<std::int64_t>(a.storage), a.values.empty() ? 0 : 1,
                  static_cast<std::int64_t>(a.row.size())};
  if (link == nullptr) return {mine};
  std::vector<Head> all;
  for (const auto& list : link->all_gather_of(std::span<const Head>(&mine, 1))) all.push_back(list.at(0));
  int first = -1;  // with entries, which says whether there are values
  for (std::size_t r = 0; r < all.size(); ++r) {
    const bool differs = all[r].n != all[0].n || all[r].storage != all[0].storage;
    if (all[r].entries > 0 && first < 0) first = static_cast<int>(r);
    const bool halves = all[r].entries > 0 && all[r].has_values != all[static_cast<std::size_t>(first)].has_values;
    if (differs || halves)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} and {} disagree about {}", link->name_of(halves ? first : 0),
                              link->name_of(static_cast<int>(r)),
                              halves ? "whether there are values" : "the size of the matrix or its storage"));
  }
  return all;
}

// By rank.
template <class T>
std::vector<std::vector<T>> gathered(std::span<const T> mine, ranks::Link* link) {
  if (link == nullptr) return {std::vector<T>(mine.begin(), mine.end())};
  return link->all_gather_of(mine);
}

// Rank after rank.
template <class T>
std::vector<T> concatenated(std::span<const T> mine, ranks::Link* link) {
  std::vector<T> all;
  for (const auto& part : gathered(mine, link)) all.insert(all.end(), part.begin(), part.end());
  return all;
}

template <class Check>
void on_all(ranks::Link* link, Check&& check) {
  if (link != nullptr)
    link->expect_all(check);
  else
    check();
}

// Where entry (row, col) stands.
Offset place_of(const SparseMatrix& a, Index row, Index col) {
  const auto begin = a.row_ind.begin() + a.col_ptr[static_cast<std::size_t>(col)];
  const auto end = a.row_ind.begin() + a.col_ptr[static_cast<std::size_t>(col) + 1];
  return std::lower_bound(begin, end, row) - a.row_ind.begin();
}

}  // namespace

SparseMatrix GatheredMatrix::gather(const LocalEntries& part, ranks::Link* link, base::ThreadPool& pool) {
  on_all(link, [&] { check_part(part); });
  const std::vector<Head> heads = exchange_heads(part, link);
  std::vector<Index> row = concatenated(part.row, link), col = concatenated(part.col, link);
  const std::vector<double> values = concatenated(part.values, link);
  if (part.storage == Storage::symmetric_upper) std::swap(row, col);
  const bool triangle = part.storage == Storage::symmetric_lower || part.storage == Storage::symmetric_upper;
  for (std::size_t k = 0; triangle && k < row.size(); ++k)
    if (row[k] < col[k]) std::swap(row[k], col[k]);
  SparseMatrix whole =
      matrix::to_csc({part.n, part.n, row, col, values, triangle ? Storage::symmetric_lower : Storage::general}, &pool);
  if (!triangle) whole.storage = part.storage;
  n_ = part.n;
  part_entries_ = static_cast<Offset>(part.row.size());
  nonzeros_ = whole.nonzeros();
  rows_ = {0, link == nullptr || link->rank() == 0 ? n_ : 0};
  // The parts again, one after another.
  std::vector<std::span<const Index>> rows, cols;
  std::size_t at = 0;
  for (const Head& head : heads) {
    rows.emplace_back(row.data() + at, static_cast<std::size_t>(head.entries));
    cols.emplace_back(col.data() + at, static_cast<std::size_t>(head.entries));
    at += static_cast<std::size_t>(head.entries);
  }
  plan_ways(whole, rows, cols, link == nullptr ? 0 : link->rank(), pool);
  return whole;
}

SparseMatrix GatheredMatrix::gather(const LocalRows& part, ranks::Link* link, base::ThreadPool& pool) {
  on_all(link, [&] { check_part(part); });
  std::vector<Index> row(part.col.size());
  for (Index r = 0; r < part.rows(); ++r)
    std::fill(row.begin() + part.row_ptr[static_cast<std::size_t>(r)],
              row.begin() + part.row_ptr[static_cast<std::size_t>(r) + 1], part.first_row + r);
  SparseMatrix whole = gather(LocalEntries{part.n, row, part.col, part.values, part.storage}, link, pool);
  rows_ = {part.first_row, part.rows()};
  return whole;
}

SparseMatrix GatheredMatrix::gather(const MatrixView& part, ranks::Link* link) {
  const bool here = link == nullptr || link->rank() == 0;
  const auto from_first = [&]<class T>(std::span<const T> mine) {
    return concatenated(here ? mine : std::span<const T>(), link);
  };
  const std::int64_t head[3] = {part.rows, part.cols, static_cast<std::int64_t>(part.storage)};
  const std::vector<std::int64_t> heads = from_first(std::span<const std::int64_t>(head));
  SparseMatrix whole{static_cast<Index>(heads.at(0)), static_cast<Index>(heads.at(1)),
                     from_first(part.col_ptr),        from_first(part.row_ind),
                     from_first(part.values),         static_cast<Storage>(heads.at(2))};
  n_ = whole.rows;
  part_entries_ = here ? whole.nonzeros() : 0;
  nonzeros_ = whole.nonzeros();
  rows_ = {0, here ? n_ : 0};
  count_.clear();
  order_.clear();
  places_.clear();
  return whole;
}

// The first entry of a rank's slice.
Offset GatheredMatrix::slice_begin(std::size_t rank) const {
  const auto ranks = static_cast<Offset>(count_.size());
  return nonzeros_ / ranks * static_cast<Offset>(rank) + std::min(nonzeros_ % ranks, static_cast<Offset>(rank));
}

void GatheredMatrix::plan_ways(const SparseMatrix& whole, std::span<const std::span<const Index>> row,
                               std::span<const std::span<const Index>> col, int rank, base::ThreadPool& pool) {
  constexpr std::int64_t kRange = 1 << 14;
  const auto me = static_cast<std::size_t>(rank);
  count_.assign(row.size(), 0);
  places_.clear();
  std::vector<Offset> places;
  for (std::size_t r = 0; r < row.size(); ++r) {
    places.resize(row[r].size());
    pool.for_each_range(static_cast<std::int64_t>(places.size()), kRange, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k)
        places[k] = place_of(whole, row[r][k], col[r][k]);
    });
    for (const Offset place : places)
      if (place >= slice_begin(me) && place < slice_begin(me + 1)) places_.push_back(place - slice_begin(me));
    if (r != me) continue;
    std::vector<std::vector<Offset>> entries(row.size());  // by slice
    for (std::size_t k = 0; k < places.size(); ++k) {
      std::size_t slice = 0;
      while (places[k] >= slice_begin(slice + 1)) ++slice;
      entries[slice].push_back(static_cast<Offset>(k));
    }
    order_.clear();
    for (std::size_t slice = 0; slice < entries.size(); ++slice) {
      count_[slice] = static_cast<Offset>(entries[slice].size());
      order_.insert(order_.end(), entries[slice].begin(), entries[slice].end());
    }
  }
}

GatheredMatrix::Slice GatheredMatrix::own_slice(std::span<const double> part, ranks::Link* link) const {
  on_all(link, [&] {
    if (static_cast<Offset>(part.size()) != part_entries_ && part_entries_ > 0)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} values for the {} entries of this rank's part", part.size(), part_entries_));
  });
  part = part.first(static_cast<std::size_t>(part_entries_));
  if (count_.empty()) return {{part.begin(), part.end()}, 0};
  std::vector<double> sorted;
  sorted.reserve(order_.size());
  for (const Offset k : order_) sorted.push_back(part[static_cast<std::size_t>(k)]);
  const auto me = static_cast<std::size_t>(link == nullptr ? 0 : link->rank());
  std::vector<double> slice(static_cast<std::size_t>(slice_begin(me + 1) - slice_begin(me)), 0.0);
  const Offset* place = places_.data();
  const auto add = [&](const double* values, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) slice[static_cast<std::size_t>(*place++)] += values[k];
  };
  if (link == nullptr) {
    add(sorted.data(), sorted.size());
    return {std::move(slice), 0};
  }
  std::vector<std::span<const std::byte>> to;
  std::span<const double> own;
  std::size_t at = 0;
  for (std::size_t r = 0; r < count_.size(); ++r) {
    const auto count = static_cast<std::size_t>(count_[r]);
    const std::span<const double> values(sorted.data() + at, count);
    to.push_back(std::as_bytes(r == me ? std::span<const double>() : values));
    if (r == me) own = values;
    at += count;
  }
  const auto all = link->all_to_all(to);
  for (std::size_t r = 0; r < all.size(); ++r)  // rank after rank, so that sums have one order
    if (r == me)
      add(own.data(), own.size());
    else  // a vector's memory begins where doubles may
      add(reinterpret_cast<const double*>(all[r].data()), all[r].size() / sizeof(double));
  return {std::move(slice), slice_begin(me)};
}

std::vector<double> GatheredMatrix::gather_values(std::span<const double> part, ranks::Link* link) const {
  Slice own = own_slice(part, link);
  return link == nullptr ? std::move(own.values) : concatenated(std::span<const double>(own.values), link);
}

std::vector<double> GatheredMatrix::gather_rows(std::span<const double> part, RowRange rows, Index columns,
                                                ranks::Link* link) const {
  const auto size = [&](const RowRange& r) {
    return static_cast<std::size_t>(r.count) * static_cast<std::size_t>(columns);
  };
  on_all(link, [&] {
    if (rows.first < 0 || rows.count < 0 || rows.count > n_ - std::min(rows.first, n_))
      throw Error(StatusCode::invalid_input, fmt::format("rows {} to {} of vectors of {} rows", rows.first,
                                                         Offset{rows.first} + rows.count - 1, n_));
    if (part.size() < size(rows))
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} values for {} columns of {} rows", part.size(), columns, rows.count));
  });
  const std::int64_t mine[3] = {rows.first, rows.count, columns};
  std::vector<RowRange> ranges{rows};
  std::vector<std::vector<double>> parts;
  if (link != nullptr) {
    ranges.clear();
    for (const auto& r : link->all_gather_of(std::span<const std::int64_t>(mine))) {
      ranges.push_back({static_cast<Index>(r.at(0)), static_cast<Index>(r.at(1))});
      if (r.at(2) != columns)
        throw Error(StatusCode::invalid_input, "the ranks give different numbers of right-hand sides");
    }
    parts = link->all_gather_of(part.first(size(rows)));
  } else {
    parts.emplace_back(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(size(rows)));
  }
  // One has all rows, as where rank 0 has the matrix.
  const auto has_rows = [](const RowRange& r) { return r.count > 0; };
  const auto owner = std::find_if(ranges.begin(), ranges.end(), has_rows);
  if (owner != ranges.end() && owner->count == n_ && std::count_if(ranges.begin(), ranges.end(), has_rows) == 1)
    return std::move(parts[static_cast<std::size_t>(owner - ranges.begin())]);
  std::vector<double> whole(static_cast<std::size_t>(n_) * static_cast<std::size_t>(columns), 0.0);
  std::vector<char> given(static_cast<std::size_t>(n_), 0);
  for (std::size_t r = 0; r < parts.size(); ++r) {
    const RowRange& range = ranges[r];
    for (Index i = 0; i < range.count; ++i) {
      const auto row = static_cast<std::size_t>(range.first + i);
      for (Index c = 0; c < columns; ++c) {
        const double v = parts[r][static_cast<std::size_t>(Offset{c} * range.count + i)];
        double& to = whole[static_cast<std::size_t>(c) * static_cast<std::size_t>(n_) + row];
        to = given[row] != 0 ? to + v : v;
      }
      given[row] = 1;
    }
  }
  const auto missing = std::find(given.begin(), given.end(), 0) - given.begin();
  if (missing < n_)
    throw Error(StatusCode::invalid_input, fmt::format("no rank gives row {} of the right-hand side", missing),
                static_cast<Index>(missing));
  return whole;
}

}  // namespace espalier::solver
