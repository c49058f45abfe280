/// \file
/// Stress on the drawn surface of beams, cables and shells, for colours.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/model/fields/measure.hpp"
#include "dynamics/page/drawn.hpp"

namespace espalier::dynamics::model {
class FieldQuantity;
}

namespace espalier::dynamics::page {

/// The stress of shells what BODY[node ... top] and bottom say; of beams and cables the largest of the outline of the
/// section, all around it, linear between nodes. Bodies whose section is given by its constants have none.
class ThinStress {
 public:
  ThinStress(const model::Mechanism& mechanism, const Drawn& drawn);
  [[nodiscard]] bool empty() const { return bodies_.empty(); }
  /// What has to be kept of a state until add_to().
  [[nodiscard]] std::vector<double> keep(const State& s) const;
  /// Sets the points of its bodies; others are NaN where the arrays are empty, and else stay. May run beside the
  /// simulation. @param von_mises, principal  of all points of flexible bodies; or empty
  void add_to(const std::vector<double>& kept, std::vector<double>& von_mises, std::vector<double>& principal) const;

 private:
  struct Body {
    std::shared_ptr<const model::FieldQuantity> numbers;
    std::shared_ptr<const model::Sites> sites;
    std::vector<model::Measure> von_mises, extremes;  // of lines without the former: what it is made of
    bool shell = false;
    std::size_t first = 0, points = 0;  // among those of flexible bodies
    std::size_t around = 1;             // points of a section
  };
  const model::Mechanism& mechanism_;
  std::vector<Body> bodies_;
  std::size_t points_ = 0;
};

}  // namespace espalier::dynamics::page
