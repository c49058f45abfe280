#include "dynamics/model/fields/field_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/at.hpp"
#include "base/named.hpp"
#include "dynamics/model/assembly/line_elements.hpp"
#include "dynamics/model/build/functions.hpp"
#include "dynamics/model/fields/field_quantity.hpp"
#include "dynamics/model/fields/sums.hpp"

namespace espalier::dynamics::model {
namespace {

struct FieldRequest {
  std::string text, object, where, family;
  bool bracket = false;
  std::vector<std::string> rest;  // behind the family
};

std::optional<FieldRequest> parse(const std::string& text) {
  FieldRequest r;
  r.text = text;
  const std::size_t open = text.find('['), dot = text.find('.');
  std::string tail;
  if (open != std::string::npos && open < dot) {
    const std::size_t close = text.find(']', open);
    if (close == std::string::npos) return std::nullopt;
    r.object = text.substr(0, open);
    r.where = text.substr(open + 1, close - open - 1);
    r.bracket = true;
    tail = text.substr(close + 1);
    if (!tail.empty() && tail.front() == '.') tail.erase(0, 1);
  } else {
    if (dot == std::string::npos) return std::nullopt;
    r.object = text.substr(0, dot);
    tail = text.substr(dot + 1);
  }
  std::vector<std::string> parts = split_name(tail);
  r.family = parts.front();
  r.rest.assign(parts.begin() + 1, parts.end());
  return r;
}

/// What a place on a body has.
struct Family {
  const char *name, *dimension;  // ""; each component has its own
  std::optional<FieldKind> field;
};
constexpr Family kFamilies[] = {{"stress", "force/length^2", FieldKind::stress},
                                {"strain", "1", FieldKind::strain},
                                {"section", "", FieldKind::section},
                                {"strain_energy", "energy", {}},
                                {"reaction", "force", {}},
                                {"reaction_moment", "force*length", {}}};

const Family* family_of(const std::string& name) {
  for (const Family& family : kFamilies)
    if (family.name == name) return &family;
  return nullptr;
}

constexpr base::Named<Statistic> kStatistics[] = {
    {"max", Statistic::max}, {"min", Statistic::min}, {"maxabs", Statistic::maxabs}, {"mean", Statistic::mean}};

/// Takes a statistic from the end of the words.
Statistic take_statistic(std::vector<std::string>& words) {
  if (words.empty()) return Statistic::none;
  for (const auto& [name, statistic] : kStatistics)
    if (words.back() == name) {
      words.pop_back();
      return statistic;
    }
  return Statistic::none;
}

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (std::size_t k = 0; k < words.size(); ++k) text += (k > 0 ? between : "") + words[k];
  return text;
}

bool is_line(const SampledBody& body) { return body.kind() == FieldBody::beam || body.kind() == FieldBody::cable; }

std::vector<Measure> measures_of(const SampledBody& body, FieldKind kind, const Where& where, Statistic statistic) {
  const std::string& name = body.body().spec.name;
  if (kind == FieldKind::section) {
    if (body.kind() == FieldBody::solid)
      throw std::invalid_argument(fmt::format(
          "'{}' is a solid: sections with forces are those of beams, cables and shells; a joint or .reaction gives the "
          "sum over a face, .stress.xx.mean of a face the mean stress",
          name));
    return section_measures(body.kind());
  }
  if (!is_line(body)) return tensor_measures(kind == FieldKind::stress);
  if (kind == FieldKind::strain)
    throw std::invalid_argument(fmt::format("'{}' is a line: ask for .section or .stress", name));
  const bool point = where.kind == Where::Kind::point && body.kind() == FieldBody::beam;
  if (point && statistic != Statistic::none)
    throw std::invalid_argument("a point of the material has one stress; leave max, min or mean out");
  if (!point && statistic == Statistic::mean)
    throw std::invalid_argument(
        "the mean stress of a section is .section.N over its area; .max, .min and .maxabs are those of its outline");
  return fibre_measures(body, statistic);
}

/// A fibre lies in the section.
void check_fibre(const SampledBody& body, const Sites& sites) {
  const auto* beam = std::get_if<BeamSpec>(&body.body().spec.shape);
  if (beam == nullptr) return;
  const std::optional<SectionOutline> outline = section_of_chain(*beam, line_chains(body.body()).front()).outline;
  if (!outline) return;
  constexpr double kSlack = 1 + 1e-6;
  const SectionOutline& o = *outline;
  for (const Site& site : sites.list) {
    if (!site.fibre) continue;
    const bool inside = o.radius > 0
                            ? std::hypot(site.y, site.z) <= kSlack * o.radius
                            : std::abs(site.y) <= kSlack * 0.5 * o.height && std::abs(site.z) <= kSlack * 0.5 * o.width;
    if (!inside)
      throw std::invalid_argument(
          fmt::format("the point lies beside '{}': {:g} along y and {:g} along z from its axis, outside of the section",
                      body.body().spec.name, site.y, site.z));
  }
}

std::vector<Quantity> of_measures(Mechanism& mechanism, const BuiltBody& body, FieldRequest r, FieldKind kind,
                                  Statistic otherwise) {
  std::vector<std::string> words = r.rest;
  Statistic statistic = take_statistic(words);
  const auto samples = std::make_shared<const SampledBody>(body);
  const Where where = r.bracket ? read_where(r.where) : Where{};
  const bool one_site =
      where.kind == Where::Kind::node || where.kind == Where::Kind::element || where.kind == Where::Kind::point;
  const bool of_outline = kind == FieldKind::stress && is_line(*samples) && where.kind != Where::Kind::point;
  if (statistic == Statistic::none && (!one_site || of_outline)) statistic = otherwise;
  if (statistic != Statistic::none && one_site && !of_outline)
    throw std::invalid_argument("one place has one value; leave max, min or mean out");
  const std::vector<Measure> known = measures_of(*samples, kind, where, statistic);
  const std::string component = joined(words, ".");
  std::vector<Measure> chosen;
  std::vector<std::string> names;
  for (const Measure& m : known) {
    names.push_back(m.name);
    const bool plain = m.linear || m.name == "xx";
    const bool direction = component.starts_with("direction_") && m.name.starts_with(component + ".");
    if (m.name == component || direction || (component.empty() && plain && m.name != "pressure")) chosen.push_back(m);
  }
  if (chosen.empty())
    throw std::invalid_argument(fmt::format("'{}' has no .{}.{}{}; known are {}", r.object, r.family, component,
                                            suggestion(component, names), joined(names, ", ")));
  const bool surfaces = kind != FieldKind::section && statistic != Statistic::none;
  const auto sites = std::make_shared<const Sites>(find_sites(*samples, where, statistic == Statistic::mean, surfaces));
  if (statistic == Statistic::none && sites->several)
    throw std::invalid_argument(
        "there are many places, and only one number is wanted: add .max, .min, .maxabs or .mean, or say where, as in "
        "BODY[node 12], BODY[element 7], BODY[x y z]");
  check_fibre(*samples, *sites);
  if (statistic == Statistic::none && of_outline && component != "von_mises")
    throw std::invalid_argument(
        "stresses differ over a section: add .max, .min or .maxabs, or give a point BODY[x y z] of the material");
  std::vector<Quantity> out;
  for (const Measure& m : chosen) {
    if (m.name.starts_with("direction_") && statistic != Statistic::none)
      throw std::invalid_argument("directions are those of one place; leave max, min or mean out");
    // A request without a component becomes one for each.
    std::string name = r.text;
    if (m.name != component) {
      const std::string last = words.size() == r.rest.size() ? "" : "." + r.rest.back();
      name = fmt::format("{}{}.{}.{}{}", r.object, r.bracket ? "[" + r.where + "]" : "", r.family, m.name, last);
    }
    auto field = std::make_shared<const FieldQuantity>(samples, sites, kind, m, statistic, &mechanism.pool);
    out.push_back({name, [field](const Sample& s) { return field->value(s); }, field});
  }
  return out;
}

std::vector<Quantity> of_vector(const FieldRequest& r, const std::function<Vec3(const Sample&)>& vector) {
  if (r.rest.size() > 1) throw std::invalid_argument("only one of x, y, z, norm may follow");
  const std::string head = fmt::format("{}{}.{}", r.object, r.bracket ? "[" + r.where + "]" : "", r.family);
  std::vector<Quantity> out;
  for (int i = 0; i < 3; ++i) {
    const std::string component(1, "xyz"[i]);
    if (r.rest.empty() || r.rest[0] == component)
      out.push_back({r.rest.empty() ? fmt::format("{}.{}", head, component) : r.text,
                     [vector, i](const Sample& s) { return vector(s)[i]; }});
  }
  if (!r.rest.empty() && r.rest[0] == "norm")
    out.push_back({r.text, [vector](const Sample& s) { return vector(s).norm(); }});
  if (out.empty())
    throw std::invalid_argument(fmt::format("unknown component '{}'; known are x, y, z, norm", r.rest[0]));
  return out;
}

std::vector<Quantity> of_body(Mechanism& mechanism, const FieldRequest& r, Statistic otherwise) {
  const BuiltBody* body = mechanism.body(r.object);
  if (body == nullptr) {
    std::vector<std::string> names;
    for (const BuiltBody& b : mechanism.bodies) names.push_back(b.spec.name);
    throw std::invalid_argument(fmt::format("there is no body '{}'{}", r.object, suggestion(r.object, names)));
  }
  const Family* family = family_of(r.family);
  if (family != nullptr && family->field) return of_measures(mechanism, *body, r, *family->field, otherwise);
  const Where where = r.bracket ? read_where(r.where) : Where{};
  if (r.family == "strain_energy") {
    if (!r.rest.empty()) throw std::invalid_argument("'strain_energy' is a number without components");
    return {{r.text, strain_energy_of(mechanism, *body, where)}};
  }
  if (r.family == "reaction" || r.family == "reaction_moment")
    return of_vector(r, reaction_on(mechanism, *body, where, r.family == "reaction_moment"));
  std::vector<std::string> names;
  for (const Family& known : kFamilies) names.emplace_back(known.name);
  throw std::invalid_argument(fmt::format("a place on a body has no '{}'{}", r.family, suggestion(r.family, names)));
}

}  // namespace

