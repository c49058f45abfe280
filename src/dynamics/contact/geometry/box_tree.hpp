/// \file
/// A binary tree of axis-parallel boxes that is refitted when the boxes move: the broad phase of contact.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <limits>
#include <span>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::dynamics::contact {

/// An axis-parallel box; empty as constructed.
struct Box {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  void add(const Eigen::Vector3d& x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  void add(const Box& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  void widen(double by) {
    low.array() -= by;
    high.array() += by;
  }
  [[nodiscard]] bool meets(const Box& other) const {
    return low[0] <= other.high[0] && other.low[0] <= high[0] && low[1] <= other.high[1] && other.low[1] <= high[1] &&
           low[2] <= other.high[2] && other.low[2] <= high[2];
  }
  [[nodiscard]] bool holds(const Box& other) const {
    return (low.array() <= other.low.array()).all() && (other.high.array() <= high.array()).all();
  }
  /// 0 within it; of an empty box infinite.
  [[nodiscard]] double distance_squared(const Eigen::Vector3d& x) const {
    return (low - x).cwiseMax(x - high).cwiseMax(0).squaredNorm();
  }
  [[nodiscard]] double half_area() const {
    const Eigen::Vector3d e = high - low;
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  }
};

/// Leaves hold one box each. Splits are made at the median of the longest edge, so the depth is log2 of the number.
class BoxTree {
 public:
  /// Makes the tree anew.
  void build(std::span<const Box> boxes);
  /// Takes moved boxes, as many as build() had. The tree is made anew once its boxes have grown too far.
  void refit(std::span<const Box> boxes);
  [[nodiscard]] Index size() const { return static_cast<Index>(order_.size()); }
  /// Calls found(i) for each box that meets `box`, in an order that depends on the tree.
  template <class Found>
  void query(const Box& box, const Found& found) const;
  /// Calls found(i) for each box within the distance `bound` of x, the nearer half first. found() may make `bound`
  /// smaller: what lies beyond it is not looked at any more.
  template <class Found>
  void nearest(const Eigen::Vector3d& x, const double& bound, const Found& found) const;
  /// The box around all of them.
  [[nodiscard]] Box all() const { return nodes_.empty() ? Box{} : nodes_.front().box; }

 private:
  struct Node {
    Box box;
    Index left = -1, right = -1;  // nodes; a leaf has the box `left` and no `right`
    [[nodiscard]] bool leaf() const { return right < 0; }
  };
  static constexpr std::size_t kStack = 128;  // the depth is at most 32
  Index split(std::span<const Box> boxes, std::span<Index> part);
  [[nodiscard]] const Node& node(Index n) const { return nodes_[static_cast<std::size_t>(n)]; }

  std::vector<Node> nodes_;  // parents before their children
  std::vector<Index> order_;
  double area_ = 0;  // of all nodes, when the tree was made
};

template <class Found>
void BoxTree::query(const Box& box, const Found& found) const {
  if (nodes_.empty()) return;
  std::array<Index, kStack> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const Node& at = node(stack[--top]);
    if (!at.box.meets(box)) continue;
    if (at.leaf()) {
      found(at.left);
    } else {
      stack[top++] = at.right;
      stack[top++] = at.left;
    }
  }
}

template <class Found>
void BoxTree::nearest(const Eigen::Vector3d& x, const double& bound, const Found& found) const {
  if (nodes_.empty()) return;
  struct Waiting {
    Index node;
    double squared;
  };
  std::array<Waiting, kStack> stack;
  std::size_t top = 0;
  stack[top++] = {0, nodes_.front().box.distance_squared(x)};
  while (top > 0) {
    const Waiting next = stack[--top];
    if (!(next.squared <= bound * bound)) continue;
    const Node& at = node(next.node);
    if (at.leaf()) {
      found(at.left);
      continue;
    }
    const Waiting left = {at.left, node(at.left).box.distance_squared(x)};
    const Waiting right = {at.right, node(at.right).box.distance_squared(x)};
    const bool left_first = left.squared <= right.squared;
    stack[top++] = left_first ? right : left;
    stack[top++] = left_first ? left : right;
  }
}

}  // namespace espalier::dynamics::contact
