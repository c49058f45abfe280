#include "dynamics/model/output/quantities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "dynamics/model/build/functions.hpp"
#include "dynamics/model/erosion/erosion.hpp"
#include "dynamics/model/fields/field_request.hpp"

namespace espalier::dynamics::model {
namespace {

using VectorValue = std::function<Vec3(const Sample&)>;
using ScalarValue = std::function<double(const Sample&)>;

/// What one object offers for output.
struct Columns {
  std::vector<std::pair<std::string, VectorValue>> vectors;
  std::vector<std::pair<std::string, ScalarValue>> scalars;
};

Vec3 to_vec(const Point& p) { return {p[0], p[1], p[2]}; }

/// Everything that has derivatives serves here too.
Columns columns_of(const Offer& offer) {
  Columns result;
  for (const auto& [name, f] : offer.vectors)
    result.vectors.emplace_back(name, [f = f](const Sample& s) { return f->value(s.state->view()); });
  for (const auto& [name, f] : offer.scalars)
    result.scalars.emplace_back(name, [f = f](const Sample& s) { return f->value(s.state->view()); });
  return result;
}

/// Acceleration of the frame's origin: J a + bias.
VectorValue acceleration_of(std::shared_ptr<const Frame> frame) {
  return [frame = std::move(frame)](const Sample& s) {
    FrameMotion m;
    frame->motion(s.state->q, s.state->v, m);
    const auto coordinates = frame->coordinates();
    std::vector<double> j(6 * coordinates.size());
    frame->jacobian(s.state->q, j.data());
    Vec3 sum = m.bias_acc;
    for (std::size_t k = 0; k < coordinates.size(); ++k)
      sum += s.state->a[static_cast<std::size_t>(coordinates[k])] * Vec3(j[6 * k], j[6 * k + 1], j[6 * k + 2]);
    return sum;
  };
}

/// @param massless  there is no density: a place is all that it has
template <class Body>
Columns of_flexible(const Body& body, bool massless) {
  if (massless)
    return {{{"position", [&body](const Sample& s) { return to_vec(body.mass_properties(s.state->q, {}).centre); }}},
            {}};
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

Columns of_energy(Mechanism& mechanism) {
  const auto energy = [&mechanism](const Sample& s) {
    if (!s.energy) s.energy = mechanism.system.energy(s.state->view());
    return *s.energy;
  };
  Columns columns{{},
                  {{"kinetic", [energy](const Sample& s) { return energy(s).kinetic; }},
                   {"potential", [energy](const Sample& s) { return energy(s).potential; }},
                   {"total", [energy](const Sample& s) { return energy(s).total(); }}}};
  if (const Erosion* erosion = mechanism.erosion; erosion != nullptr)
    columns.scalars.emplace_back("failed", [erosion](const Sample&) { return erosion->lost_energy(); });
  return columns;
}

Columns of_contact(const BuiltContact& contact) {
  using contact::ContactReport;
  const auto report = [&contact](const Sample& s) {
    for (const auto& [known, found] : s.contacts)
      if (known == &contact) return found;
    return s.contacts.emplace_back(&contact, contact.report(s.state->view())).second;
  };
  const auto number = [report](double ContactReport::*member) {
    return [report, member](const Sample& s) { return report(s).*member; };
  };
  return {{{"force", [report](const Sample& s) { return report(s).force; }},
           {"moment", [report](const Sample& s) { return report(s).moment; }}},
          {{"normal_force", number(&ContactReport::normal_force)},
           {"friction_force", number(&ContactReport::friction_force)},
           {"penetration", number(&ContactReport::penetration)},
           {"pressure", number(&ContactReport::pressure)},
           {"area", number(&ContactReport::area)},
           {"slip_speed", number(&ContactReport::slip_speed)},
           {"points", number(&ContactReport::points)},
           {"slipping", number(&ContactReport::slipping)},
           {"energy", number(&ContactReport::energy)},
           {"impulse", number(&ContactReport::impulse)},
           {"impacts", number(&ContactReport::impacts)}}};
}

Columns of_run(const std::string& object) {
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

void add_joint_columns(const Joint& joint, Columns& columns) {
  columns.scalars.emplace_back("coordinate", [&joint](const Sample& s) { return joint.coordinate(s.state->q, 0); });
  const JointRow::Term& term = joint.rows().front().terms.front();
  if (!term.rolling) return;
  columns.vectors.emplace_back("contact_point", [&joint, shape = *term.rolling](const Sample& s) {
    return rolling_contact(shape, joint.frame_motion(s.state->q, {}, 0), joint.frame_motion(s.state->q, {}, 1));
  });
}

Columns find_columns(Mechanism& mechanism, const std::string& object, const std::string& request, const Place& place) {
  if (object == "energy") return of_energy(mechanism);
  if (object == "constraints" || object == "step") return of_run(object);
  if (const BuiltContact* contact = mechanism.surface_contact(object)) return of_contact(*contact);
  const BuiltBody* body = mechanism.body(object);
  if (body != nullptr && body->reduced != nullptr) return of_flexible(*body->reduced, body->spec.massless);
  const std::optional<Offer> offer = functions_of(mechanism, object);
  if (body != nullptr && body->flexible != nullptr) {
    Columns columns = of_flexible(*body->flexible, body->spec.massless);
    for (auto& [name, value] : columns_of(*offer).scalars) columns.scalars.emplace_back(name, value);
    return columns;
  }
  if (!offer) {
    std::vector<std::string> names = {"energy", "constraints", "step"};
    for (const std::string& name : object_names(mechanism)) names.push_back(name);
    fail(place, fmt::format("\"{}\": there is no body, marker, joint, support, force or contact '{}'{}", request,
                            object, suggestion(object, names)));
  }
  Columns columns = columns_of(*offer);
  if (body != nullptr && body->rigid != nullptr)
    columns.vectors.emplace_back("acceleration", acceleration_of(std::make_shared<RigidFrame>(*body->rigid)));
  if (body != nullptr && body->point != nullptr)
    columns.vectors.emplace_back("acceleration", acceleration_of(std::make_shared<PointFrame>(*body->point)));
  if (const Frame* frame = frame_named(mechanism, object))
    columns.vectors.emplace_back("acceleration", acceleration_of({std::shared_ptr<const Frame>(), frame}));
  if (const Joint* joint = mechanism.joint(object)) add_joint_columns(*joint, columns);
  return columns;
}

/// The dimension of inputs, sensors, and what depends on the kind of a joint or spring: nothing.
std::string dimension_of(const std::string& object, const std::string& what) {
  static const std::map<std::string, std::string> kDimensions = {{"position", "length"},
                                                                 {"velocity", "length/time"},
                                                                 {"acceleration", "length/time^2"},
                                                                 {"rotation", "angle"},
                                                                 {"angular_velocity", "angle/time"},
                                                                 {"momentum", "mass*length/time"},
                                                                 {"angular_momentum", "mass*length^2/time"},
                                                                 {"mass", "mass"},
                                                                 {"force", "force"},
                                                                 {"moment", "force*length"},
                                                                 {"angle", "angle"},
                                                                 {"angular_speed", "angle/time"},
                                                                 {"displacement", "length"},
                                                                 {"displacement_x", "length"},
                                                                 {"displacement_y", "length"},
                                                                 {"speed_x", "length/time"},
                                                                 {"speed_y", "length/time"},
                                                                 {"bend_angle", "angle"},
                                                                 {"bend_speed", "angle/time"},
                                                                 {"tooth_force", "force"},
                                                                 {"separating_force", "force"},
                                                                 {"tension", "force"},
                                                                 {"first_tension", "force"},
                                                                 {"length", "length"},
                                                                 {"speed", "length/time"},
                                                                 {"friction_force", "force"},
                                                                 {"friction_moment", "force*length"},
                                                                 {"stop_force", "force"},
                                                                 {"longitudinal_force", "force"},
                                                                 {"lateral_force", "force"},
                                                                 {"contact_point", "length"},
                                                                 {"stop_moment", "force*length"},
                                                                 {"pressure", "force/length^2"},
                                                                 {"normal_force", "force"},
                                                                 {"penetration", "length"},
                                                                 {"area", "length^2"},
                                                                 {"slip_speed", "length/time"},
                                                                 {"energy", "energy"},
                                                                 {"failed_elements", "1"},
                                                                 {"points", "1"},
                                                                 {"slipping", "1"}};
  if (object == "inputs" || object == "sensors" || object == "constraints") return "";
  if (object == "energy") return "energy";
  if (object == "step") return what == "h" ? "time" : "1";
  const auto known = kDimensions.find(what);
  return known == kDimensions.end() ? "" : known->second;
}

}  // namespace

std::vector<SimulationQuantity> list_quantities(Mechanism& mechanism) {
  std::vector<std::string> objects = object_names(mechanism);
  objects.insert(objects.end(), {"energy", "constraints", "step"});
  std::vector<SimulationQuantity> list;
  for (const std::string& object : objects) {
    const Columns columns = find_columns(mechanism, object, object, {});
    for (const auto& [name, value] : columns.vectors)
      for (const char* component : {"x", "y", "z", "norm"})
        list.push_back({fmt::format("{}.{}.{}", object, name, component), dimension_of(object, name)});
    for (const auto& [name, value] : columns.scalars)
      list.push_back({fmt::format("{}.{}", object, name), dimension_of(object, name)});
    if (const BuiltBody* body = mechanism.body(object))
      for (const std::string& name : field_names(*body)) list.push_back({name, field_dimension(name)});
  }
  return list;
}

namespace {

/// The same of linear statics, once that is there. What tells of the run is no function of the state.
Quantity in_linear_statics(Quantity q, const Mechanism& mechanism) {
  const std::vector<std::string> parts = split_name(q.name);
  if (parts[0] == "step" || parts[0] == "constraints") return q;
  const bool energy = q.name.find("energy") != std::string::npos;
  q.value = [value = std::move(q.value), &mechanism, energy](const Sample& s) {
    if (!mechanism.linear) return value(s);
    const auto at = [&](const State& state) {
      Sample there{&state, s.report};
      there.load = s.load;
      return value(there);
    };
    const double share = s.load && mechanism.linear->load() != 0 ? *s.load / mechanism.linear->load() : 1;
    if (energy) return mechanism.linear->energy(at, share);
    return mechanism.linear->of([&](const State& state) { return std::vector{at(state)}; }, share)[0];
  };
  return q;
}

std::vector<Quantity> find_plain(Mechanism& mechanism, const std::string& request, const Place& place) {
  if (is_field_request(request)) return find_field_quantities(mechanism, request, place);
  const std::vector<std::string> parts = split_name(mechanism, request);
  const Columns offer = find_columns(mechanism, parts[0], request, place);
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

}  // namespace

std::vector<Quantity> find_quantities(Mechanism& mechanism, const std::string& request, const Place& place) {
  std::vector<Quantity> found = find_plain(mechanism, request, place);
  for (Quantity& q : found) q = in_linear_statics(std::move(q), mechanism);
  return found;
}

}  // namespace espalier::dynamics::model
