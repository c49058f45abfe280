#include "dynamics/contact/impact_friction.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics::contact {
namespace {

/// Larger eigenvalue of the symmetric 2 x 2 matrix.
double larger_eigenvalue(double a, double b, double d) { return 0.5 * (a + d) + std::hypot(0.5 * (a - d), b); }

/// @param share of the restitutions
Eigen::VectorXd with_restitution(const FrictionImpact& in, double share) {
  constexpr int kMostPasses = 20000;
  constexpr double kClose = 1e-14;
  const Eigen::Index n = in.restitution.size();
  const double speed = in.before.cwiseAbs().maxCoeff();
  Eigen::VectorXd p = Eigen::VectorXd::Zero(3 * n);
  for (int pass = 0; pass < kMostPasses; ++pass) {
    double moved = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Index at = 3 * i;
      const double own = in.w(at, at), wanted = -share * in.restitution[i] * std::min(0.0, in.before[at]);
      const double rate = in.before[at] + in.w.row(at).dot(p);
      const double normal = std::max(0.0, p[at] - (rate - wanted) / own);
      moved = std::max(moved, own * std::abs(normal - p[at]));
      p[at] = normal;
      const double most = larger_eigenvalue(in.w(at + 1, at + 1), in.w(at + 1, at + 2), in.w(at + 2, at + 2));
      if (!(most > 0)) continue;  // joints hold it
      Eigen::Vector2d t;
      for (Eigen::Index k = 0; k < 2; ++k)
        t[k] = p[at + 1 + k] - (in.before[at + 1 + k] + in.w.row(at + 1 + k).dot(p)) / most;
      const double limit = in.friction[i] * normal, size = t.norm();
      if (size > limit) t *= limit / size;
      moved = std::max(moved, most * (t - p.segment<2>(at + 1)).cwiseAbs().maxCoeff());
      p.segment<2>(at + 1) = t;
    }
    if (moved <= kClose * speed) break;
  }
  return p;
}

}  // namespace

Eigen::VectorXd friction_impulses(const FrictionImpact& in) {
  constexpr double kRounding = 1e-12;
  constexpr int kHalvings = 30;
  const auto raises = [&](const Eigen::VectorXd& p) {
    return p.dot(in.before + 0.5 * in.w * p) > kRounding * p.cwiseAbs().dot(in.before.cwiseAbs());
  };
  Eigen::VectorXd p = with_restitution(in, 1);
  if (!raises(p)) return p;
  double low = 0, high = 1;
  p = with_restitution(in, 0);
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = 0.5 * (low + high);
    const Eigen::VectorXd next = with_restitution(in, middle);
    if (raises(next)) {
      high = middle;
    } else {
      low = middle;
      p = next;
    }
  }
  return p;
}

}  // namespace espalier::dynamics::contact
