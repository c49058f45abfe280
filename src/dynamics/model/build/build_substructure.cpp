// Substructures: bodies whose mass and stiffness another program has made.
#include <fmt/format.h>

#include "dynamics/bodies/reduced_body.hpp"
#include "dynamics/mesh/file_source.hpp"
#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {
namespace {

FileMatrix read(const SubstructureSpec::Matrix& matrix) {
  FileMatrix result;
  at_place(matrix.place, [&] {
    if (!file_exists(matrix.path))
      throw std::invalid_argument(
          fmt::format("there is no file '{}'; paths are relative to the folder of the model", matrix.path));
    result = read_file_matrix(matrix.path, matrix.name);
  });
  return result;
}

}  // namespace

void build_substructure(const Description& model, Mechanism& out, BuiltBody& body) {
  auto& spec = std::get<SubstructureSpec>(body.spec.shape);
  if (!spec.nodes_path.empty())
    for (const GridPoint& point : read_grid_points(spec.nodes_path))
      spec.nodes.push_back({point.label, Vec3(point.position[0], point.position[1], point.position[2]), 0});
  Substructure substructure = arrange(body.spec.name, read(spec.mass), read(spec.stiffness), std::move(spec.nodes));
  const ReductionOptions options = body.spec.reduction.value_or(ReductionOptions{});
  SubstructureBody made = make_substructure(substructure, options);
  spec.nodes = std::move(substructure.nodes);  // with the components that the matrices have
  for (const auto& line : spec.lines)
    for (const std::int64_t label : line)
      if (!spec.find(label)) throw std::invalid_argument(fmt::format("'lines': there is no node {}", label));
  body.flexible = &made.points->body();
  add_reduced(std::make_unique<ReducedBody>(std::move(made.points), std::move(made.shapes), std::move(made.inertia), 0),
              model, out, body);
}

}  // namespace espalier::dynamics::model
