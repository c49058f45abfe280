#include "dynamics/page/failing_faces.hpp"

#include <algorithm>
#include <limits>
#include <map>

#include "base/at.hpp"
#include "dynamics/model/erosion/erosion.hpp"

namespace espalier::dynamics::page {

std::vector<TwoSidedFace> all_faces(const Mesh& mesh) {
  std::vector<TwoSidedFace> faces;
  std::map<std::vector<Index>, std::size_t> met;  // by the corners
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const ElementShape& shape = shape_of(mesh.type(e));
    if (shape.dimension != 3) continue;
    for (int f = 0; f < static_cast<int>(shape.faces.size()); ++f) {
      std::vector<Index> corners = mesh.face_nodes({e, f});
      corners.resize(at(shape_of(shape.faces[at(f)].type).corners));
      std::sort(corners.begin(), corners.end());
      const auto [it, fresh] = met.emplace(std::move(corners), faces.size());
      faces.push_back({{e, f}, fresh ? -1 : faces[it->second].face.element});
      if (!fresh) faces[it->second].behind = e;
    }
  }
  return faces;
}

std::vector<double> times_of_triangles(const model::Mechanism& mechanism, const Drawn& drawn) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  if (mechanism.erosion == nullptr) return {};
  std::vector<double> times;
  Index of = -1;                  // the body that `failed_at` belongs to
  std::vector<double> failed_at;  // by elements of its mesh
  for (const Drawn::Owner& owner : drawn.owners()) {
    if (owner.body >= 0 && owner.body != of) {
      of = owner.body;
      const model::BuiltBody& body = mechanism.bodies[at(of)];
      const auto numbers = body.flexible->assembly().numbers_by_label();
      const std::vector<double>& known = *mechanism.erosion->failed_at(body.spec.name);
      failed_at.assign(at(body.mesh->element_count()), kNever);
      for (Index e = 0; e < body.mesh->element_count(); ++e)
        if (const auto it = numbers.find(body.mesh->element_label(e)); it != numbers.end())
          failed_at[at(e)] = known[at(it->second)];
    }
    times.push_back(owner.body < 0 || owner.behind < 0 ? -kNever : failed_at[at(owner.behind)]);
    times.push_back(owner.body < 0 ? kNever : failed_at[at(owner.element)]);
  }
  return times;
}

}  // namespace espalier::dynamics::page
