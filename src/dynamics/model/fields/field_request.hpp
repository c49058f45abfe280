/// \file
/// Requests for what is in bodies: "beam[node 3].section.My", "plate[hole].stress.von_mises.max", "rod.strain_energy".
#pragma once

#include "dynamics/model/fields/measure.hpp"
#include "dynamics/model/output/quantities.hpp"

namespace espalier::dynamics::model {

/// Whether a request is one of these:
///   BODY[PLACE].stress .strain .section   a component, and a statistic (max min maxabs mean) where there are several
///                                         sites; see measure.hpp for components and sites.hpp for places
///   BODY[PLACE].strain_energy             of the body, an element, a set of elements
///   BODY[PLACE].reaction .reaction_moment [.x .y .z .norm]: of constraints on the nodes there, about the origin
///   joints[PATTERN].force .moment         [.x .y .z .norm]: sums over joints, on what is not the ground (or on b),
///                                         about the origin
[[nodiscard]] bool is_field_request(const std::string& request);
/// @param otherwise  the statistic of requests for many places that name none
/// @throws Error(invalid_input) naming the request
[[nodiscard]] std::vector<Quantity> find_field_quantities(Mechanism& mechanism, const std::string& request,
                                                          const Place& place, Statistic otherwise = Statistic::none);
/// What is asked for at each of some sites: "stress.xx", "strain.principal_1", "section.My"; without a component one
/// for each. Names are the full ones. @throws std::invalid_argument
[[nodiscard]] std::vector<Quantity> field_quantities_at(Mechanism& mechanism,
                                                        const std::shared_ptr<const SampledBody>& body,
                                                        const std::shared_ptr<const Sites>& sites,
                                                        const std::string& request);
/// "force/length^2" and the like; empty: not known.
[[nodiscard]] std::string field_dimension(const std::string& request);
/// Names of the most asked for of a flexible body, for lists.
[[nodiscard]] std::vector<std::string> field_names(const BuiltBody& body);

}  // namespace espalier::dynamics::model
