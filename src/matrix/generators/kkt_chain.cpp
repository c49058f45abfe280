#include "matrix/generators/families.hpp"
#include "matrix/generators/hex8.hpp"

namespace espalier::matrix {

namespace {

constexpr double kChainYoung = 1.0;
constexpr double kChainPoisson = 0.3;
constexpr double kMassFactor = 0.5;  // K + M/2

class KktChain final : public GroupModel {
 public:
  KktChain(Index bodies, HexGrid grid, Randomness random)
      : grid_(grid),
        bodies_(bodies),
        body_nodes_(static_cast<Index>(grid.nodes())),
        first_joint_(bodies * body_nodes_),
        stiffness_(hex8_stiffness(hex_box(1, 1, 1), kChainYoung, kChainPoisson)),
        mass_(hex8_mass(hex_box(1, 1, 1))),
        factors_(element_factors(bodies * grid.elements(), random.seed)) {}

  [[nodiscard]] Index groups() const override { return first_joint_ + bodies_; }

  void neighbours(Index group, std::vector<Neighbour>& out) const override {
    if (group >= first_joint_) {
      const Index joint = group - first_joint_;
      if (joint > 0) add_face(joint - 1, grid_.nx, out);
      add_face(joint, 0, out);
      return;
    }
    const Index body = group / body_nodes_;
    const GridPlace p = grid_.node_place(group % body_nodes_);
    grid_.for_each_neighbour(p, [&](GridPlace q) {
      out.push_back({body * body_nodes_ + grid_.node(q), BlockShape::full});
    });
    if (p.x == 0) out.push_back({first_joint_ + body, BlockShape::diagonal});
    if (p.x == grid_.nx && body + 1 < bodies_) out.push_back({first_joint_ + body + 1, BlockShape::diagonal});
  }

  void block(Index row, Index col, BlockValues& values) const override {
    if (row >= first_joint_ || col >= first_joint_) {
      joint_block(std::min(row, col), std::max(row, col) - first_joint_, values);
      return;
    }
    const Index body = row / body_nodes_;
    const auto first_element = at(body * grid_.elements());
    double mass = 0;
    values.fill(0);
    grid_.for_each_shared_element(grid_.node_place(row % body_nodes_), grid_.node_place(col % body_nodes_),
                                  [&](GridPlace e, std::size_t a, std::size_t b) {
                                    const double factor = factors_[first_element + at(grid_.element(e))];
                                    mass += mass_[a * 8 + b];
                                    for (std::size_t i = 0; i < 3; ++i)
                                      for (std::size_t k = 0; k < 3; ++k)
                                        values[3 * i + k] += factor * stiffness_[(3 * a + i) * 24 + 3 * b + k];
                                  });
    for (std::size_t i = 0; i < 3; ++i) values[4 * i] += kMassFactor * mass;
  }

 private:
  void add_face(Index body, Index x, std::vector<Neighbour>& out) const {
    for (Index y = 0; y <= grid_.ny; ++y)
      for (Index z = 0; z <= grid_.nz; ++z)
        out.push_back({body * body_nodes_ + grid_.node({x, y, z}), BlockShape::diagonal});
  }

  // +1/nodes on the face x = nx of the body before the joint, -1/nodes on the face x = 0 of the body behind it.
  void joint_block(Index node, Index joint, BlockValues& values) const {
    const double average = 1.0 / static_cast<double>((grid_.ny + 1) * (grid_.nz + 1));
    values.fill(0);
    for (std::size_t i = 0; i < 3; ++i) values[4 * i] = node / body_nodes_ < joint ? average : -average;
  }

  HexGrid grid_;
  Index bodies_;
  Index body_nodes_;
  Index first_joint_;  // groups below are nodes
  HexStiffness stiffness_;
  HexMass mass_;
  std::vector<double> factors_;
};

}  // namespace

std::unique_ptr<GroupModel> make_kkt_chain(Index bodies, HexGrid grid, Randomness random) {
  return std::make_unique<KktChain>(bodies, grid, random);
}

}  // namespace espalier::matrix
