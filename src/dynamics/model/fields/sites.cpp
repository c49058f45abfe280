#include "dynamics/model/fields/sites.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/fields/locate.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

/// Makes sites; equal weights are kept once.
class SiteMaker {
 public:
  SiteMaker(const SampledBody& body, bool surfaces) : body_(body), surfaces_(surfaces) {}

  Sites take() { return std::move(out_); }
  Sites& out() { return out_; }

  SiteTerm term(Index e, std::array<double, 3> xi, double factor) {
    SiteTerm t{e, factor, keep(body_.points(e), xi), nullptr};
    if (body_.kind() == FieldBody::shell) {
      const SampleWeights top = weights_at(body_.points(e), std::array{xi[0], xi[1], 1.0}.data()),
                          bottom = weights_at(body_.points(e), std::array{xi[0], xi[1], -1.0}.data());
      SampleWeights slope{};
      for (std::size_t q = 0; q < 8; ++q) slope[q] = top[q] - bottom[q];
      t.slope = keep(slope);
    }
    return t;
  }

  /// The heights in a shell at which sites are made where none is given: both surfaces, or the middle.
  [[nodiscard]] std::vector<double> sides(const Where& where) const {
    if (body_.kind() != FieldBody::shell) return {0};
    if (where.side) return {*where.side};
    return surfaces_ ? std::vector<double>{-1, 1} : std::vector<double>{0};
  }

  /// @param among  elements that count
  void add_nodes(const std::vector<Index>& nodes, const std::vector<double>& weights, const std::vector<Index>& among,
                 const std::vector<double>& sides) {
    std::vector<std::vector<std::pair<Index, int>>> elements_of(at(body_.nodes()));  // and which of its nodes it is
    for (const Index e : among) {
      const auto own = body_.element_nodes(e);
      for (std::size_t a = 0; a < own.size(); ++a) elements_of[at(own[a])].emplace_back(e, static_cast<int>(a));
    }
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      const auto& around = elements_of[at(nodes[k])];
      if (around.empty()) continue;
      for (const double side : sides) {
        Site site;
        site.node = body_.node_label(nodes[k]);
        site.place = body_.node_place(nodes[k]);
        site.weight = weights[k] / static_cast<double>(sides.size());
        for (const auto& [e, a] : around) {
          std::array<double, 3> xi = node_coordinates(body_.shape(e))[at(a)];
          if (body_.kind() == FieldBody::shell) xi[2] = side;
          site.terms.push_back(term(e, xi, 1 / static_cast<double>(around.size())));
        }
        out_.list.push_back(std::move(site));
      }
    }
  }

  /// @param found  the elements that it is in
  void add_point(const Vec3& point, const std::vector<Located>& found) {
    Site site;
    site.place = point;
    for (const Located& here : found) {
      site.terms.push_back(term(here.element, here.xi, 1 / static_cast<double>(found.size())));
      site.y = here.y;
      site.z = here.z;
    }
    site.fibre = body_.kind() == FieldBody::beam || body_.kind() == FieldBody::cable;
    out_.list.push_back(std::move(site));
  }

  /// At all sample points, with their volumes as weights.
  void add_volume(const std::vector<Index>& elements) {
    double volume = 0;
    for (const Index e : elements) {
      const std::vector<double> x = body_.reference(e);
      const auto points = points_of(body_.points(e));
      for (std::size_t q = 0; q < points.size(); ++q) {
        Site site;
        const bool line = body_.shape(e) == ElementType::line2;
        const double ratio = line ? 0.5 * length(e) : volume_ratio(body_.shape(e), points[q].xi.data(), x.data());
        site.weight = points[q].weight * ratio;
        volume += site.weight;
        site.terms.push_back(term(e, points[q].xi, 1));
        out_.list.push_back(std::move(site));
      }
    }
    for (Site& site : out_.list) site.weight /= volume;
  }

 private:
  [[nodiscard]] double length(Index e) const {
    const auto nodes = body_.element_nodes(e);
    return (body_.node_place(nodes[1]) - body_.node_place(nodes[0])).norm();
  }
  const SampleWeights* keep(const SampleWeights& w) {
    const auto [it, fresh] = known_.emplace(w, nullptr);
    if (fresh) it->second = &out_.weights.emplace_back(w);
    return it->second;
  }
  const SampleWeights* keep(SamplePoints points, const std::array<double, 3>& xi) {
    return keep(weights_at(points, xi.data()));
  }

  const SampledBody& body_;
  bool surfaces_;
  Sites out_;
  std::map<SampleWeights, const SampleWeights*> known_;
};

