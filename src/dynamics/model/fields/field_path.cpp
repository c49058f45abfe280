#include "dynamics/model/fields/field_path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "base/at.hpp"
#include "base/output_file.hpp"
#include "dynamics/model/fields/field_quantity.hpp"
#include "dynamics/model/fields/field_request.hpp"

namespace espalier::dynamics::model {
namespace {

/// Evenly by length, the ends among them.
void spread(const PathSpec& spec, std::vector<Vec3>& points, std::vector<double>& length) {
  std::vector<double> ends(1, 0);
  for (std::size_t k = 1; k < spec.through.size(); ++k)
    ends.push_back(ends.back() + (spec.through[k] - spec.through[k - 1]).norm());
  if (!(ends.back() > 0)) throw std::invalid_argument("all points of 'through' are one");
  std::size_t piece = 1;
  for (int k = 0; k < spec.points; ++k) {
    const double s = ends.back() * k / (spec.points - 1);
    while (piece + 1 < ends.size() && s > ends[piece]) ++piece;
    const double span = ends[piece] - ends[piece - 1], share = span > 0 ? (s - ends[piece - 1]) / span : 0;
    points.emplace_back(spec.through[piece - 1] +
                        std::min(1.0, share) * (spec.through[piece] - spec.through[piece - 1]));
    length.push_back(s);
  }
}

}  // namespace

FieldPath::FieldPath(Mechanism& mechanism, const PathSpec& spec)
    : mechanism_(mechanism), name_(spec.name), body_(spec.body) {
  const BuiltBody* body = mechanism.body(spec.body);
  std::vector<std::string> names;
  for (const BuiltBody& b : mechanism.bodies) names.push_back(b.spec.name);
  if (body == nullptr)
    fail(spec.place, fmt::format("there is no body '{}'{}", spec.body, suggestion(spec.body, names)));
  try {
    spread(spec, points_, length_);
    const auto samples = std::make_shared<const SampledBody>(*body);
    const auto sites = std::make_shared<const Sites>(find_sites(*samples, points_));
    if (std::all_of(sites->list.begin(), sites->list.end(), [](const Site& site) { return site.terms.empty(); }))
      throw std::invalid_argument(fmt::format(
          "no point of the path lies in '{}'; points are in the coordinates of its mesh, without 'position' "
          "and 'rotation' of the body",
          spec.body));
    for (const std::string& request : spec.quantities)
      for (Quantity& q : field_quantities_at(mechanism, samples, sites, request)) quantities_.push_back(std::move(q));
  } catch (const std::invalid_argument& error) {
    fail(spec.place, fmt::format("path '{}': {}", spec.name, error.what()));
  }
}

SimulationPath FieldPath::at(const Sample& s) const {
  SimulationPath path{name_, body_, {}, s.time(), length_, {}, {}};
  for (const Vec3& x : points_) path.places.insert(path.places.end(), x.data(), x.data() + 3);
  for (const Quantity& q : quantities_) {
    path.quantities.push_back(q.name);
    const auto values = [&q](const State& state) { return q.field->values(Sample{&state, {}}); };
    const std::vector<double> column = mechanism_.linear ? mechanism_.linear->of(values) : values(*s.state);
    path.values.insert(path.values.end(), column.begin(), column.end());
  }
  return path;
}

void write_paths(const std::string& file, const std::vector<SimulationPath>& paths) {
  std::vector<std::string> columns;
  for (const SimulationPath& path : paths)
    for (const std::string& q : path.quantities)
      if (std::find(columns.begin(), columns.end(), q) == columns.end()) columns.push_back(q);
  base::OutputFile out(file);
  std::string line = "path,time,length,x,y,z";
  for (const std::string& q : columns) line += "," + q;
  out.write(line + "\n");
  for (const SimulationPath& path : paths)
    for (std::size_t k = 0; k < path.length.size(); ++k) {
      line = fmt::format("{},{},{},{},{},{}", path.name, path.t, path.length[k], path.places[3 * k],
                         path.places[3 * k + 1], path.places[3 * k + 2]);
      for (const std::string& q : columns) {
        const auto found = std::find(path.quantities.begin(), path.quantities.end(), q);
        line += ",";
        if (found == path.quantities.end()) continue;
        const auto column = static_cast<std::size_t>(found - path.quantities.begin());
        line += fmt::format("{}", path.values[column * path.length.size() + k]);
      }
      out.write(line + "\n");
    }
  out.commit();
}

}  // namespace espalier::dynamics::model
