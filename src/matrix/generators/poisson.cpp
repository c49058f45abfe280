#include "matrix/generators/families.hpp"

namespace espalier::matrix {

namespace {

class Poisson final : public GroupModel {
 public:
  Poisson(Index nx, Index ny, Index nz) : nx_(nx), ny_(ny), nz_(nz) {}

  [[nodiscard]] Index group_size() const override { return 1; }
  [[nodiscard]] Index groups() const override { return nx_ * ny_ * nz_; }

  void neighbours(Index node, std::vector<Neighbour>& out) const override {
    const Index z = node % nz_, y = node / nz_ % ny_, x = node / nz_ / ny_;
    const auto add = [&](bool inside, Index other) {
      if (inside) out.push_back({other, BlockShape::full});
    };
    add(true, node);
    add(x > 0, node - ny_ * nz_);
    add(x + 1 < nx_, node + ny_ * nz_);
    add(y > 0, node - nz_);
    add(y + 1 < ny_, node + nz_);
    add(z > 0, node - 1);
    add(z + 1 < nz_, node + 1);
  }

  void block(Index row, Index col, BlockValues& values) const override { values[0] = row == col ? 6.0 : -1.0; }

 private:
  Index nx_, ny_, nz_;
};

}  // namespace

std::unique_ptr<GroupModel> make_poisson(Index nx, Index ny, Index nz) { return std::make_unique<Poisson>(nx, ny, nz); }

}  // namespace espalier::matrix
