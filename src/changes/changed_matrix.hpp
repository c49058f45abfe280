/// \file
/// What the changes of a matrix say, entry by entry, whatever the factor that stands for a part of it.
///
/// Rows and columns are numbered by *entities*: those of A first, then *items*, in the order in which they came: added
/// unknowns, those that replace others, and one for each rank of a change of low rank. Nothing is ever renumbered; an
/// entity that is removed or replaced is not alive.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::changes {

/// Numbers at some places, ascending, each once.
struct SparseVector {
  std::vector<Index> place;
  std::vector<double> value;

  [[nodiscard]] std::size_t size() const { return place.size(); }
  [[nodiscard]] double at(Index i) const;  ///< 0 where nothing stands
  void push(Index i, double v) {
    place.push_back(i);
    value.push_back(v);
  }
  /// Ascending from now on; numbers of one place are summed.
  void sort();
  friend bool operator==(const SparseVector&, const SparseVector&) = default;
};

/// A column and a row over earlier entities.
struct Item {
  SparseVector column, row;
  double corner = 0;       ///< its own entry
  bool auxiliary = false;  ///< of low rank: its unknown is -(row x) / corner, which is not 0
  [[nodiscard]] bool symmetric() const { return column == row; }
  /// The column of an item; that of the transposed matrix, if `turned`.
  [[nodiscard]] const SparseVector& column_of(bool turned) const { return turned ? row : column; }
  [[nodiscard]] const SparseVector& row_of(bool turned) const { return turned ? column : row; }
};

class ChangedMatrix {
 public:
  explicit ChangedMatrix(Index n);

  [[nodiscard]] Index n() const { return n_; }
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
  [[nodiscard]] const Item& item(Index entity) const { return items_[static_cast<std::size_t>(entity - n_)]; }
  /// The coupling of two entities of which one is an item, what stands in this row and column: the later one says it.
  [[nodiscard]] double coupling(Index row, Index column) const;

  /// An unknown with the next number. @param item  over entities
  void add(Item item);
  void add_auxiliary(Item item);
  /// Another row and column for an unknown. @pre alive
  void replace(Index unknown, Item item);
  void set_alive(Index unknown, bool alive) {
    alive_[static_cast<std::size_t>(entity_of(unknown))] = alive ? 1 : 0;
    touched_.push_back(entity_of(unknown));
  }
  /// Entities that came, went or came back since the last call; some more than once.
  [[nodiscard]] std::vector<Index> take_touched() { return std::exchange(touched_, {}); }

 private:
  Index n_;
  std::vector<Item> items_;
  std::vector<char> alive_;       // by entity
  std::vector<Index> entity_of_;  // by unknown
  std::vector<Index> touched_;
  bool plain_ = true;
};

}  // namespace espalier::changes
