#include "dynamics/model/quantities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace espalier::dynamics::model {
namespace {

using VectorValue = std::function<Vec3(const Sample&)>;
using ScalarValue = std::function<double(const Sample&)>;

/// What one object offers.
struct Offer {
  std::vector<std::pair<std::string, VectorValue>> vectors;
  std::vector<std::pair<std::string, ScalarValue>> scalars;
};

Vec3 to_vec(const Point& p) { return {p[0], p[1], p[2]}; }

Offer of_frame(const Frame& frame) {
  const auto motion = [&frame](const Sample& s) {
    FrameMotion m;
    frame.motion(s.state->q, s.state->v, m);
    return m;
  };
  // Twist derivative: J a + bias.
  const auto acceleration = [&frame, motion](const Sample& s) {
    const FrameMotion m = motion(s);
    const auto coordinates = frame.coordinates();
    std::vector<double> j(6 * coordinates.size());
    frame.jacobian(s.state->q, j.data());
    Vec3 sum = m.bias_acc;
    for (std::size_t k = 0; k < coordinates.size(); ++k)
      sum += s.state->a[static_cast<std::size_t>(coordinates[k])] * Vec3(j[6 * k], j[6 * k + 1], j[6 * k + 2]);
    return sum;
  };
  return {{{"position", [motion](const Sample& s) -> Vec3 { return motion(s).r; }},
           {"velocity", [motion](const Sample& s) -> Vec3 { return motion(s).vel; }},
           {"acceleration", acceleration},
           {"rotation", [motion](const Sample& s) -> Vec3 { return rotation_log(motion(s).rot); }},
           {"angular_velocity", [motion](const Sample& s) -> Vec3 { return motion(s).omega; }}},
          {}};
}

Offer of_flexible(const FlexibleBody& body) {
  return {
      {{"position", [&body](const Sample& s) { return to_vec(body.mass_properties(s.state->q, s.state->v).centre); }},
       {"velocity",
        [&body](const Sample& s) -> Vec3 {
          const MassProperties p = body.mass_properties(s.state->q, s.state->v);
          return to_vec(p.momentum) / p.mass;
        }},
       {"momentum", [&body](const Sample& s) { return to_vec(body.mass_properties(s.state->q, s.state->v).momentum); }},
       {"angular_momentum",
        [&body](const Sample& s) { return to_vec(body.mass_properties(s.state->q, s.state->v).angular_momentum); }}},
      {{"mass", [&body](const Sample& s) { return body.mass_properties(s.state->q, s.state->v).mass; }}}};
}

template <class Source>
Offer of_wrench(const Source& wrench) {
  return {{{"force", [wrench](const Sample& s) { return wrench(s).force; }},
           {"moment", [wrench](const Sample& s) { return wrench(s).moment; }}},
          {}};
}

Offer of_energy(Mechanism& mechanism) {
  const auto energy = [&mechanism](const Sample& s) {
    if (!s.energy) s.energy = mechanism.system.energy(s.state->view());
    return *s.energy;
  };
  return {{},
          {{"kinetic", [energy](const Sample& s) { return energy(s).kinetic; }},
           {"potential", [energy](const Sample& s) { return energy(s).potential; }},
           {"total", [energy](const Sample& s) { return energy(s).total(); }}}};
}

Offer of_run(const std::string& object) {
  if (object == "constraints")
    return {{},
            {{"position", [](const Sample& s) { return s.report.levels.position; }},
             {"velocity", [](const Sample& s) { return s.report.levels.velocity; }},
             {"acceleration", [](const Sample& s) { return s.report.levels.acceleration; }}}};
  return {{},
          {{"h", [](const Sample& s) { return s.report.h; }},
           {"order", [](const Sample& s) { return static_cast<double>(s.report.order); }},
           {"newton", [](const Sample& s) { return static_cast<double>(s.report.newton_iterations); }},
           {"factorizations", [](const Sample& s) { return static_cast<double>(s.report.factorizations); }},
           {"error", [](const Sample& s) { return s.report.error; }}}};
}

/// A frame at the centre of mass that lives as long as the quantities made of it.
Offer of_rigid(const RigidBody& body) {
  const auto frame = std::make_shared<RigidFrame>(body);
  Offer offer = of_frame(*frame);
  for (auto& [name, value] : offer.vectors) value = [frame, inner = value](const Sample& s) { return inner(s); };
  return offer;
}

Offer find_offer(Mechanism& mechanism, const std::string& object, const std::string& request, const Place& place) {
  if (const BuiltBody* body = mechanism.body(object))
    return body->rigid != nullptr ? of_rigid(*body->rigid) : of_flexible(*body->flexible);
  if (const auto it = mechanism.markers.find(object); it != mechanism.markers.end()) return of_frame(*it->second);
  if (const Joint* joint = mechanism.joint(object)) {
    Offer offer = of_wrench([joint](const Sample& s) { return joint->reaction(s.state->view(), 1); });
    offer.scalars.emplace_back("coordinate", [joint](const Sample& s) { return joint->coordinate(s.state->q, 0); });
    return offer;
  }
  if (const BuiltForce* f = mechanism.force(object))
    return of_wrench([f = *f](const Sample& s) { return f.force->applied(s.state->view(), f.side); });
  if (object == "energy") return of_energy(mechanism);
  if (object == "constraints" || object == "step") return of_run(object);
  std::vector<std::string> names = {"energy", "constraints", "step"};
  for (const BuiltBody& b : mechanism.bodies) names.push_back(b.spec.name);
  for (const auto& [name, frame] : mechanism.markers) names.push_back(name);
  for (const Joint* j : mechanism.joints) names.push_back(j->name());
  for (const BuiltForce& f : mechanism.forces) names.push_back(f.force->name());
  fail(place, fmt::format("\"{}\": there is no body, marker, joint or force '{}'{}", request, object,
                          suggestion(object, names)));
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == '.') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

}  // namespace

std::vector<Quantity> find_quantities(Mechanism& mechanism, const std::string& request, const Place& place) {
  const std::vector<std::string> parts = split(request);
  const Offer offer = find_offer(mechanism, parts[0], request, place);
  std::vector<std::string> known;
  for (const auto& [name, value] : offer.scalars) known.push_back(name);
  for (const auto& [name, value] : offer.vectors) known.push_back(name);
  const std::string what = parts.size() > 1 ? parts[1] : "";
  for (const auto& [name, value] : offer.scalars) {
    if (name != what) continue;
    if (parts.size() > 2) fail(place, fmt::format("\"{}\": '{}' is a number without components", request, what));
    return {{request, value}};
  }
  for (const auto& [name, value] : offer.vectors) {
    if (name != what) continue;
    if (parts.size() > 3) fail(place, fmt::format("\"{}\": only one of x, y, z, norm may follow", request));
    std::vector<Quantity> result;
    for (int i = 0; i < 3; ++i) {
      const std::string component(1, "xyz"[i]);
      if (parts.size() == 2 || parts[2] == component)
        result.push_back(
            {fmt::format("{}.{}.{}", parts[0], what, component), [f = value, i](const Sample& s) { return f(s)[i]; }});
    }
    if (parts.size() == 3 && parts[2] == "norm")
      result.push_back({request, [f = value](const Sample& s) { return f(s).norm(); }});
    if (!result.empty()) return result;
    fail(place, fmt::format("\"{}\": unknown component '{}'; known are x, y, z, norm", request, parts[2]));
  }
  fail(place, fmt::format("\"{}\": '{}' has no '{}'{}", request, parts[0], what, suggestion(what, known)));
}

}  // namespace espalier::dynamics::model
