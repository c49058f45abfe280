#include "dynamics/model/fields/sums.hpp"

#include <fmt/format.h>

#include <numeric>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/forces/vector_function.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

/// Whether a name fits a pattern with * for any letters.
bool fits(std::string_view name, std::string_view pattern) {
  if (pattern.empty()) return name.empty();
  if (pattern.front() == '*') return fits(name, pattern.substr(1)) || (!name.empty() && fits(name.substr(1), pattern));
  return !name.empty() && name.front() == pattern.front() && fits(name.substr(1), pattern.substr(1));
}

std::vector<Index> elements_at(const SampledBody& samples, const Where& where) {
  std::vector<Index> out(at(samples.elements()));
  std::iota(out.begin(), out.end(), 0);
  if (where.kind == Where::Kind::whole) return out;
  out.clear();
  const std::string& name = samples.body().spec.name;
  if (where.kind == Where::Kind::element) {
    out.push_back(samples.find_element(where.label));
    if (out.back() < 0) throw std::invalid_argument(fmt::format("'{}' has no element {}", name, where.label));
    return out;
  }
  if (where.kind != Where::Kind::set && where.kind != Where::Kind::elements)
    throw std::invalid_argument(fmt::format(
        "strain energy is that of elements: {0}.strain_energy, {0}[element 7], {0}[SET OF ELEMENTS]", name));
  const Mesh* mesh = named_mesh(samples.body());
  if (mesh == nullptr) throw std::invalid_argument(fmt::format("'{}' has no sets; write {}[element 2]", name, name));
  if (line_file(samples.body()) != nullptr) return mesh->element_set(where.set);  // halves of elements have one label
  for (const Index e : mesh->element_set(where.set))
    if (const Index own = samples.find_element(mesh->element_label(e)); own >= 0) out.push_back(own);
  return out;
}

}  // namespace

std::function<Vec3(const Sample&)> reaction_on(Mechanism& mechanism, const BuiltBody& body, const Where& where,
                                               bool moment) {
  if (body.reduced != nullptr || body.flexible == nullptr)
    throw std::invalid_argument(
        fmt::format("'{}' is {}, without nodes that constraints act on: sum its joints, as in joints[wall*].force",
                    body.spec.name, body.reduced != nullptr ? "reduced" : "rigid"));
  const std::vector<Index> nodes = nodes_at(SampledBody(body), where);
  return [&mechanism, &body, nodes, moment](const Sample& s) {
    const SparsePattern& pattern = mechanism.system.constraint_pattern();
    std::vector<double> values(at(pattern.nonzeros())), force(s.state->v.size());
    if (!values.empty()) mechanism.system.constraints(s.state->t, s.state->q, s.state->v, {{}, {}, {}, values});
    for (std::size_t row = 0; row + 1 < pattern.ptr.size(); ++row)
      for (auto k = at(pattern.ptr[row]); k < at(pattern.ptr[row + 1]); ++k)
        force[at(pattern.ind[k])] -= values[k] * s.state->lambda[row];
    const FlexibleBody& flexible = *body.flexible;
    const Index each = flexible.vertices_per_node();
    Vec3 sum = Vec3::Zero();
    for (const Index node : nodes)
      for (Index k = 0; k < (moment ? each : 1); ++k) {
        const Index vertex = node * each + k;
        const Eigen::Map<const Vec3> f(&force[at(flexible.coordinate(vertex))]),
            x(&s.state->q[at(flexible.configuration(vertex))]);
        sum += moment ? Vec3(x.cross(f)) : Vec3(f);
      }
    return sum;
  };
}

std::function<Vec3(const Sample&)> sum_of_joints(const Mechanism& mechanism, const std::string& pattern, bool moment) {
  struct JointTerm {
    const Joint* joint;
    int side;
    VectorFunctionPtr force, moment;
  };
  std::vector<JointTerm> parts;
  std::string names;
  for (const Joint* joint : mechanism.joints) {
    names += (names.empty() ? "" : ", ") + joint->name();
    if (!fits(joint->name(), pattern)) continue;
    const int side = dynamic_cast<const GroundFrame*>(&joint->frame(1)) != nullptr ? 0 : 1;
    parts.push_back({joint, side, reaction_of(*joint, side, false), reaction_of(*joint, side, true)});
  }
  if (parts.empty())
    throw std::invalid_argument(
        fmt::format("no joint fits '{}'; there {}", pattern, names.empty() ? "are none" : "are " + names));
  return [parts, moment](const Sample& s) {
    Vec3 sum = Vec3::Zero();
    for (const JointTerm& part : parts) {
      const Vec3 force = part.force->value(s.state->view());
      if (!moment) {
        sum += force;
      } else {
        const Vec3 origin = part.joint->frame_motion(s.state->q, s.state->v, part.side).r;
        sum += part.moment->value(s.state->view()) + origin.cross(force);
      }
    }
    return sum;
  };
}

std::function<double(const Sample&)> strain_energy_of(Mechanism& mechanism, const BuiltBody& body, const Where& where) {
  if (body.reduced != nullptr && where.kind == Where::Kind::whole)
    return [&body](const Sample& s) { return body.reduced->strain_energy(s.state->q); };
  const auto samples = std::make_shared<const SampledBody>(body);
  const std::vector<Index> elements = elements_at(*samples, where);
  return [&mechanism, samples, elements](const Sample& s) {
    FieldTable table = samples->sample(*s.state, elements, &mechanism.pool, true);
    samples->clear_failed(elements, table);
    return std::accumulate(table.energy.begin(), table.energy.end(), 0.0);
  };
}

}  // namespace espalier::dynamics::model
