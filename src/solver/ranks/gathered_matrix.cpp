#include "solver/ranks/gathered_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <type_traits>
#include <utility>

#include "matrix/triplets.hpp"
#include "matrix/validate.hpp"

namespace espalier::solver {

namespace {

// What one rank has, checked, and what all must say alike.
struct Head {
  std::int64_t n, storage, numbers, has_values, entries;
};

std::size_t doubles_in(base::Numbers numbers) { return static_cast<std::size_t>(base::parts_of(numbers)); }

void check_part(const GivenLocal<LocalEntries>& part) {
  const LocalEntries& a = part.a;
  const std::size_t values = a.values.size() / doubles_in(part.numbers);
  if (a.row.size() != a.col.size() || (values != 0 && values != a.row.size()))
    throw Error(StatusCode::invalid_input,
                fmt::format("{} rows, {} columns and {} values of entries: give as many of each", a.row.size(),
                            a.col.size(), values));
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

// All say alike whether there are values, of what sort, how large the matrix is, and what is stored.
std::vector<Head> exchange_heads(const GivenLocal<LocalEntries>& part, ranks::Communicator* link) {
  const LocalEntries& a = part.a;
  const Head mine{a.n, static_cast<std::int64_t>(a.storage), static_cast<std::int64_t>(part.numbers),
                  a.values.empty() ? 0 : 1, static_cast<std::int64_t>(a.row.size())};
  if (link == nullptr) return {mine};
  std::vector<Head> all;
  for (const auto& list : link->all_gather_of(std::span<const Head>(&mine, 1))) all.push_back(list.at(0));
  int first = -1;  // with entries, which says whether there are values
  for (std::size_t r = 0; r < all.size(); ++r) {
    const bool differs = all[r].n != all[0].n || all[r].storage != all[0].storage || all[r].numbers != all[0].numbers;
    if (all[r].entries > 0 && first < 0) first = static_cast<int>(r);
    const bool halves = all[r].entries > 0 && all[r].has_values != all[static_cast<std::size_t>(first)].has_values;
    if (differs || halves)
      throw Error(
          StatusCode::invalid_input,
          fmt::format("{} and {} disagree about {}", link->name_of(halves ? first : 0),
                      link->name_of(static_cast<int>(r)),
                      halves ? "whether there are values" : "the size of the matrix, its storage or its numbers"));
  }
  return all;
}

// By rank.
template <class T>
std::vector<std::vector<T>> gathered(std::span<const T> mine, ranks::Communicator* link) {
  if (link == nullptr) return {std::vector<T>(mine.begin(), mine.end())};
  return link->all_gather_of(mine);
}

// Rank after rank.
template <class T>
std::vector<T> concatenated(std::span<const T> mine, ranks::Communicator* link) {
  std::vector<T> all;
  for (const auto& part : gathered(mine, link)) all.insert(all.end(), part.begin(), part.end());
  return all;
}

template <class Check>
void on_all(ranks::Communicator* link, Check&& check) {
  if (link != nullptr)
    link->expect_all(check);
  else
    check();
}

std::span<const double> parts_of(std::span<const std::complex<double>> values) {
  return {reinterpret_cast<const double*>(values.data()), 2 * values.size()};
}

// The storage of a complex matrix as a GivenMatrix has it.
struct Symmetric {
  explicit Symmetric(Storage of_complex) {
    const MatrixView pattern = matrix::pattern_of(ComplexMatrixView{0, 0, {}, {}, {}, of_complex});
    storage = pattern.storage;
    numbers = storage == of_complex ? base::Numbers::complex : base::Numbers::hermitian;
  }
  Storage storage;
  base::Numbers numbers;
};

// Where entry (row, col) stands.
Offset place_of(const SparseMatrix& a, Index row, Index col) {
  const auto begin = a.row_ind.begin() + a.col_ptr[static_cast<std::size_t>(col)];
  const auto end = a.row_ind.begin() + a.col_ptr[static_cast<std::size_t>(col) + 1];
  return std::lower_bound(begin, end, row) - a.row_ind.begin();
}

}  // namespace

GivenLocal<LocalRows> given(const ComplexLocalRows& part) {
  const Symmetric symmetric(part.storage);
  return {{part.n, part.first_row, part.row_ptr, part.col, parts_of(part.values), symmetric.storage},
          symmetric.numbers};
}

GivenLocal<LocalEntries> given(const ComplexLocalEntries& part) {
  const Symmetric symmetric(part.storage);
  return {{part.n, part.row, part.col, parts_of(part.values), symmetric.storage}, symmetric.numbers};
}

// The values take the way that later ones will.
WholeMatrix GatheredMatrix::gather(const GivenLocal<LocalEntries>& part, ranks::Communicator* link,
                                   base::ThreadPool& pool) {
  const LocalEntries& mine = part.a;
  on_all(link, [&] { check_part(part); });
  const std::vector<Head> heads = exchange_heads(part, link);
  std::vector<Index> row = concatenated(mine.row, link), col = concatenated(mine.col, link);
  if (mine.storage == Storage::symmetric_upper) std::swap(row, col);
  const bool triangle = mine.storage == Storage::symmetric_lower || mine.storage == Storage::symmetric_upper;
  for (std::size_t k = 0; triangle && k < row.size(); ++k)
    if (row[k] < col[k]) std::swap(row[k], col[k]);
  WholeMatrix whole{
      matrix::to_csc({mine.n, mine.n, row, col, {}, triangle ? Storage::symmetric_lower : Storage::general}, &pool),
      part.numbers};
  if (!triangle) whole.a.storage = mine.storage;
  n_ = mine.n;
  numbers_ = part.numbers;
  part_entries_ = static_cast<Offset>(mine.row.size());
  nonzeros_ = whole.a.nonzeros();
  rows_ = {0, link == nullptr || link->rank() == 0 ? n_ : 0};
  turned_.clear();  // the whole has the lower triangle
  for (std::size_t k = 0; triangle && part.numbers == base::Numbers::hermitian && k < mine.row.size(); ++k)
    turned_.push_back(mine.row[k] < mine.col[k] ? 1 : 0);
  // The parts again, one after another.
  std::vector<std::span<const Index>> rows, cols;
  std::size_t at = 0;
  bool has_values = false;
  for (const Head& head : heads) {
    rows.emplace_back(row.data() + at, static_cast<std::size_t>(head.entries));
    cols.emplace_back(col.data() + at, static_cast<std::size_t>(head.entries));
    at += static_cast<std::size_t>(head.entries);
    has_values = has_values || head.has_values != 0;
  }
  plan_ways(whole.a, rows, cols, link == nullptr ? 0 : link->rank(), pool);
  if (has_values) whole.a.values = gather_values(own_slice(mine.values, link), link);
  return whole;
}

WholeMatrix GatheredMatrix::gather(const GivenLocal<LocalRows>& part, ranks::Communicator* link,
                                   base::ThreadPool& pool) {
  const LocalRows& mine = part.a;
  on_all(link, [&] { check_part(mine); });
  std::vector<Index> row(mine.col.size());
  for (Index r = 0; r < mine.rows(); ++r)
    std::fill(row.begin() + mine.row_ptr[static_cast<std::size_t>(r)],
              row.begin() + mine.row_ptr[static_cast<std::size_t>(r) + 1], mine.first_row + r);
  WholeMatrix whole =
      gather(GivenLocal<LocalEntries>({mine.n, row, mine.col, mine.values, mine.storage}, part.numbers), link, pool);
  rows_ = {mine.first_row, mine.rows()};
  return whole;
}

WholeMatrix GatheredMatrix::gather(const GivenMatrix& part, ranks::Communicator* link) {
  const MatrixView& mine = part.a;
  const bool here = link == nullptr || link->rank() == 0;
  const auto from_first = [&]<class T>(std::span<const T> its) {
    return concatenated(here ? its : std::span<const T>(), link);
  };
  const std::int64_t head[4] = {mine.rows, mine.cols, static_cast<std::int64_t>(mine.storage),
                                static_cast<std::int64_t>(part.numbers)};
  const std::vector<std::int64_t> heads = from_first(std::span<const std::int64_t>(head));
  WholeMatrix whole{{static_cast<Index>(heads.at(0)), static_cast<Index>(heads.at(1)), from_first(mine.col_ptr),
                     from_first(mine.row_ind), from_first(mine.values), static_cast<Storage>(heads.at(2))},
                    static_cast<base::Numbers>(heads.at(3))};
  n_ = whole.a.rows;
  numbers_ = whole.numbers;
  part_entries_ = here ? whole.a.nonzeros() : 0;
  nonzeros_ = whole.a.nonzeros();
  rows_ = {0, here ? n_ : 0};
  count_.clear();
  order_.clear();
  turned_.clear();
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

GatheredMatrix::Slice GatheredMatrix::own_slice(std::span<const double> part, ranks::Communicator* link) const {
  const std::size_t doubles = doubles_in(numbers_);
  on_all(link, [&] {
    if (part.size() / doubles != static_cast<std::size_t>(part_entries_) && part_entries_ > 0)
      throw Error(StatusCode::invalid_input, fmt::format("{} values for the {} entries of this rank's part",
                                                         part.size() / doubles, part_entries_));
  });
  part = part.first(doubles * static_cast<std::size_t>(part_entries_));
  if (count_.empty()) return {{part.begin(), part.end()}, 0};
  return base::with_numbers(numbers_, part.data(), [&](const auto* values) { return slice_of(values, link); });
}

template <class Value>
GatheredMatrix::Slice GatheredMatrix::slice_of(const Value* part, ranks::Communicator* link) const {
  constexpr std::size_t kParts = std::is_same_v<Value, double> ? 1 : 2;
  std::vector<Value> sorted;
  sorted.reserve(order_.size());
  for (const Offset k : order_) {
    const bool turned = !turned_.empty() && turned_[static_cast<std::size_t>(k)] != 0;
    sorted.push_back(turned ? base::conjugate(part[k]) : part[k]);
  }
  const auto me = static_cast<std::size_t>(link == nullptr ? 0 : link->rank());
  // -0.0 + x is x, also where that is -0.0.
  Slice slice{std::vector<double>(kParts * static_cast<std::size_t>(slice_begin(me + 1) - slice_begin(me)), -0.0),
              static_cast<Offset>(kParts) * slice_begin(me)};
  auto* sums = reinterpret_cast<Value*>(slice.values.data());
  const Offset* place = places_.data();
  const auto add = [&](const Value* values, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) sums[*place++] += values[k];
  };
  if (link == nullptr) {
    add(sorted.data(), sorted.size());
    return slice;
  }
  std::vector<std::span<const std::byte>> to;
  std::span<const Value> own;
  std::size_t at = 0;
  for (std::size_t r = 0; r < count_.size(); ++r) {
    const auto count = static_cast<std::size_t>(count_[r]);
    const std::span<const Value> values(sorted.data() + at, count);
    to.push_back(std::as_bytes(r == me ? std::span<const Value>() : values));
    if (r == me) own = values;
    at += count;
  }
  const auto all = link->all_to_all(to);
  for (std::size_t r = 0; r < all.size(); ++r)  // rank after rank, so that sums have one order
    if (r == me)
      add(own.data(), own.size());
    else  // a vector's memory begins where numbers may
      add(reinterpret_cast<const Value*>(all[r].data()), all[r].size() / sizeof(Value));
  return slice;
}

std::vector<double> GatheredMatrix::gather_values(const Slice& own, ranks::Communicator* link) {
  return concatenated(std::span<const double>(own.values), link);
}

std::vector<double> GatheredMatrix::gather_rows(std::span<const double> part, RowRange rows, Index columns,
                                                ranks::Communicator* link) const {
  const std::size_t doubles = doubles_in(numbers_);
  const auto size = [&](const RowRange& r) {
    return doubles * static_cast<std::size_t>(r.count) * static_cast<std::size_t>(columns);
  };
  on_all(link, [&] {
    if (rows.first < 0 || rows.count < 0 || rows.count > n_ - std::min(rows.first, n_))
      throw Error(StatusCode::invalid_input, fmt::format("rows {} to {} of vectors of {} rows", rows.first,
                                                         Offset{rows.first} + rows.count - 1, n_));
    if (part.size() < size(rows))
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} values for {} columns of {} rows", part.size() / doubles, columns, rows.count));
  });
  const std::int64_t mine[3] = {rows.first, rows.count, columns};
  std::vector<RowRange> ranges{rows};
  std::vector<std::vector<double>> pieces;
  if (link != nullptr) {
    ranges.clear();
    for (const auto& r : link->all_gather_of(std::span<const std::int64_t>(mine))) {
      ranges.push_back({static_cast<Index>(r.at(0)), static_cast<Index>(r.at(1))});
      if (r.at(2) != columns)
        throw Error(StatusCode::invalid_input, "the ranks give different numbers of right-hand sides");
    }
    pieces = link->all_gather_of(part.first(size(rows)));
  } else {
    pieces.emplace_back(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(size(rows)));
  }
  // One has all rows, as where rank 0 has the matrix.
  const auto has_rows = [](const RowRange& r) { return r.count > 0; };
  const auto owner = std::find_if(ranges.begin(), ranges.end(), has_rows);
  if (owner != ranges.end() && owner->count == n_ && std::count_if(ranges.begin(), ranges.end(), has_rows) == 1)
    return std::move(pieces[static_cast<std::size_t>(owner - ranges.begin())]);
  std::vector<double> whole(doubles * static_cast<std::size_t>(n_) * static_cast<std::size_t>(columns), 0.0);
  std::vector<char> given(static_cast<std::size_t>(n_), 0);
  for (std::size_t r = 0; r < pieces.size(); ++r) {
    const RowRange& range = ranges[r];
    for (Index i = 0; i < range.count; ++i) {
      const auto row = static_cast<std::size_t>(range.first + i);
      for (Index c = 0; c < columns; ++c) {
        const double* from = &pieces[r][doubles * static_cast<std::size_t>(Offset{c} * range.count + i)];
        double* to = &whole[doubles * (static_cast<std::size_t>(c) * static_cast<std::size_t>(n_) + row)];
        for (std::size_t k = 0; k < doubles; ++k) to[k] = given[row] != 0 ? to[k] + from[k] : from[k];
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
