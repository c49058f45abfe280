/// \file
/// What the changes of a matrix say, entry by entry, whatever the factor that stands for a part of it.
///
/// Rows and columns are numbered by *entities*: those of A first, then *items*, in the order in which they came: added
/// unknowns, those that replace others, and one for each rank of a change of low rank. Nothing is ever renumbered; an
/// entity that is removed or replaced is not alive. T: double or std::complex<double>.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "base/scalar.hpp"
#include "espalier/types.hpp"

namespace espalier::changes {

/// Numbers at some places, ascending, each once.
template <class T>
struct SparseVector {
  std::vector<Index> place;
  std::vector<T> value;

  [[nodiscard]] std::size_t size() const { return place.size(); }
  [[nodiscard]] T at(Index i) const;  ///< 0 where nothing stands
  void push(Index i, T v) {
    place.push_back(i);
    value.push_back(v);
  }
  /// Ascending from now on; numbers of one place are summed.
  void sort();
  /// The row that goes with this column in a symmetric matrix; of a Hermitian one the conjugate.
  [[nodiscard]] SparseVector mirrored(bool hermitian) const {
    SparseVector row = *this;
    for (T& v : row.value) v = hermitian ? base::conjugate(v) : v;
    return row;
  }
  friend bool operator==(const SparseVector&, const SparseVector&) = default;
};

/// A column and a row over earlier entities.
template <class T>
struct Item {
  SparseVector<T> column, row;
  T corner = 0;            ///< its own entry
  bool auxiliary = false;  ///< of low rank: its unknown is -(row x) / corner, which is not 0
  [[nodiscard]] bool symmetric(bool hermitian) const {
    return hermitian ? row == column.mirrored(true) && corner == base::conjugate(corner) : row == column;
  }
  /// The column of an item; that of the transposed matrix, if `turned`.
  [[nodiscard]] const SparseVector<T>& column_of(bool turned) const { return turned ? row : column; }
  [[nodiscard]] const SparseVector<T>& row_of(bool turned) const { return turned ? column : row; }
};

template <class T>
class ChangedMatrix {
 public:
  /// @param hermitian  what is called symmetric is Hermitian
  explicit ChangedMatrix(Index n, bool hermitian);

  [[nodiscard]] Index n() const { return n_; }
  [[nodiscard]] bool hermitian() const { return hermitian_; }
  /// Whether all items that are alive are symmetric.
  [[nodiscard]] bool items_are_symmetric() const;
  [[nodiscard]] Index entities() const { return static_cast<Index>(alive_.size()); }
  /// Unknowns of the caller: n, and those that were added.
  [[nodiscard]] Index unknowns() const { return static_cast<Index>(entity_of_.size()); }
  [[nodiscard]] Index entity_of(Index unknown) const { return entity_of_[static_cast<std::size_t>(unknown)]; }
  /// Whether each unknown's entity has its number.
  [[nodiscard]] bool plain() const { return plain_; }
  [[nodiscard]] bool alive(Index entity) const { return alive_[static_cast<std::size_t>(entity)] != 0; }
  [[nodiscard]] bool auxiliary(Index entity) const { return entity >= n_ && item(entity).auxiliary; }
  /// Alive, and an unknown of the caller.
  [[nodiscard]] bool counts(Index entity) const { return alive(entity) && !auxiliary(entity); }
  /// @pre entity >= n()
  [[nodiscard]] const Item<T>& item(Index entity) const { return items_[static_cast<std::size_t>(entity - n_)]; }
  /// The coupling of two entities of which one is an item, what stands in this row and column: the later one says it.
  [[nodiscard]] T coupling(Index row, Index column) const;

  /// An unknown with the next number. @param item  over entities
  void add(Item<T> item);
  void add_auxiliary(Item<T> item);
  /// Another row and column for an unknown. @pre alive
  void replace(Index unknown, Item<T> item);
  void set_alive(Index unknown, bool alive) {
    alive_[static_cast<std::size_t>(entity_of(unknown))] = alive ? 1 : 0;
    touched_.push_back(entity_of(unknown));
  }
  /// Entities that came, went or came back since the last call; some more than once.
  [[nodiscard]] std::vector<Index> take_touched() { return std::exchange(touched_, {}); }

 private:
  Index n_;
  bool hermitian_;
  std::vector<Item<T>> items_;
  std::vector<char> alive_;       // by entity
  std::vector<Index> entity_of_;  // by unknown
  std::vector<Index> touched_;
  bool plain_ = true;
};

}  // namespace espalier::changes

/// Applies a macro to each sort of numbers of a caller's matrix: for explicit instantiations.
#define ESPALIER_FOR_NUMBERS(apply) apply(double) apply(std::complex<double>)
