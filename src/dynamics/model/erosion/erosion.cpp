#include "dynamics/model/erosion/erosion.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dense/dense.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr base::Named<Erosion::Limit> kLimits[] = {{"strain", Erosion::Limit::strain},
                                                   {"stress", Erosion::Limit::stress},
                                                   {"principal_stress", Erosion::Limit::principal_stress}};

/// Numbers in the order 11 22 33 12 23 13 as a matrix. @param shear  factor of the last three
Mat3 tensor_of(const double (&n)[6], double shear) {
  Mat3 t;
  t << n[0], shear * n[3], shear * n[5], shear * n[3], n[1], shear * n[4], shear * n[5], shear * n[4], n[2];
  return t;
}

/// The largest principal value; NaN of what is not finite.
double largest_principal(const Mat3& t) {
  return t.allFinite() ? dense::principal_axes(t).values.maxCoeff() : std::numeric_limits<double>::quiet_NaN();
}

double von_mises_of(const double (&n)[6]) {
  const double a = n[0] - n[1], b = n[1] - n[2], c = n[2] - n[0];
  return std::sqrt(0.5 * (a * a + b * b + c * c) + 3 * (n[3] * n[3] + n[4] * n[4] + n[5] * n[5]));
}

/// Largest logarithmic principal strain, from that of Green and Lagrange: its axes are the same, e = ln(1 + 2 E) / 2.
double logarithmic_strain(const double (&n)[6]) { return 0.5 * std::log1p(2 * largest_principal(tensor_of(n, 0.5))); }

}  // namespace

void Erosion::add(const BuiltBody& body) {
  bodies_.push_back({&body,
                     body.flexible,
                     std::make_unique<const SampledBody>(body),
                     std::vector<double>(at(body.flexible->assembly().elements()), kNever),
                     0,
                     {},
                     {}});
  body.flexible->let_elements_fail();
}

const Erosion::Body* Erosion::find(const std::string& body) const {
  for (const Body& b : bodies_)
    if (b.built->spec.name == body) return &b;
  return nullptr;
}

const double* Erosion::failed_elements(const std::string& body) const {
  const Body* found = find(body);
  return found == nullptr ? nullptr : &found->count;
}

const std::vector<double>* Erosion::failed_at(const std::string& body) const {
  const Body* found = find(body);
  return found == nullptr ? nullptr : &found->failed_at;
}

bool Erosion::find_failing(const State& s) {
  bool any = false;
  for (Body& body : bodies_) {
    look_at(body, s, mechanism_.step_pool);
    any = any || !body.passed.empty();
  }
  return any;
}

Erosion::Passed Erosion::worst_of(const Body& body, Index element, const FieldTable& table, std::size_t row) {
  const ErosionSpec& limits = *body.built->spec.erosion();
  Passed worst;
  const auto hold = [&](Limit limit, double value, double allowed) {
    if (value > worst.share * allowed) worst = {element, limit, value, value / allowed};
  };
  for (std::size_t q = 0; q < points_of(body.samples->points(element)).size(); ++q) {
    const auto& strain = table.strain[row].value[q];
    // What is below a limit for sure needs no eigenvalues: the largest one is at most the norm.
    if (limits.strain > 0 && tensor_of(strain, 0.5).norm() > limits.strain)
      hold(Limit::strain, logarithmic_strain(strain), limits.strain);
    if (table.stress.empty()) continue;
    const auto& stress = table.stress[row].value[q];
    if (limits.stress > 0) hold(Limit::stress, von_mises_of(stress), limits.stress);
    if (limits.principal_stress > 0 && tensor_of(stress, 1).norm() > limits.principal_stress)
      hold(Limit::principal_stress, largest_principal(tensor_of(stress, 1)), limits.principal_stress);
  }
  return worst;
}

void Erosion::look_at(Body& body, const State& s, base::ThreadPool* pool) {
  constexpr std::int64_t kElements = 256;
  std::vector<Index> whole;
  for (std::size_t e = 0; e < body.failed_at.size(); ++e)
    if (body.failed_at[e] == kNever) whole.push_back(static_cast<Index>(e));
  const ErosionSpec& limits = *body.built->spec.erosion();
  const bool stresses = limits.stress > 0 || limits.principal_stress > 0;
  const FieldTable table = stresses ? body.samples->sample(s, whole, pool) : body.samples->strains(s, whole, pool);
  body.passed.assign(whole.size(), {});
  base::for_each_range(pool, static_cast<std::int64_t>(whole.size()), kElements, [&](auto begin, auto end) {
    for (auto k = at(begin); k < at(end); ++k) body.passed[k] = worst_of(body, whole[k], table, k);
  });
  std::erase_if(body.passed, [](const Passed& p) { return p.element < 0; });
}

void Erosion::mark(Body& body) {
  std::vector<char> failed(body.failed_at.size());
  for (std::size_t e = 0; e < failed.size(); ++e) failed[e] = body.failed_at[e] != kNever ? 1 : 0;
  body.count = static_cast<double>(std::count(failed.begin(), failed.end(), char{1}));
  body.body->set_failed(body.count > 0 ? std::move(failed) : std::vector<char>());
}