bool is_field_request(const std::string& request) {
  const std::optional<FieldRequest> r = parse(request);
  if (!r) return request.find('[') != std::string::npos;
  if (r->object == "inputs" || r->object == "sensors") return r->bracket;
  return r->bracket || family_of(r->family) != nullptr;
}

std::vector<Quantity> find_field_quantities(Mechanism& mechanism, const std::string& request, const Place& place,
                                            Statistic otherwise) {
  try {
    const std::optional<FieldRequest> r = parse(request);
    if (!r) throw std::invalid_argument("write BODY[PLACE].stress.xx, for instance rod[node 12].stress.von_mises");
    if (r->object == "joints" && r->bracket) {
      if (r->family != "force" && r->family != "moment")
        throw std::invalid_argument("joints[PATTERN] has .force and .moment, sums about the origin");
      return of_vector(*r, sum_of_joints(mechanism, r->where, r->family == "moment"));
    }
    return of_body(mechanism, *r, otherwise);
  } catch (const std::invalid_argument& error) {
    fail(place, fmt::format("\"{}\": {}", request, error.what()));
  } catch (const Error& error) {  // of a mesh
    fail(place, fmt::format("\"{}\": {}", request, error.what()));
  }
}

std::vector<Quantity> field_quantities_at(Mechanism& mechanism, const std::shared_ptr<const SampledBody>& body,
                                          const std::shared_ptr<const Sites>& sites, const std::string& request) {
  const std::size_t dot = std::min(request.find('.'), request.size());
  const std::string family = request.substr(0, dot), component = request.substr(std::min(dot + 1, request.size()));
  const Family* row = family_of(family);
  if (row == nullptr || !row->field)
    throw std::invalid_argument(
        fmt::format("a path has stress, strain or section, as in \"stress.xx\"; there is no '{}'", family));
  Where point;
  point.kind = Where::Kind::point;
  std::vector<Quantity> out;
  std::vector<std::string> names;
  for (const Measure& m : measures_of(*body, *row->field, point, Statistic::none)) {
    names.push_back(m.name);
    const bool all = component.empty() && (m.linear || m.name == "xx") && m.name != "pressure";
    if (!all && m.name != component && !(component.starts_with("direction_") && m.name.starts_with(component + ".")))
      continue;
    auto field = std::make_shared<const FieldQuantity>(body, sites, *row->field, m, Statistic::none, &mechanism.pool);
    out.push_back({family + "." + m.name, [field](const Sample& s) { return field->value(s); }, field});
  }
  if (out.empty())
    throw std::invalid_argument(fmt::format("'{}' has no .{}.{}{}; known are {}", body->body().spec.name, family,
                                            component, suggestion(component, names), joined(names, ", ")));
  return out;
}

