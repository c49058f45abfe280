#include "dynamics/page/nodal_stress.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "base/at.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kTensor = 6, kTensors = 2 * kTensor;  // stress and strain: 11 22 33 12 23 13

double von_mises_of(const double* n) {
  const double a = n[0] - n[1], b = n[1] - n[2], c = n[2] - n[0];
  return std::sqrt(0.5 * (a * a + b * b + c * c) + 3 * (n[3] * n[3] + n[4] * n[4] + n[5] * n[5]));
}

/// The principal value of the largest magnitude, with its sign.
double principal_of(const double* n) {
  Mat3 t;
  t << n[0], n[3], n[5], n[3], n[1], n[4], n[5], n[4], n[2];
  if (!t.allFinite()) return kNoNumber;
  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(t, Eigen::EigenvaluesOnly);
  const double low = solver.eigenvalues()[0], high = solver.eigenvalues()[2];
  return -low > high ? low : high;
}

/// Weights of an element's samples at its nodes, by its shape.
class NodeWeights {
 public:
  const std::vector<model::SampleWeights>& of(ElementType shape, SamplePoints points) {
    auto [it, fresh] = known_.try_emplace({shape, points});
    if (fresh)
      for (const auto& xi : model::node_coordinates(shape)) it->second.push_back(model::weights_at(points, xi.data()));
    return it->second;
  }

 private:
  std::map<std::pair<ElementType, SamplePoints>, std::vector<model::SampleWeights>> known_;
};

}  // namespace

NodalStress::NodalStress(const model::Mechanism& mechanism, const Drawn& drawn) : mechanism_(mechanism) {
  for (std::size_t b = 0; b < mechanism.bodies.size(); ++b) {
    const Skin* skin = drawn.skins()[b].get();
    if (skin == nullptr) continue;
    const std::size_t first = points_;
    points_ += at(skin->points());
    const model::BuiltBody& body = mechanism.bodies[b];
    if (!body.mesh || body.flexible == nullptr) continue;
    Solid solid{&body, std::make_unique<const model::SampledBody>(body), first, skin->nodes(), {}, {}};
    std::vector<Index> drawn_as(body.mesh->nodes.size(), -1);
    for (std::size_t k = 0; k < solid.nodes.size(); ++k) drawn_as[at(solid.nodes[k])] = static_cast<Index>(k);
    for (Index e = 0; e < solid.samples->elements(); ++e) {
      const std::vector<Index> nodes = solid.samples->element_nodes(e);
      if (std::none_of(nodes.begin(), nodes.end(), [&](Index node) { return drawn_as[at(node)] >= 0; })) continue;
      solid.elements.push_back(e);
      for (const Index node : nodes) solid.point_of.push_back(drawn_as[at(node)]);
    }
    bodies_.push_back(std::move(solid));
  }
}

NodalStress::Kept NodalStress::keep(const State& s) const {
  const model::LinearResponse* linear = mechanism_.linear.get();
  if (linear == nullptr) {
    Kept kept{s.q, {}, {}};
    for (const Solid& solid : bodies_) {
      const std::span<const char> failed = solid.body->flexible->assembly().failed();
      kept.failed.emplace_back(failed.begin(), failed.end());
    }
    return kept;
  }
  const double share = linear->load() != 0 ? s.t / linear->load() : 1;
  return {{}, linear->of([this](const State& there) { return tensors(there, {}); }, share), {}};
}

std::vector<double> NodalStress::tensors(const State& s, const std::vector<std::vector<char>>& failed) const {
  std::vector<double> sum(kTensors * points_, 0.0);
  std::vector<int> count(points_, 0);
  NodeWeights weights;
  for (const Solid& solid : bodies_) {
    const model::FieldTable table = solid.samples->sample(s, solid.elements, nullptr);
    const auto number = at(&solid - bodies_.data());
    const bool any_failed = number < failed.size() && !failed[number].empty();
    std::size_t corner = 0;
    for (std::size_t k = 0; k < solid.elements.size(); ++k) {
      const Index e = solid.elements[k];
      if (any_failed && failed[number][at(e)] != 0) {
        corner += weights.of(solid.samples->shape(e), solid.samples->points(e)).size();
        continue;
      }
      for (const model::SampleWeights& w : weights.of(solid.samples->shape(e), solid.samples->points(e))) {
        const Index point = solid.point_of[corner++];
        if (point < 0) continue;
        double* to = &sum[kTensors * (solid.first_point + at(point))];
        const std::size_t samples = model::points_of(solid.samples->points(e)).size();
        for (std::size_t q = 0; q < samples; ++q)
          for (std::size_t m = 0; m < kTensor; ++m) {
            to[m] += w[q] * table.stress[k].value[q][m];
            to[kTensor + m] += w[q] * (m < 3 ? 1 : 0.5) * table.strain[k].value[q][m];
          }
        ++count[solid.first_point + at(point)];
      }
    }
  }
  for (std::size_t k = 0; k < points_; ++k)
    for (std::size_t m = 0; m < kTensors; ++m)
      sum[kTensors * k + m] = count[k] > 0 ? sum[kTensors * k + m] / count[k] : kNoNumber;
  return sum;
}

NodalStress::Values NodalStress::evaluate(const Kept& kept) const {
  std::vector<double> made;
  if (kept.tensors.empty()) {
    State s;
    s.q = kept.q;
    made = tensors(s, kept.failed);
  }
  const std::vector<double>& all = kept.tensors.empty() ? made : kept.tensors;
  Values values;
  for (std::size_t k = 0; k < points_; ++k) {
    const double* stress = &all[kTensors * k];
    values.von_mises.push_back(von_mises_of(stress));
    values.principal.push_back(principal_of(stress));
    values.strain.push_back(principal_of(stress + kTensor));
  }
  return values;
}

std::vector<NodalStress::Peak> NodalStress::peaks(const Values& values) const {
  std::vector<Peak> all;
  for (const Solid& solid : bodies_) {
    Peak peak;
    for (std::size_t k = 0; k < solid.nodes.size(); ++k) {
      const double x = values.von_mises[solid.first_point + k];
      if (std::isfinite(x) && (!peak.found || x > peak.value)) peak = {x, k, true};
    }
    all.push_back(peak);
  }
  return all;
}

SimulationExtreme NodalStress::describe(std::size_t solid, const Peak& peak, double t) const {
  const model::SampledBody& body = *bodies_[solid].samples;
  const Index node = bodies_[solid].nodes[peak.point];
  const Vec3 place = body.node_place(node);
  return {peak.value, t, body.body().spec.name, body.node_label(node), {place[0], place[1], place[2]}};
}

}  // namespace espalier::dynamics::page
