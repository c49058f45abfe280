/// \file
/// All bodies as the page draws them: flexible ones by the points of their surfaces, rigid ones by their places.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/page/skin.hpp"

namespace espalier::dynamics::page {

class Drawn {
 public:
  explicit Drawn(const model::Mechanism& mechanism);

  struct Body {
    std::string name, kind;
    bool rigid = false;          ///< its points turn with it; else each has its own place
    Index first = 0, count = 0;  ///< its points, numbered over all bodies
    bool coarse = false;
  };
  [[nodiscard]] const std::vector<Body>& bodies() const { return bodies_; }
  [[nodiscard]] const std::vector<std::array<Index, 3>>& triangles() const { return triangles_; }
  /// Whose a triangle is where elements can fail; body -1: of none of them. One for each triangle.
  struct Owner {
    Index body = -1, element = -1, behind = -1;
  };
  [[nodiscard]] const std::vector<Owner>& owners() const { return owners_; }
  [[nodiscard]] const std::vector<std::array<Index, 2>>& edges() const { return edges_; }
  [[nodiscard]] const std::vector<std::int64_t>& labels() const { return labels_; }  ///< of nodes; 0: none
  /// The points of the rigid bodies, one after the other, in their axes: 3 numbers for each point.
  [[nodiscard]] const std::vector<float>& local() const { return local_; }

  /// One state.
  struct Place {
    std::vector<double> points, rates;  ///< 3 for each point of flexible bodies
    /// 3, 4 (x, y, z, w), 3 and 3 for each rigid body and point mass.
    std::vector<double> positions, quaternions, velocities, turning;
  };
  void place(const State& s, Place& out);
  /// Where all points are, flexible or not: 3 each.
  [[nodiscard]] std::vector<double> all_points(const Place& at) const;

 private:
  void add_rigid(const model::BuiltBody& body);
  void add_face(const std::vector<Index>& face);

  const model::Mechanism& mechanism_;
  std::vector<Body> bodies_;
  std::vector<std::unique_ptr<Skin>> skins_;  // of each body; null: rigid
  std::vector<std::array<Index, 3>> triangles_;
  std::vector<Owner> owners_;
  std::vector<std::array<Index, 2>> edges_;
  std::vector<std::int64_t> labels_;
  std::vector<float> local_;
  std::vector<double> position_, rate_;  // of the nodes of a reduced body

 public:
  [[nodiscard]] const std::vector<std::unique_ptr<Skin>>& skins() const { return skins_; }
};

}  // namespace espalier::dynamics::page
