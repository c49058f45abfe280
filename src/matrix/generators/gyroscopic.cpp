#include "matrix/generators/families.hpp"
#include "matrix/generators/hex8.hpp"

namespace espalier::matrix {

namespace {

constexpr double kSpin = 0.8;  // factor of the mass between x and y

class Gyroscopic final : public GroupModel {
 public:
  Gyroscopic(HexGrid grid, Randomness random)
      : grid_(grid),
        clamped_((grid.ny + 1) * (grid.nz + 1)),
        elastic_(make_clamped_box(grid, 1.0, random)),
        mass_(hex8_mass(hex_box(1, 1, 1))) {}

  [[nodiscard]] Index groups() const override { return elastic_->groups(); }
  void neighbours(Index group, std::vector<Neighbour>& out) const override { elastic_->neighbours(group, out); }

  void block(Index row, Index col, BlockValues& values) const override {
    elastic_->block(row, col, values);
    double mass = 0;
    grid_.for_each_shared_element(grid_.node_place(row + clamped_), grid_.node_place(col + clamped_),
                                  [&](GridPlace, std::size_t a, std::size_t b) { mass += mass_[a * 8 + b]; });
    values[1] += kSpin * mass;  // (x, y)
    values[3] -= kSpin * mass;  // (y, x)
  }

 private:
  HexGrid grid_;
  Index clamped_;
  std::unique_ptr<GroupModel> elastic_;
  HexMass mass_;
};

}  // namespace

std::unique_ptr<GroupModel> make_gyroscopic(HexGrid grid, Randomness random) {
  return std::make_unique<Gyroscopic>(grid, random);
}

}  // namespace espalier::matrix
