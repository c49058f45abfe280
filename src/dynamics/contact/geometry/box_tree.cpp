#include "dynamics/contact/geometry/box_tree.hpp"

#include <algorithm>
#include <numeric>

namespace espalier::dynamics::contact {

void BoxTree::build(std::span<const Box> boxes) {
  nodes_.clear();
  nodes_.reserve(2 * boxes.size());
  order_.resize(boxes.size());
  std::iota(order_.begin(), order_.end(), 0);
  if (!boxes.empty()) split(boxes, order_);
  area_ = 0;
  for (const Node& node : nodes_) area_ += node.box.half_area();
}

Index BoxTree::split(std::span<const Box> boxes, std::span<Index> part) {
  const auto at = static_cast<Index>(nodes_.size());
  nodes_.emplace_back();
  Box box, middles;
  for (const Index i : part) {
    const Box& one = boxes[static_cast<std::size_t>(i)];
    box.add(one);
    middles.add(Eigen::Vector3d(0.5 * (one.low + one.high)));
  }
  Index left = part.front(), right = -1;
  if (part.size() > 1) {
    Eigen::Index axis = 0;
    (middles.high - middles.low).maxCoeff(&axis);
    const auto middle = [&](Index i) {
      const Box& one = boxes[static_cast<std::size_t>(i)];
      return one.low[axis] + one.high[axis];
    };
    const std::size_t half = part.size() / 2;
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(half), part.end(), [&](Index a, Index b) {
      const double x = middle(a), y = middle(b);
      return x < y || (x == y && a < b);
    });
    left = split(boxes, part.first(half));
    right = split(boxes, part.subspan(half));
  }
  nodes_[static_cast<std::size_t>(at)] = {box, left, right};
  return at;
}

void BoxTree::refit(std::span<const Box> boxes) {
  constexpr double kGrown = 2;  // queries then visit some twice as many nodes
  if (boxes.size() != order_.size()) return build(boxes);
  double area = 0;
  for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node) {
    if (node->leaf()) {
      node->box = boxes[static_cast<std::size_t>(node->left)];
    } else {
      node->box = nodes_[static_cast<std::size_t>(node->left)].box;
      node->box.add(nodes_[static_cast<std::size_t>(node->right)].box);
    }
    area += node->box.half_area();
  }
  if (area > kGrown * area_) build(boxes);
}

}  // namespace espalier::dynamics::contact
