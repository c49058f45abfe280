#include "dynamics/forces/pressed_faces.hpp"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <unordered_map>

#include "base/at.hpp"
#include "dynamics/elements/pressure.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;

constexpr std::size_t kMost = 24;  // coordinates of a face of eight nodes

ElementType face_type(const Mesh& mesh, const MeshFace& face) {
  return shape_of(mesh.type(face.element)).faces[at(face.face)].type;
}

void check_solid(const FlexibleBody& body) {
  if (body.vertices_per_node() != 1) throw std::invalid_argument("pressure acts on solid bodies only");
}

/// Faces whose forces are on coordinates of their nodes.
class FacesOfNodes : public PressedFaces {
 public:
  void declare(PatternBuilder& w) const override {
    for (const Face& face : faces_) w.add_block(face.rows, face.rows);
  }
  void bind(const SparsePattern& w) override {
    for (Face& face : faces_) {
      face.entries.clear();
      for (const Index c : face.rows)
        for (const Index r : face.rows) face.entries.push_back(find_entry(w, c, r));
    }
  }

 protected:
  struct Face {
    ElementType type = ElementType::quad4;
    Index element = -1;              ///< whose face it is, by the number in the body's assembly; -1: not known
    std::vector<Index> rows{};       ///< velocity coordinates, three for every node; six of a shell
    std::vector<Index> places{};     ///< of the same numbers in the configuration
    std::vector<std::size_t> own{};  ///< of the same in rows()
    std::vector<Offset> entries{};   ///< of W, column by column
  };
  void add(Face& face, Index row, Index place) {
    const auto [it, fresh] = known_.emplace(row, rows_.size());
    if (fresh) rows_.push_back(row);
    face.rows.push_back(row);
    face.places.push_back(place);
    face.own.push_back(it->second);
  }
  std::vector<Face> faces_;

 private:
  std::map<Index, std::size_t> known_;
};

class NodalFaces final : public FacesOfNodes {
 public:
  NodalFaces(const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces) : body_(body) {
    const std::unordered_map<std::int64_t, Index> numbers = body.assembly().numbers_by_label();
    for (const MeshFace& face : faces) {
      const auto number = numbers.find(mesh.element_label(face.element));
      Face next{face_type(mesh, face), number == numbers.end() ? -1 : number->second};
      const std::vector<Index> nodes = mesh.face_nodes(face);
      for (const Index node : nodes) {
        static_cast<void>(body.assembly().pattern().entry(node, nodes.front()));
        for (Index i = 0; i < 3; ++i) add(next, body.coordinate(node) + i, body.configuration(node) + i);
      }
      faces_.push_back(std::move(next));
    }
  }

  [[nodiscard]] std::vector<double> slope(ConstSpan q) const override {
    std::vector<double> result(rows_.size(), 0.0);
    for (const Face& face : faces_) {
      if (has_failed(face)) continue;
      double x[kMost], force[kMost] = {};
      gather(face, q, x);
      add_pressure_force(face.type, -1, x, force);
      for (std::size_t i = 0; i < face.own.size(); ++i) result[face.own[i]] += force[i];
    }
    return result;
  }
  void add_tangent(ConstSpan q, double scale, Span w_values) const override {
    for (const Face& face : faces_) {
      if (has_failed(face)) continue;
      double x[kMost], k[kMost * kMost] = {};
      gather(face, q, x);
      add_pressure_tangent(face.type, 1, -scale, x, k);
      for (std::size_t e = 0; e < face.entries.size(); ++e) w_values[at(face.entries[e])] += k[e];
    }
  }

 private:
  static void gather(const Face& face, ConstSpan q, double* x) {
    for (std::size_t i = 0; i < face.places.size(); ++i) x[i] = q[at(face.places[i])];
  }
  /// Nothing presses on an element that is not there any more.
  [[nodiscard]] bool has_failed(const Face& face) const {
    const std::span<const char> failed = body_.assembly().failed();
    return face.element >= 0 && !failed.empty() && failed[at(face.element)] != 0;
  }
  const FlexibleBody& body_;
};

/// The side x = r + offset d of a shell: force f on x is f on r and offset f on the director d.
class ShellSide final : public FacesOfNodes {
 public:
  ShellSide(const FlexibleBody& body, std::span<const std::array<Index, 4>> quads, double offset) : offset_(offset) {
    for (const std::array<Index, 4>& quad : quads) {
      Face next;
      for (std::size_t k = 0; k < 4; ++k) {
        const Index node = quad[offset < 0 ? 3 - k : k];  // anticlockwise from outside
        for (Index i = 0; i < 6; ++i)                     // r, then d
          add(next, body.coordinate(2 * node) + i, body.configuration(2 * node) + i);
      }
      faces_.push_back(std::move(next));
    }
  }

