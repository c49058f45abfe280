// What processor times of the build are divided by (check_weight.py): a source of the same kind that never changes.
#include <Eigen/Dense>
#include <map>
#include <string>

Eigen::MatrixXd yardstick(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::PartialPivLU<Eigen::MatrixXd> lu(a * b.transpose() + b);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a + a.transpose());
  return lu.solve(eigen.eigenvectors()) * eigen.eigenvalues().asDiagonal();
}

double words(const std::map<std::string, Eigen::Vector3d>& named, const Eigen::Matrix3d& turn) {
  double sum = 0;
  for (const auto& [name, v] : named) sum += static_cast<double>(name.size()) * (turn * v).cross(v).norm();
  return sum;
}
