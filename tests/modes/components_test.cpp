// A mass matrix of equal components is looked at once for all of them.
#include "modes/components.hpp"

#include "modes_common.hpp"

namespace espalier {
namespace {

// Three components, interleaved as the directions of a solid are.
Eigen::MatrixXd three_directions(Index nodes) {
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(3 * nodes, 3 * nodes);
  for (Index a = 0; a < nodes; ++a)
    for (Index d = 0; d < 3; ++d) {
      m(3 * a + d, 3 * a + d) = a == 0 || a + 1 == nodes ? 2 : 4;
      if (a > 0) m(3 * a + d, 3 * (a - 1) + d) = m(3 * (a - 1) + d, 3 * a + d) = 1;
    }
  return m;
}

Index kept(const Eigen::MatrixXd& m) {
  Index count = 0;
  for (const char row : modes::in_first_of_equal_components(test::sparse(m))) count += row;
  return count;
}

TEST(ModesComponents, OneOfEachKindIsKept) {
  Eigen::MatrixXd m = three_directions(9);
  EXPECT_EQ(kept(m), 9);
  const std::vector<char> rows = modes::in_first_of_equal_components(test::sparse(m));
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows[i] != 0, i % 3 == 0) << i;
  m(25, 25) = std::nextafter(m(25, 25), 5.0);  // the second direction differs in its last bit
  EXPECT_EQ(kept(m), 18);
  m(2, 0) = m(0, 2) = 1e-3;  // the first and the third are one component
  EXPECT_EQ(kept(m), 27);
  EXPECT_EQ(kept(Eigen::MatrixXd::Identity(5, 5)), 1);
  EXPECT_TRUE(modes::in_first_of_equal_components(SparseMatrix{}).empty());
}

// What is wrong in one of them is found, whichever it is.
TEST(ModesComponents, EachKindIsLookedAt) {
  const Index nodes = 9, n = 3 * nodes;
  const SparseMatrix k = test::string(n);
  EXPECT_TRUE(find_modes(k, test::sparse(three_directions(nodes)), test::lowest(2)).complete);
  for (Index d = 0; d < 3; ++d) {
    Eigen::MatrixXd m = three_directions(nodes);
    m(3 + d, d) = m(d, 3 + d) = 4;  // 2 * 4 < 4 * 4
    const Status status = find_modes(k, test::sparse(m), test::lowest(1)).status;
    EXPECT_EQ(status.code, StatusCode::invalid_input) << d;
    EXPECT_NE(status.message.find("M is not positive semi-definite: it has 1 negative"), std::string::npos)
        << status.message;
  }
}

}  // namespace
}  // namespace espalier
