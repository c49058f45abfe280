/// \file
/// What the readers of text formats share: raw entries, and how they become a matrix.
#pragma once

#include <functional>
#include <string>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "matrix/text.hpp"

namespace espalier::matrix {

/// What a reader may be asked for.
struct ReadOptions {
  base::ThreadPool* pool = nullptr;  ///< who parses; null: a pool of all cores is made for texts of 8 MiB and more
  bool keep_pattern = false;         ///< a pattern file gives a matrix without values; otherwise every value is 1
  std::function<void(const std::string&)> notice = nullptr;  ///< hears what is read otherwise than it stands
};

/// What a file declares about its entries.
enum class Symmetry { general, symmetric, skew, hermitian };

/// The entries of a file in its own order, 0-based, checked to lie inside the matrix; repeats are kept.
struct RawEntries {
  Index rows = 0;
  Index cols = 0;
  Symmetry symmetry = Symmetry::general;
  Offset count = 0;                ///< entries in use at the front of the buffers
  base::Buffer<Index> row;         ///< count or more
  base::Buffer<Index> col;         ///< count or more
  base::Buffer<double> value;      ///< count or more, or none for a pattern
  base::Buffer<double> imaginary;  ///< likewise; none for real values
  bool below = false;              ///< some entry stands below the diagonal
  bool above = false;              ///< some entry stands above the diagonal
};

/// Assembles the matrix: general entries to Storage::general, symmetric ones to symmetric_lower, skew ones expanded to
/// general. Repeated entries are summed (of a pattern: taken once). Entries of a symmetric file above the diagonal are
/// mirrored below it. Where a symmetric or skew file holds both (i, j) and (j, i), which the formats forbid, the entry
/// is taken once if the values agree, which options.notice hears, and is an error otherwise.
/// @param locate the place of the k-th entry in source.text, for messages
SparseMatrix assemble_entries(const RawEntries& raw, const ReadOptions& options, const Source& source,
                              const std::function<const char*(Offset k)>& locate);

/// The same with both parts of the values; Hermitian entries to hermitian_lower.
/// @pre raw has values and imaginary parts
ComplexSparseMatrix assemble_complex_entries(RawEntries raw, const ReadOptions& options, const Source& source,
                                             const std::function<const char*(Offset k)>& locate);

/// Refuses sizes that the index types cannot hold, and so many empty columns that a file of a few bytes would make us
/// take gigabytes: beyond 4 million, rows and columns may number at most 16 times the entries.
/// @param position of the sizes in source.text
void check_sizes(std::int64_t rows, std::int64_t cols, std::int64_t entries, const Source& source,
                 const char* position);

}  // namespace espalier::matrix