// What keeps the momentum of each element: see the header.
void Erosion::add_impulses(const Body& body, const State& s, Span impulse) {
  const auto vector_at = [](const std::vector<double>& x, Index i) { return Eigen::Map<const Vec3>(&x[at(i)]); };
  for (const Passed& passed : body.passed) {
    const ElementAssembly::ElementMass m =
        body.body->assembly().element_mass(passed.element, body.body->reference().data());
    const std::size_t n = m.vertices.size();
    const auto place = [&](std::size_t a) { return vector_at(s.q, body.body->configuration(m.vertices[a])); };
    const auto speed = [&](std::size_t a) { return vector_at(s.v, body.body->coordinate(m.vertices[a])); };
    double mass = 0;
    Vec3 centre = Vec3::Zero();
    for (std::size_t a = 0; a < n; ++a) {
      mass += m.lumped[a];
      centre += m.lumped[a] * place(a);
    }
    centre /= mass;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    Mat3 inertia = Mat3::Zero();
    for (std::size_t a = 0; a < n; ++a) {
      const Vec3 arm = place(a) - centre;
      Vec3 lacks = -m.lumped[a] * speed(a);
      for (std::size_t b = 0; b < n; ++b) lacks += m.consistent[a * n + b] * speed(b);
      linear += lacks;
      angular += arm.cross(lacks);
      inertia += m.lumped[a] * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose());
    }
    const Vec3 shift = linear / mass, turn = inertia.inverse() * angular;
    for (std::size_t a = 0; a < n; ++a)
      Eigen::Map<Vec3>(&impulse[at(body.body->coordinate(m.vertices[a]))]) +=
          m.lumped[a] * (shift + turn.cross(place(a) - centre));
  }
}

void Erosion::fail(Equations& equations, State& state) {
  const auto total = [&] {
    const Energy e = mechanism_.system.energy(state.view());
    return e.kinetic + e.potential;
  };
  const double before = total();
  const std::size_t n = state.v.size();
  std::vector<double> x(n + state.lambda.size(), 0.0);
  for (Body& body : bodies_) {
    if (body.passed.empty()) continue;
    add_impulses(body, state, Span(x).first(n));
    if (body.count == 0)
      body.first = *std::max_element(body.passed.begin(), body.passed.end(),
                                     [](const Passed& a, const Passed& b) { return a.share < b.share; });
    for (const Passed& passed : body.passed) body.failed_at[at(passed.element)] = state.t;
    body.passed.clear();
    mark(body);
  }
  mechanism_.system.finish();
  equations.evaluate_constraints(state.t, state.q, {});
  equations.factorize(state.view(), {1, 0, 0});
  equations.solve(x);
  for (std::size_t i = 0; i < n; ++i) state.v[i] += x[i];
  energy_ += before - total();
}

std::vector<std::string> Erosion::notices() const {
  std::vector<std::string> out;
  for (const Body& body : bodies_) {
    if (body.count == 0) continue;
    double last = 0;
    for (const double t : body.failed_at)
      if (t != kNever) last = std::max(last, t);
    const double first = body.failed_at[at(body.first.element)];
    out.push_back(fmt::format("'{}': {} of {} elements failed, the first, element {}, at t = {:g} with {} = {:g}{}",
                              body.built->spec.name, body.count, body.failed_at.size(),
                              body.samples->element_label(body.first.element), first,
                              name_of(kLimits, body.first.limit), body.first.value,
                              last > first ? fmt::format(", the last at t = {:g}", last) : ""));
  }
  if (!out.empty()) out.back() += fmt::format("; {:g} of energy was lost with what failed", energy_);
  return out;
}

void Erosion::save(std::vector<double>& out) const {
  out.push_back(energy_);
  for (const Body& body : bodies_) {
    out.insert(out.end(), {body.count, static_cast<double>(body.first.element), static_cast<double>(body.first.limit),
                           body.first.value});
    for (std::size_t e = 0; e < body.failed_at.size(); ++e)
      if (body.failed_at[e] != kNever) out.insert(out.end(), {static_cast<double>(e), body.failed_at[e]});
  }
}

// Steps that are taken again find what they had: nothing is made anew where nothing differs.
void Erosion::restore(ConstSpan& in) {
  const auto take = [&] {
    if (in.empty())
      throw Error(StatusCode::invalid_input, "the saved numbers end within the elements that have failed");
    const double x = in.front();
    in = in.subspan(1);
    return x;
  };
  const auto whole = [&](double least, double below) {
    const double x = take();
    if (!(x >= least && x < below) || x != std::floor(x))
      throw Error(StatusCode::invalid_input, "the saved numbers do not fit the elements that have failed");
    return static_cast<Index>(x);
  };
  bool changed = false;
  energy_ = take();
  for (Body& body : bodies_) {
    const auto elements = static_cast<double>(body.failed_at.size());
    const Index count = whole(0, elements + 1);
    body.first.element = whole(-1, elements);
    body.first.limit = static_cast<Limit>(whole(0, std::size(kLimits)));
    body.first.value = take();
    std::vector<double> failed_at(body.failed_at.size(), kNever);
    for (Index k = 0; k < count; ++k) {
      const Index e = whole(0, elements);
      failed_at[at(e)] = take();
    }
    if (failed_at == body.failed_at) continue;
    std::copy(failed_at.begin(), failed_at.end(), body.failed_at.begin());  // where they stay: failed_at()
    mark(body);
    changed = true;
  }
  if (changed) mechanism_.system.finish();
}

void add_erosion(Mechanism& out) {
  auto erosion = std::make_unique<Erosion>(out);
  bool any = false;
  for (const BuiltBody& body : out.bodies) {
    if (body.spec.erosion() == nullptr) continue;
    erosion->add(body);
    any = true;
  }
  if (any) out.erosion = &out.system.add(std::move(erosion));
}

}  // namespace espalier::dynamics::model
