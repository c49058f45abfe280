#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "base/at.hpp"
#include "dynamics/substructure/substructure.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;

constexpr double kSame = 1e-6;  // how far two halves of a printed symmetric matrix may differ, of the diagonal

/// Puts rows of files at their places and remembers for what body, for messages.
class Arranger {
 public:
  Arranger(std::string name, std::vector<SubstructureNode> nodes) {
    result_.name = std::move(name);
    result_.nodes = std::move(nodes);
    std::set<std::int64_t> seen;
    for (const SubstructureNode& node : result_.nodes)
      if (!seen.insert(node.label).second) fail(fmt::format("node {} is listed twice", node.label));
    if (result_.nodes.empty()) fail("has no nodes");
  }

  Substructure arrange(const FileMatrix& mass, const FileMatrix& stiffness) {
    if (mass.unknowns.empty() != stiffness.unknowns.empty())
      fail("of mass and stiffness one matrix has labels of nodes and the other has none");
    if (mass.unknowns.empty())
      count_rows(mass, stiffness);
    else
      read_labels(mass, stiffness);
    result_.mass = symmetric(mass, "mass");
    result_.stiffness = symmetric(stiffness, "stiffness");
    return std::move(result_);
  }

 private:
  void count_rows(const FileMatrix& mass, const FileMatrix& stiffness) {
    for (SubstructureNode& node : result_.nodes) {
      if (node.components == 0) node.components = 6;
      size_ += node.components;
    }
    for (const auto& [m, what] : {std::pair{&mass, "mass"}, {&stiffness, "stiffness"}})
      if (m->rows != m->columns || m->rows != stiffness.rows || m->rows < size_)
        fail(
            fmt::format("the {} matrix has {} rows and {} columns; the stiffness has {}, and the components of the "
                        "listed nodes are {}",
                        what, m->rows, m->columns, stiffness.rows, size_));
    size_ = stiffness.rows;
  }

  void read_labels(const FileMatrix& mass, const FileMatrix& stiffness) {
    std::set<NodalUnknown> open(mass.unknowns.begin(), mass.unknowns.end());
    open.insert(stiffness.unknowns.begin(), stiffness.unknowns.end());
    for (SubstructureNode& node : result_.nodes) {
      std::vector<int> own;
      for (int c = 1; c <= 6; ++c)
        if (open.contains({node.label, c})) own.push_back(c);
      const bool whole = own.size() == 6, displacement = own == std::vector<int>{1, 2, 3};
      if (!whole && !displacement)
        fail(own.empty() ? fmt::format("the matrices have no node {}", node.label)
                         : fmt::format("node {} has the components {} in the matrices; needed are 1 to 3 or 1 to 6",
                                       node.label, fmt::join(own, ", ")));
      if (node.components != 0 && node.components != static_cast<int>(own.size()))
        fail(fmt::format("node {} has {} components in the matrices, not {}", node.label, own.size(), node.components));
      node.components = static_cast<int>(own.size());
      for (const int c : own) {
        row_[{node.label, c}] = size_++;
        open.erase({node.label, c});
      }
    }
    for (const NodalUnknown& scalar : open) row_[scalar] = size_++;
  }

  [[nodiscard]] MatrixXd symmetric(const FileMatrix& file, const char* what) const {
    const auto row = [&](Index k) { return file.unknowns.empty() ? k : row_.at(file.unknowns[at(k)]); };
    MatrixXd a = MatrixXd::Zero(size_, size_);
    Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> given(size_, size_);
    given.setConstant(false);
    for (const FileMatrix::Entry& e : file.entries) {
      a(row(e.row), row(e.column)) = e.value;
      given(row(e.row), row(e.column)) = true;
    }
    const double largest = a.cwiseAbs().maxCoeff();
    for (Index j = 0; j < size_; ++j)
      for (Index i = 0; i < j; ++i) {
        if (given(i, j) && given(j, i)) {
          const double scale = std::sqrt(std::abs(a(i, i) * a(j, j)));
          if (std::abs(a(i, j) - a(j, i)) > kSame * std::max(scale, 1e-9 * largest))
            fail(fmt::format("the {} matrix is not symmetric: rows {} and {} have {:g} and {:g}", what, i + 1, j + 1,
                             a(i, j), a(j, i)));
          a(i, j) = a(j, i) = 0.5 * (a(i, j) + a(j, i));
        } else {
          (given(i, j) ? a(j, i) : a(i, j)) = given(i, j) ? a(i, j) : a(j, i);
        }
      }
    return a;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("substructure '{}': {}", result_.name, what));
  }

  Substructure result_;
  Index size_ = 0;
  std::map<NodalUnknown, Index> row_;
};

}  // namespace

Substructure arrange(std::string name, const FileMatrix& mass, const FileMatrix& stiffness,
                     std::vector<SubstructureNode> nodes) {
  return Arranger(std::move(name), std::move(nodes)).arrange(mass, stiffness);
}

}  // namespace espalier::dynamics
