/// \file
/// The rows and columns around a factorized matrix, and the dense system that they leave.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "changes/base.hpp"
#include "changes/changed_matrix.hpp"
#include "dense/dense.hpp"

namespace espalier::changes {

/// Rows and columns of entities that the factor of the base does not hold, and unit vectors for those that it holds
/// and that are not alive: U and W, with Z = A^-1 U, which lies where the factor is.
template <class T>
class Border {
 public:
  using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;

  /// @param original  with the entries of A
  Border(const ChangedMatrix<T>& matrix, const Base<T>& original) : matrix_(&matrix), original_(&original) {}

  /// Brings the list up to date; new columns go through the factor together. @returns how many they were
  /// @param wanted  entities that must be here: those that the base has and that are not alive, and the other way round
  /// @post where it throws, the list is as it was
  Index update(Base<T>& base, const std::set<Index>& wanted);
  /// How many columns update() would make.
  [[nodiscard]] Index missing(const std::set<Index>& wanted) const {
    return static_cast<Index>(to_make(wanted).size());
  }
  /// Forgets all columns.
  void clear() { *this = Border(*matrix_, *original_); }

  struct Member {
    Index entity;
    bool slack;  ///< U and W are its unit vector, D is 0: its unknown becomes 0, and t takes up what is left of its row
    SparseVector<T> column, row;  ///< U and W of the entities that the base has
    bool active;
    std::shared_ptr<T[]> block;  ///< of A^-1 U, several columns
    Index place;                 ///< in the block
    bool refined = false;
    bool mirrors = false;  ///< W is U^T, or U^H of a Hermitian base

    /// The column of the border; that of the transposed system, if `turned`.
    [[nodiscard]] const SparseVector<T>& column_of(bool turned) const { return turned ? row : column; }
    [[nodiscard]] const SparseVector<T>& row_of(bool turned) const { return turned ? column : row; }
  };
  [[nodiscard]] const std::vector<Member>& members() const { return members_; }
  /// Numbers of active members, ascending: the order of all below.
  [[nodiscard]] const std::vector<Index>& active() const { return active_; }
  [[nodiscard]] const Member& member(std::size_t k) const { return members_[static_cast<std::size_t>(active_[k])]; }
  /// D, by active members.
  [[nodiscard]] T corner(std::size_t row, std::size_t column) const;
  /// S = D - W A^-1 U.
  [[nodiscard]] Matrix complement() const;

  /// The inertia of S. @pre it is symmetric, or Hermitian
  [[nodiscard]] Inertia inertia() const;

  /// Factorizes S. Where it is near to singular, columns that were not refined are first, so that what is left of S can
  /// be trusted. @returns false where S is singular to rounding
  [[nodiscard]] bool factorize(Base<T>& base);
  /// S T = R, or S^T T = R. @pre factorize()
  [[nodiscard]] Matrix solve(const Matrix& right, bool turned = false) const;
  /// W Y, or U^T Y, for vectors of the base's memory: active members by columns.
  [[nodiscard]] Matrix rows_times(const Base<T>& base, const T* y, Index columns, bool turned = false) const;
  /// y -= Z t there.
  void subtract(const Base<T>& base, const Matrix& t, T* y) const;

 private:
  [[nodiscard]] std::vector<Index> to_make(const std::set<Index>& wanted) const;
  [[nodiscard]] std::pair<std::shared_ptr<T[]>, Index> room_for(const Base<T>& base, Index columns);
  void make_columns(Base<T>& base, std::vector<Member>& made);
  [[nodiscard]] Member make(const Base<T>& base, Index entity) const;
  [[nodiscard]] bool factorize_once();
  void refine(Base<T>& base, std::vector<Member>& some);
  void take(const Base<T>& base, std::vector<Member> made);
  void keep_few();

  const ChangedMatrix<T>* matrix_;
  const Base<T>* original_;
  std::vector<Member> members_;  // some may wait for their entity to leave again
  std::vector<Index> active_;
  struct Block {
    std::shared_ptr<T[]> columns;
    Index used;
  };
  std::vector<Block> blocks_;  // of members, and free ones
  Matrix products_;            // W A^-1 U of all members
  bool checked_ = false;       // whether columns need refinement is known
  bool refines_ = false;       // all of them
  double smallest_ = 1;        // how near to singular S was when it was factorized
  Eigen::VectorXd row_, col_;  // powers of two that bring the rows and columns of S to about 1
  dense::LuOf<T> factor_;
};

}  // namespace espalier::changes