std::vector<Index> all_of(Index count) {
  std::vector<Index> all(at(count));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// The mesh that has the names; null: there is none.
const Mesh* sets_of(const SampledBody& body) { return named_mesh(body.body()); }

[[noreturn]] void no_such_set(const SampledBody& body, const std::string& set) {
  const std::string& name = body.body().spec.name;
  if (sets_of(body) == nullptr)
    throw std::invalid_argument(
        fmt::format("'{}' has no sets; write [node 3] (from 1, -1 the last), [element 2] or [x y z]", name));
  std::vector<std::string> names;
  for (const auto& [known, list] : sets_of(body)->face_sets) names.push_back(known);
  for (const auto& [known, list] : sets_of(body)->node_sets) names.push_back(known);
  for (const auto& [known, list] : sets_of(body)->element_sets) names.push_back(known);
  std::string all;
  for (std::size_t k = 0; k < std::min<std::size_t>(names.size(), 12); ++k) all += (k > 0 ? ", " : "") + names[k];
  throw std::invalid_argument(fmt::format("the mesh of '{}' has no set '{}'{}; it has {}", name, set,
                                          suggestion(set, names), all.empty() ? "none" : all));
}

/// What a set without a word before it is.
Where::Kind kind_of_set(const SampledBody& body, const Where& where) {
  if (where.kind != Where::Kind::set) return where.kind;
  if (sets_of(body) == nullptr) no_such_set(body, where.set);
  const Mesh& mesh = *sets_of(body);
  if (find_named(mesh.face_sets, where.set) != mesh.face_sets.end()) return Where::Kind::faces;
  if (find_named(mesh.node_sets, where.set) != mesh.node_sets.end()) return Where::Kind::nodes;
  if (find_named(mesh.element_sets, where.set) != mesh.element_sets.end()) return Where::Kind::elements;
  no_such_set(body, where.set);
}

Index node_of_label(const SampledBody& body, std::int64_t label) {
  return nodes_labelled(body.body(), {label}).front();
}

std::vector<Index> elements_of_set(const SampledBody& body, const std::string& set) {
  if (sets_of(body) == nullptr || find_named(sets_of(body)->element_sets, set) == sets_of(body)->element_sets.end())
    no_such_set(body, set);
  std::vector<Index> out;
  if (line_file(body.body()) != nullptr) return sets_of(body)->element_set(set);  // halves of elements have one label
  for (const Index e : sets_of(body)->element_set(set))
    if (const Index own = body.find_element(sets_of(body)->element_label(e)); own >= 0) out.push_back(own);
  if (out.empty())
    throw std::invalid_argument(
        fmt::format("'{}' has none of the elements of the set '{}'", body.body().spec.name, set));
  return out;
}

/// Integrals of the shape functions over a face set, by node.
std::map<Index, double> area_shares(const SampledBody& body, const std::vector<MeshFace>& faces) {
  std::map<Index, double> shares;
  double area = 0;
  for (const MeshFace& face : faces) {
    const std::vector<Index> nodes = sets_of(body)->face_nodes(face);
    const ElementType type = shape_of(sets_of(body)->type(face.element)).faces[at(face.face)].type;
    for (const QuadraturePoint& p : face_quadrature(type)) {
      double n[kMaxElementNodes], dn[2 * kMaxElementNodes];
      shape_values(type, p.xi.data(), n);
      shape_gradients(type, p.xi.data(), dn);
      Vec3 along = Vec3::Zero(), across = Vec3::Zero();
      for (std::size_t a = 0; a < nodes.size(); ++a) {
        along += dn[a] * body.node_place(nodes[a]);
        across += dn[nodes.size() + a] * body.node_place(nodes[a]);
      }
      const double weight = p.weight * along.cross(across).norm();
      area += weight;
      for (std::size_t a = 0; a < nodes.size(); ++a) shares[nodes[a]] += weight * n[a];
    }
  }
  for (auto& [node, share] : shares) share /= area;
  return shares;
}

}  // namespace