std::string field_dimension(const std::string& request) {
  const std::optional<FieldRequest> r = parse(request);
  if (!r) return "";
  const std::string component = r->rest.empty() ? "" : r->rest.front();
  if (component.starts_with("direction_")) return "1";
  if (const Family* f = family_of(r->family); f != nullptr && f->dimension[0] != 0) return f->dimension;
  if (r->family == "force") return "force";
  if (r->family == "moment") return "force*length";
  if (component.starts_with("n") || component.starts_with("q")) return "force/length";
  if (component.starts_with("m")) return "force";
  return component.starts_with("N") || component.starts_with("Q") ? "force" : "force*length";
}

std::vector<std::string> field_names(const BuiltBody& body) {
  if (body.flexible == nullptr || std::holds_alternative<SubstructureSpec>(body.spec.shape)) return {};
  const std::string& name = body.spec.name;
  std::vector<std::string> out = {name + ".strain_energy"};
  if (body.mesh || std::holds_alternative<ShellSpec>(body.spec.shape)) {
    out.push_back(name + ".stress.von_mises.max");
  } else {
    out.push_back(name + ".section.N.maxabs");
    if (std::holds_alternative<BeamSpec>(body.spec.shape))
      for (const char* force : {"Qy", "Qz", "T", "My", "Mz"})
        out.push_back(fmt::format("{}.section.{}.maxabs", name, force));
  }
  return out;
}

}  // namespace espalier::dynamics::model
