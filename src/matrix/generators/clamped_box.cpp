#include "base/at.hpp"
#include "matrix/generators/families.hpp"

namespace espalier::matrix {

namespace {

constexpr double kYoung = 1.0;
constexpr double kPoisson = 0.3;

class ClampedBox final : public GroupModel {
 public:
  ClampedBox(HexGrid grid, std::vector<HexStiffness> stiffness, Randomness random)
      : grid_(grid),
        stiffness_(std::move(stiffness)),
        factors_(element_factors(grid.elements(), random.seed)),
        clamped_((grid.ny + 1) * (grid.nz + 1)) {}

  [[nodiscard]] Index groups() const override { return static_cast<Index>(grid_.nodes()) - clamped_; }

  void neighbours(Index group, std::vector<Neighbour>& out) const override {
    grid_.for_each_neighbour(place(group), [&](GridPlace q) {
      if (q.x > 0) out.push_back({grid_.node(q) - clamped_, BlockShape::full});
    });
  }

  void block(Index row, Index col, BlockValues& values) const override {
    values.fill(0);
    grid_.for_each_shared_element(place(row), place(col), [&](GridPlace e, std::size_t a, std::size_t b) {
      const double factor = factors_[at(grid_.element(e))];
      const HexStiffness& stiffness = stiffness_[stiffness_.size() == 1 ? 0 : at(e.y)];
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) values[3 * i + k] += factor * stiffness[(3 * a + i) * 24 + 3 * b + k];
    });
  }

 private:
  [[nodiscard]] GridPlace place(Index group) const { return grid_.node_place(group + clamped_); }

  HexGrid grid_;
  std::vector<HexStiffness> stiffness_;  // one for all elements, or one for each y
  std::vector<double> factors_;
  Index clamped_;  // nodes of the face x = 0, the first ones of the grid
};

class ClampedBoxMass final : public GroupModel {
 public:
  explicit ClampedBoxMass(HexGrid grid)
      : grid_(grid), clamped_((grid.ny + 1) * (grid.nz + 1)), mass_(hex8_mass(hex_box(1, 1, 1))) {}

  [[nodiscard]] Index groups() const override { return static_cast<Index>(grid_.nodes()) - clamped_; }

  void neighbours(Index group, std::vector<Neighbour>& out) const override {
    grid_.for_each_neighbour(grid_.node_place(group + clamped_), [&](GridPlace q) {
      if (q.x > 0) out.push_back({grid_.node(q) - clamped_, BlockShape::diagonal});
    });
  }

  void block(Index row, Index col, BlockValues& values) const override {
    values.fill(0);
    double mass = 0;
    grid_.for_each_shared_element(grid_.node_place(row + clamped_), grid_.node_place(col + clamped_),
                                  [&](GridPlace, std::size_t a, std::size_t b) { mass += mass_[a * 8 + b]; });
    values[0] = values[4] = values[8] = mass;
  }

 private:
  HexGrid grid_;
  Index clamped_;
  HexMass mass_;
};

}  // namespace

std::unique_ptr<GroupModel> make_clamped_box_mass(HexGrid grid) { return std::make_unique<ClampedBoxMass>(grid); }

std::unique_ptr<GroupModel> make_clamped_box(HexGrid grid, double height, Randomness random) {
  return make_clamped_box(grid, {hex8_stiffness(hex_box(1, 1, height), kYoung, kPoisson)}, random);
}

std::unique_ptr<GroupModel> make_clamped_box(HexGrid grid, std::vector<HexStiffness> stiffness, Randomness random) {
  return std::make_unique<ClampedBox>(grid, std::move(stiffness), random);
}

}  // namespace espalier::matrix
