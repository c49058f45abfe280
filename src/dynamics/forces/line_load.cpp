#include "dynamics/forces/line_load.hpp"

#include <map>

#include "base/at.hpp"

namespace espalier::dynamics {
namespace {

class LineLoad final : public PressedFaces {
 public:
  LineLoad(std::vector<LoadedPoint> points, const LineLoadLaw& law) : law_(law) {
    std::map<Index, std::size_t> known;
    for (LoadedPoint& p : points) {
      points_.push_back({std::move(p.frame), p.length, {}, {}});
      for (const Index row : points_.back().frame->coordinates()) {
        const auto [it, fresh] = known.emplace(row, rows_.size());
        if (fresh) rows_.push_back(row);
        points_.back().own.push_back(it->second);
      }
    }
  }

  [[nodiscard]] const char* value_name() const override { return "factor"; }
  void declare(PatternBuilder& w) const override {
    for (const Point& p : points_) w.add_block(p.frame->coordinates(), p.frame->coordinates());
  }
  void bind(const SparsePattern& w) override {
    for (Point& p : points_) {
      p.entries.clear();
      for (const Index c : p.frame->coordinates())
        for (const Index r : p.frame->coordinates()) p.entries.push_back(find_entry(w, c, r));
    }
  }
  /// -J^T w
  [[nodiscard]] std::vector<double> slope(ConstSpan q) const override {
    std::vector<double> result(rows_.size(), 0.0);
    for (const Point& p : points_) {
      FrameMotion motion;
      p.frame->motion(q, {}, motion);
      const Vec6 wrench = p.length * acting(motion);
      std::vector<double> force(p.own.size());
      p.frame->project(q, motion, wrench.data(), 1, force.data());
      for (std::size_t i = 0; i < force.size(); ++i) result[p.own[i]] -= force[i];
    }
    return result;
  }
  /// -d(J^T w), and of a follower -J^T dw with dw = phi x w, phi the turn of the frame.
  void add_tangent(ConstSpan q, double scale, Span w_values) const override {
    for (const Point& p : points_) {
      FrameMotion motion;
      p.frame->motion(q, {}, motion);
      const auto n = static_cast<Eigen::Index>(p.own.size());
      const Vec6 wrench = p.length * acting(motion);
      Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n, n);
      if (p.frame->has_wrench_stiffness()) p.frame->wrench_stiffness(q, wrench, -scale, k.data());
      if (law_.follower) {
        Eigen::MatrixXd j(6, n), turned(6, n);
        p.frame->jacobian(q, j.data());
        turned.topRows<3>() = -skew(wrench.head<3>()) * j.bottomRows<3>();
        turned.bottomRows<3>() = -skew(wrench.tail<3>()) * j.bottomRows<3>();
        k -= scale * j.transpose() * turned;
      }
      for (std::size_t e = 0; e < p.entries.size(); ++e) w_values[at(p.entries[e])] += k.data()[e];
    }
  }

 private:
  struct Point {
    std::unique_ptr<Frame> frame;
    double length;
    std::vector<std::size_t> own;  ///< coordinates of the frame in rows()
    std::vector<Offset> entries;   ///< of W, column by column
  };
  [[nodiscard]] Vec6 acting(const FrameMotion& motion) const {
    Vec6 w;
    w << law_.force, law_.moment;
    if (law_.follower) w << motion.rot * law_.force, motion.rot * law_.moment;
    return w;
  }
  LineLoadLaw law_;
  std::vector<Point> points_;
};

}  // namespace

std::unique_ptr<PressedFaces> load_line(std::vector<LoadedPoint> points, const LineLoadLaw& law) {
  return std::make_unique<LineLoad>(std::move(points), law);
}

}  // namespace espalier::dynamics