  [[nodiscard]] std::vector<double> slope(ConstSpan q) const override {
    std::vector<double> result(rows_.size(), 0.0);
    for (const Face& face : faces_) {
      double x[kOfSide], force[kOfSide] = {};
      gather(face, q, x);
      add_pressure_force(ElementType::quad4, -1, x, force);
      for (std::size_t i = 0; i < face.own.size(); ++i) result[face.own[i]] += factor(i) * force[of_side(i)];
    }
    return result;
  }
  void add_tangent(ConstSpan q, double scale, Span w_values) const override {
    for (const Face& face : faces_) {
      double x[kOfSide], k[kOfSide * kOfSide] = {};
      gather(face, q, x);
      add_pressure_tangent(ElementType::quad4, 1, -scale, x, k);
      std::size_t e = 0;
      for (std::size_t c = 0; c < face.rows.size(); ++c)
        for (std::size_t r = 0; r < face.rows.size(); ++r)
          w_values[at(face.entries[e++])] += factor(c) * factor(r) * k[kOfSide * of_side(c) + of_side(r)];
    }
  }

 private:
  static constexpr std::size_t kOfSide = 12;
  /// The share of number i of a face: what x takes of it, and which number of x that is.
  [[nodiscard]] double factor(std::size_t i) const { return i % 6 < 3 ? 1 : offset_; }
  static std::size_t of_side(std::size_t i) { return 3 * (i / 6) + i % 3; }
  void gather(const Face& face, ConstSpan q, double* x) const {
    std::fill(x, x + kOfSide, 0.0);
    for (std::size_t i = 0; i < face.places.size(); ++i) x[of_side(i)] += factor(i) * q[at(face.places[i])];
  }
  double offset_;
};

/// Forces in the axes of the body depend on the shapes alone: their sum, moment and work on each shape.
class ReducedFaces final : public PressedFaces {
 public:
  ReducedFaces(const ReducedBody& body, const Mesh& mesh, std::span<const MeshFace> faces) : body_(body) {
    rows_.assign(body.coordinates().begin(), body.coordinates().end());
    std::map<Index, Index> known;
    for (const MeshFace& face : faces) {
      faces_.push_back({face_type(mesh, face), {}});
      for (const Index node : mesh.face_nodes(face))
        faces_.back().nodes.push_back(known.emplace(node, static_cast<Index>(known.size())).first->second);
    }
    rest_.resize(3, static_cast<Eigen::Index>(known.size()));
    shapes_.resize(3 * rest_.cols(), body.modes());
    for (const auto& [node, own] : known) {
      rest_.col(own) = Eigen::Map<const Vec3>(body.nodal().reference().data() + 3 * node) - body.shapes().centre;
      shapes_.middleRows(3 * own, 3) = body.shapes().shapes.middleRows(3 * node, 3);
    }
  }

  void declare(PatternBuilder& w) const override { w.add_block(rows_, rows_); }
  void bind(const SparsePattern& w) override {
    entries_.clear();
    for (const Index c : rows_) entries_.push_back(find_entry(w, c, rows_.front()));
  }
  [[nodiscard]] std::vector<double> slope(ConstSpan q) const override {
    const Eigen::Matrix3Xd u = strained(q), f = forces(u);
    std::vector<double> result(rows_.size());
    Eigen::Map<Eigen::VectorXd> all(result.data(), static_cast<Eigen::Index>(result.size()));
    all.head<3>() = rotation_matrix(body_.quaternion(q)) * f.rowwise().sum();
    all.segment<3>(3) = moment(u, f);
    all.tail(body_.modes()) = shapes_.transpose() * flat(f);
    return result;
  }
  void add_tangent(ConstSpan q, double scale, Span w_values) const override {
    const Mat3 r = rotation_matrix(body_.quaternion(q));
    const Eigen::Matrix3Xd u = strained(q), f = forces(u);
    const MatrixXd df = change(u);  // of the forces, by each shape
    MatrixXd block = MatrixXd::Zero(static_cast<Eigen::Index>(rows_.size()), static_cast<Eigen::Index>(rows_.size()));
    block.block<3, 3>(0, 3) = -r * skew(Vec3(f.rowwise().sum()));
    for (Index l = 0; l < body_.modes(); ++l) {
      const Eigen::Map<const Eigen::Matrix3Xd> d(df.col(l).data(), 3, u.cols()),
          phi(shapes_.col(l).data(), 3, u.cols());
      block.block<3, 1>(0, 6 + l) = r * d.rowwise().sum();
      block.block<3, 1>(3, 6 + l) = moment(u, d) + moment(phi, f);
    }
    block.bottomRightCorner(body_.modes(), body_.modes()) = shapes_.transpose() * df;
    for (Eigen::Index c = 0; c < block.cols(); ++c)
      for (Eigen::Index k = 0; k < block.rows(); ++k) w_values[at(entries_[at(c)] + k)] += scale * block(k, c);
  }

