/// \file
/// Quantities of the model with exact derivatives, by name, and expressions made of them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/forces/vector_function.hpp"
#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

class Mechanism;

/// What one object offers:
///   rigid BODY, MARKER  position velocity rotation angular_velocity
///   JOINT.a, FORCE.b    the same: a frame of a joint or force, a to d
///   JOINT               force moment on its frame b; angle, angular_speed (turns counted; joints with one axis),
///                       displacement, speed (along z of a; prismatic, cylindrical, translation-motor), distance,
///                       displacement_x, displacement_y, bend_angle with their rates, tooth_force, separating_force,
///                       tension, friction_force, friction_moment, stop_force, stop_moment (positive holds the
///                       coordinate back)
///   CABLE (a force)     tension (in its last part), first_tension, length, rate
///   SUPPORT             force moment on its body, the moment about the mean of its nodes
///   FORCE               force moment on frame b (a load: a); of springs and motors coordinate, rate, strength
///   inputs, sensors     by their names
struct Offer {
  std::vector<std::pair<std::string, VectorFunctionPtr>> vectors;
  std::vector<std::pair<std::string, StateFunctionPtr>> scalars;
};
/// Nothing where there is no such object. The mechanism must outlive what is made of it.
[[nodiscard]] std::optional<Offer> functions_of(const Mechanism& mechanism, const std::string& object);
/// @throws Error(invalid_input) without a place, for what is unknown or has no derivatives
[[nodiscard]] StateFunctionPtr find_function(const Mechanism& mechanism, const std::string& request);
/// Names of all objects, for suggestions.
[[nodiscard]] std::vector<std::string> object_names(const Mechanism& mechanism);
[[nodiscard]] std::vector<std::string> split_name(const std::string& request);
/// The same with the name of an object in one piece: "hinge.a.position.x" has the object "hinge.a", a frame of a joint.
[[nodiscard]] std::vector<std::string> split_name(const Mechanism& mechanism, const std::string& request);
/// The frame of a marker, or of a joint or force ("hinge.a"); null: there is none of that name.
[[nodiscard]] const Frame* frame_named(const Mechanism& mechanism, const std::string& object);

/// @param parts one for each of the expression's quantities()
[[nodiscard]] StateFunctionPtr expression_function(const Formula& formula, std::vector<StateFunctionPtr> parts);
[[nodiscard]] StateFunctionPtr constant_function(double value);

}  // namespace espalier::dynamics::model
