/// \file
/// The tangent of what acts between frames.
#pragma once

#include <cstdint>
#include <vector>

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// What a joint or a force adds to W. In the coordinates of the bodies it is J^T w, with J the Jacobians of its frames
/// (6 rows each) and w their wrenches, and
///   d(J^T w) = [J^T (k J + d d(J v)/dq) + d(J^T w)/dq at constant w] dq
/// where k and d are the derivatives of w by increments and by twists. A frame on a face of a solid couples all its
/// nodes, so these blocks may be most of W: they are made column by column, on many threads, from a few numbers.
class FrameBlocks {
 public:
  /// Which pairs of coordinates are coupled; the default: all.
  struct Coupling {
    bool turning_only = false;      ///< coordinates that turn their frames alone; see Frame::turns()
    bool between_rotations = true;  ///< the wrenches depend on rotations; else, with turning_only, J alone does
  };

  static constexpr int kMostFrames = 12;

  FrameBlocks() = default;
  /// @param frames  at most kMostFrames; they outlive the object
  FrameBlocks(std::vector<const Frame*> frames, Coupling coupling);
  /// The entries of W. Valid after the bodies were placed.
  void declare(PatternBuilder& w) const;
  /// Looks their positions up. @param pool  null: the calling thread alone
  void bind(const SparsePattern& w, base::ThreadPool* pool);

  struct Derivatives {
    static constexpr int kMost = 6 * kMostFrames;                                            // nothing is allocated
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMost, kMost> k;  ///< 6 F x 6 F of F frames
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMost, kMost> d;  ///< the same; empty: zero
    Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMost, 1> wrench;  ///< 6 F: the w of d(J^T w)/dq
  };
  /// Adds the tangent; a factor is to be in the derivatives already. @param v  empty if d is
  /// The bits do not depend on the pool.
  void add(ConstSpan q, ConstSpan v, const Derivatives& derivatives, base::ThreadPool* pool, Span w_values) const;

 private:
  /// The coordinates of a frame that take part.
  struct Side {
    std::vector<std::size_t> local;  // numbers in the frame's list
    std::size_t step = 1;            // of so many coordinates in a row the first one's position is stored
    bool distinct = true;            // no coordinate stands in the list twice
  };
  /// The blocks in the columns of one frame.
  struct Columns {
    std::vector<Offset> start;        // of each coordinate's column in W; -1: none
    std::vector<std::size_t> offset;  // of each frame's rows in a column's positions
    std::size_t rows = 0;             // positions of a column
    std::vector<std::int32_t> shift;  // rows x columns, from the start of the column; -1: none
  };
  struct Product;
  [[nodiscard]] bool coupled(std::size_t f, std::size_t g) const;
  [[nodiscard]] Side side_of(const Frame& frame) const;
  void bind_columns(const SparsePattern& w, std::size_t g, base::ThreadPool* pool);
  void add_columns(const Product& product, std::size_t first, std::size_t count, Span w_values) const;

  std::vector<const Frame*> frames_;
  Coupling coupling_;
  std::vector<Side> sides_;       // frames
  std::vector<Columns> columns_;  // frames
};

}  // namespace espalier::dynamics