 private:
  struct Face {
    ElementType type;
    std::vector<Index> nodes;
  };
  template <class Matrix>
  static Eigen::VectorXd flat(const Matrix& x) {
    return Eigen::Map<const Eigen::VectorXd>(x.data(), x.size());
  }
  template <class A, class B>
  static Vec3 moment(const A& u, const B& f) {
    Vec3 sum = Vec3::Zero();
    for (Eigen::Index k = 0; k < u.cols(); ++k) sum += Vec3(u.col(k)).cross(Vec3(f.col(k)));
    return sum;
  }
  [[nodiscard]] Eigen::Matrix3Xd strained(ConstSpan q) const {
    const Eigen::VectorXd way = shapes_ * body_.amplitudes(q);
    return rest_ + Eigen::Map<const Eigen::Matrix3Xd>(way.data(), 3, rest_.cols());
  }
  void gather(const Face& face, const Eigen::Matrix3Xd& u, double* x) const {
    for (std::size_t i = 0; i < face.nodes.size(); ++i) Eigen::Map<Vec3>(x + 3 * i) = u.col(face.nodes[i]);
  }
  [[nodiscard]] Eigen::Matrix3Xd forces(const Eigen::Matrix3Xd& u) const {
    Eigen::Matrix3Xd sum = Eigen::Matrix3Xd::Zero(3, u.cols());
    for (const Face& face : faces_) {
      double x[kMost], force[kMost] = {};
      gather(face, u, x);
      add_pressure_force(face.type, -1, x, force);
      for (std::size_t i = 0; i < face.nodes.size(); ++i) sum.col(face.nodes[i]) += Eigen::Map<Vec3>(force + 3 * i);
    }
    return sum;
  }
  [[nodiscard]] MatrixXd change(const Eigen::Matrix3Xd& u) const {
    MatrixXd sum = MatrixXd::Zero(shapes_.rows(), shapes_.cols());
    for (const Face& face : faces_) {
      double x[kMost], k[kMost * kMost] = {};
      gather(face, u, x);
      add_pressure_tangent(face.type, 1, -1, x, k);
      const auto n = static_cast<Eigen::Index>(3 * face.nodes.size());
      MatrixXd own(n, shapes_.cols());
      for (Eigen::Index i = 0; i < n; i += 3) own.middleRows(i, 3) = shapes_.middleRows(3 * face.nodes[at(i / 3)], 3);
      const MatrixXd d = Eigen::Map<const MatrixXd>(k, n, n) * own;
      for (Eigen::Index i = 0; i < n; i += 3) sum.middleRows(3 * face.nodes[at(i / 3)], 3) += d.middleRows(i, 3);
    }
    return sum;
  }

  const ReducedBody& body_;
  std::vector<Face> faces_;
  Eigen::Matrix3Xd rest_;  // of the faces' nodes, from the centre of mass
  MatrixXd shapes_;        // rows of the same nodes
  std::vector<Offset> entries_;
};

}  // namespace

std::unique_ptr<PressedFaces> press_nodal(const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces) {
  check_solid(body);
  return std::make_unique<NodalFaces>(body, mesh, faces);
}

std::unique_ptr<PressedFaces> press_shell(const FlexibleBody& body, std::span<const std::array<Index, 4>> quads,
                                          double offset) {
  return std::make_unique<ShellSide>(body, quads, offset);
}

std::unique_ptr<PressedFaces> press_reduced(const ReducedBody& body, const Mesh& mesh,
                                            std::span<const MeshFace> faces) {
  check_solid(body.nodal());
  return std::make_unique<ReducedFaces>(body, mesh, faces);
}

}  // namespace espalier::dynamics
