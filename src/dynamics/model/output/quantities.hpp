/// \file
/// Numbers that a user may ask for by name: "rod.position.x", "hinge.force", "energy.total".
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "dynamics/integrators/integrator.hpp"
#include "dynamics/model/mechanism.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::dynamics::model {

class FieldQuantity;
struct FieldTable;

/// What quantities are computed from.
struct Sample {
  const State* state = nullptr;
  StepReport report;  ///< of the step that ended there; levels are always filled in
  /// The energy of the state, once a quantity has asked for it: one evaluation serves all columns of a row.
  mutable std::optional<Energy> energy = std::nullopt;
  /// The reports of contacts, kept in the same way.
  mutable std::vector<std::pair<const BuiltContact*, contact::ContactReport>> contacts = {};
  /// The samples of all elements of a body.
  mutable std::vector<std::pair<const BuiltBody*, std::shared_ptr<const FieldTable>>> fields = {};
  /// In a statics run: the load factor, which then stands for the time.
  std::optional<double> load = std::nullopt;
  [[nodiscard]] double time() const { return load ? *load : state->t; }
  /// The state with time() as its time.
  [[nodiscard]] State pictured() const {
    State picture = *state;
    picture.t = time();
    return picture;
  }
};

struct Quantity {
  std::string name;
  std::function<double(const Sample&)> value;
  std::shared_ptr<const FieldQuantity> field = nullptr;  ///< of stresses and the like: fields/field_quantity.hpp
};

/// The quantities that a request stands for (three for a vector without component):
///   BODY or MARKER  .position .velocity .acceleration (origin; a flexible body: centre of mass, no acceleration)
///                   .rotation (rotation vector) .angular_velocity        [.x .y .z]
///   JOINT.a, FORCE.b  the same of a frame of a joint or force, a to d
///   JOINT           .force .moment: of the joint on its frame b, global axes, at the frame  [.x .y .z]
///                   .coordinate: value of its first equation's relative coordinate (angle, displacement, distance)
///                   .angle .angular_speed .displacement .speed and contacts: see model/functions.hpp
///   SUPPORT         .force .moment on its body, about the mean of its nodes      [.x .y .z]
///   FORCE           .force .moment on frame b (a load: on a)   [.x .y .z]; springs, motors: .coordinate .rate
///   .strength inputs, sensors by their names energy          .kinetic .potential .total constraints     .position
///   .velocity .acceleration: largest violation step            .h .order .newton .error
///   CONTACT         .force .moment on its second surfaces [.x .y .z]; .normal_force .friction_force .penetration
///                   .pressure .area .slip_speed .points .slipping .energy: see contact/contact.hpp
///   BODY[PLACE]     .stress .strain .section .strain_energy .reaction: see fields/field_request.hpp
///   joints[PATTERN] .force .moment: sums
/// A vector also has .norm. @throws Error(invalid_input) naming the request
[[nodiscard]] std::vector<Quantity> find_quantities(Mechanism& mechanism, const std::string& request,
                                                    const Place& place);

/// All of them by full names, with dimensions.
[[nodiscard]] std::vector<SimulationQuantity> list_quantities(Mechanism& mechanism);

}  // namespace espalier::dynamics::model