std::vector<Index> nodes_at(const SampledBody& body, const Where& where) {
  switch (kind_of_set(body, where)) {
    case Where::Kind::node:
      return {node_of_label(body, where.label)};
    case Where::Kind::nodes:
      if (sets_of(body) == nullptr || find_named(sets_of(body)->node_sets, where.set) == sets_of(body)->node_sets.end())
        no_such_set(body, where.set);
      return sets_of(body)->node_set(where.set);
    case Where::Kind::faces:
      if (sets_of(body) == nullptr || find_named(sets_of(body)->face_sets, where.set) == sets_of(body)->face_sets.end())
        no_such_set(body, where.set);
      return sets_of(body)->nodes_of_faces(sets_of(body)->face_set(where.set));
    case Where::Kind::elements: {
      std::vector<Index> nodes;
      for (const Index e : elements_of_set(body, where.set)) {
        const auto own = body.element_nodes(e);
        nodes.insert(nodes.end(), own.begin(), own.end());
      }
      sort_unique(nodes);
      return nodes;
    }
    case Where::Kind::whole:
      return all_of(body.nodes());
    default:
      throw std::invalid_argument("this is asked for at nodes: write [node 12], [SET], or nothing for the whole body");
  }
}

Sites find_sites(const SampledBody& body, const Where& where, bool mean, bool surfaces) {
  if (where.side && body.kind() != FieldBody::shell)
    throw std::invalid_argument(
        fmt::format("'{}' is no shell: it has no top, middle and bottom", body.body().spec.name));
  SiteMaker maker(body, surfaces);
  const Where::Kind kind = kind_of_set(body, where);
  maker.out().several = kind != Where::Kind::node && kind != Where::Kind::element && kind != Where::Kind::point;
  const std::vector<Index> all = all_of(body.elements());
  if (kind == Where::Kind::element) {
    const Index e = body.find_element(where.label);
    if (e < 0) throw std::invalid_argument(fmt::format("'{}' has no element {}", body.body().spec.name, where.label));
    std::array<double, 3> middle = middle_of(body.shape(e));
    if (where.side) middle[2] = *where.side;  // of shells
    Site site;
    site.terms.push_back(maker.term(e, middle, 1));
    for (const Index n : body.element_nodes(e))
      site.place += body.node_place(n) / static_cast<double>(body.element_nodes(e).size());
    maker.out().list.push_back(std::move(site));
    return maker.take();
  }
  if (kind == Where::Kind::point) {
    if (where.side) throw std::invalid_argument("a point x y z of a shell has its height in z already");
    maker.add_point(where.point, locate(body, where.point));
    return maker.take();
  }
  const bool by_elements = kind == Where::Kind::elements || kind == Where::Kind::whole;
  const std::vector<Index> elements = kind == Where::Kind::elements ? elements_of_set(body, where.set) : all;
  if (by_elements && mean && !where.side) {
    maker.add_volume(elements);
    return maker.take();
  }
  const std::vector<Index> nodes = nodes_at(body, where);
  std::vector<double> weights(nodes.size(), 1 / static_cast<double>(nodes.size()));
  if (kind == Where::Kind::faces) {
    const std::map<Index, double> shares = area_shares(body, sets_of(body)->face_set(where.set));
    for (std::size_t k = 0; k < nodes.size(); ++k) weights[k] = shares.at(nodes[k]);
  }
  maker.add_nodes(nodes, weights, elements, maker.sides(where));
  if (maker.out().list.empty())
    throw std::invalid_argument(
        fmt::format("no element of '{}' has one of the nodes of '{}'", body.body().spec.name, where.set));
  return maker.take();
}

Sites find_sites(const SampledBody& body, const std::vector<Vec3>& points) {
  SiteMaker maker(body, false);
  for (const Vec3& point : points) {
    std::vector<Located> found;
    try {
      found = locate(body, point);
    } catch (const std::invalid_argument&) {  // beside the body
    }
    maker.add_point(point, found);
  }
  maker.out().several = true;
  return maker.take();
}

}  // namespace espalier::dynamics::model
