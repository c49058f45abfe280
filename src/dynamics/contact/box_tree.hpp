/// \file
/// A binary tree of axis-parallel boxes that is refitted when the boxes move: the broad phase of contact.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
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
    return (low.array() <= other.high.array()).all() && (other.low.array() <= high.array()).all();
  }
  [[nodiscard]] bool holds(const Box& other) const {
    return (low.array() <= other.low.array()).all() && (other.high.array() <= high.array()).all();
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
  void query(const Box& box, const std::function<void(Index)>& found) const;
  /// The box around all of them.
  [[nodiscard]] Box all() const { return nodes_.empty() ? Box{} : nodes_.front().box; }

 private:
  struct Node {
    Box box;
    Index left = -1, right = -1;  // nodes; a leaf has the box `left` and no `right`
    [[nodiscard]] bool leaf() const { return right < 0; }
  };
  Index split(std::span<const Box> boxes, std::span<Index> part);

  std::vector<Node> nodes_;  // parents before their children
  std::vector<Index> order_;
  double area_ = 0;  // of all nodes, when the tree was made
};

}  // namespace espalier::dynamics::contact
