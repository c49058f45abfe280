/// \file
/// Where on a body something is asked for: nodes, elements, points of the material, sets.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "dynamics/model/fields/sampled_body.hpp"

namespace espalier::dynamics::model {

/// The share of an element in what is at a site: factor * sum over its sample points of weight times value. `slope`:
/// the same for the difference of top and bottom of a shell; null: not of a shell.
struct SiteTerm {
  Index element = 0;
  double factor = 1;
  const SampleWeights* weights = nullptr;
  const SampleWeights* slope = nullptr;
};

/// One place with one value of everything: at a node the mean of its elements.
struct Site {
  std::vector<SiteTerm> terms;
  double weight = 0;          ///< in means over sites; together 1
  std::int64_t node = 0;      ///< label; 0: not a node
  Vec3 place = Vec3::Zero();  ///< in the axes of the mesh
  double y = 0, z = 0;        ///< of a fibre of a beam, from its axis
  bool fibre = false;         ///< y and z count
};

/// Sites, and the weights that their terms point to.
struct Sites {
  std::deque<SampleWeights> weights;
  std::vector<Site> list;
  bool several = false;  ///< a set or a whole body: only a statistic is one number
};

/// What stands in brackets: node 12, element 7, x y z, SET, face SET, nodes SET, elements SET, and for shells top,
/// middle or bottom behind it. Empty: the whole body.
struct Where {
  enum class Kind { whole, node, element, point, set, faces, nodes, elements };
  Kind kind = Kind::whole;
  std::int64_t label = 0;
  Vec3 point = Vec3::Zero();
  std::string set;
  std::optional<double> side;  ///< -1, 0, 1: bottom, middle, top
};
/// @throws std::invalid_argument that says what may stand there
[[nodiscard]] Where read_where(const std::string& text);

/// @param mean  for means: whole bodies and sets of elements by their volume, faces by their area, nodes alike
/// @param surfaces  of shells without a side: top and bottom, where the largest stresses are; else the middle
/// @throws std::invalid_argument for what is not there
[[nodiscard]] Sites find_sites(const SampledBody& body, const Where& where, bool mean, bool surfaces);

/// One for each point of the material; without terms where the point lies beside the body.
[[nodiscard]] Sites find_sites(const SampledBody& body, const std::vector<Vec3>& points);

/// Nodes of a set, or all. @throws as find_sites()
[[nodiscard]] std::vector<Index> nodes_at(const SampledBody& body, const Where& where);

}  // namespace espalier::dynamics::model
