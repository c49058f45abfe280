/// \file
/// Coordinate systems and grid points of Nastran: all in the basic system at last.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include "dynamics/mesh/mesh.hpp"
#include "dynamics/mesh/nastran_cards.hpp"

namespace espalier::dynamics {

/// CORD1R, CORD1C, CORD1S (by three grid points) and CORD2R, CORD2C, CORD2S (by the coordinates of three points); GRID
/// with GRDSET.
class NastranSystems {
 public:
  /// Takes the cards above. @return false where it is none of them
  bool take(const NastranCard& card, Mesh& mesh);
  /// Makes the coordinates of all nodes those of the basic system. @throws Error naming the card where a system or a
  /// point is not defined, or systems and points refer to one another in a circle or more than 64 deep
  void resolve(Mesh& mesh);
  /// Grid point -> node.
  [[nodiscard]] const std::unordered_map<std::int64_t, Index>& nodes() const { return index_; }
  /// The directions of a system's coordinates at a place, in the basic system; 0: the basic system itself.
  /// @throws Error naming the card where there is none, or at the axis of a system
  [[nodiscard]] std::array<Point, 3> axes(const NastranCard& card, std::int64_t id, const Point& at, Mesh& mesh);

 private:
  struct System {
    char kind = 'R';
    std::int64_t reference = 0;
    std::int64_t points[3] = {};  // CORD1: the origin, a point on z and one in the plane of x and z
    Point origin{}, on_z{}, in_xz{};
    NastranCard card;
    bool resolved = false;
    Point at{}, x{}, y{}, z{};
  };
  struct Pending {
    std::int64_t system, line;
    std::size_t file;  // in files_
  };
  void add_grid(const NastranCard& card, Mesh& mesh);
  void add_by_coordinates(const NastranCard& card);
  void add_by_points(const NastranCard& card);
  const System& system(std::int64_t id, const Pending& from, Mesh& mesh, int depth);
  Point basic(const Point& p, const Pending& from, Mesh& mesh, int depth);
  Point node(const NastranCard& card, std::int64_t label, Mesh& mesh, int depth);

  std::unordered_map<std::int64_t, Index> index_;
  std::unordered_map<Index, Pending> pending_;   // nodes whose coordinates are those of a system
  std::vector<Index> unstated_;                  // nodes whose system GRDSET says
  std::int64_t default_ = 0, default_line_ = 0;  // of GRDSET
  std::vector<std::string> files_;
  std::map<std::int64_t, System> systems_;
};

}  // namespace espalier::dynamics
