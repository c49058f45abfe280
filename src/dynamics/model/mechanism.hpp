/// \file
/// The built model: components in one system, with the names under which the text knows them.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/bodies/reduced_body.hpp"
#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/contact/rigid_contact.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/forces/cable_force.hpp"
#include "dynamics/forces/coordinate_force.hpp"
#include "dynamics/forces/face_pressure.hpp"
#include "dynamics/joints/joint.hpp"
#include "dynamics/joints/support.hpp"
#include "dynamics/model/answer/linear_response.hpp"
#include "dynamics/model/description.hpp"
#include "dynamics/model/read/identity.hpp"
#include "dynamics/model/run/controls.hpp"

namespace espalier::dynamics {
class ModalDamping;
}

namespace espalier::dynamics::model {

class Controllers;
class Erosion;

/// One body of the system; one of the first three pointers is set.
struct BuiltBody {
  BodySpec spec;
  RigidBody* rigid = nullptr;
  FlexibleBody* flexible = nullptr;
  PointMass* point = nullptr;
  ReducedBody* reduced = nullptr;    ///< of a flexible body that is reduced; `flexible` is then its mesh alone
  std::shared_ptr<const Mesh> mesh;  ///< of solids
  Material material;                 ///< of solids
  std::vector<std::string> notices;  ///< about the mesh of solids
  std::string pieces;                ///< of solids: what their mesh falls into, as a sentence; empty: it is connected
  std::vector<contact::RigidSurface> surfaces;  ///< of rigid bodies
  [[nodiscard]] const Component& component() const {
    if (rigid != nullptr) return *rigid;
    if (point != nullptr) return *point;
    if (reduced != nullptr) return *reduced;
    return *flexible;
  }
};

/// A force with the frame on which it is reported: b (1), or a (0) where there is no other.
struct BuiltForce {
  FrameForce* force = nullptr;
  int side = 1;
};

/// Stops and friction of a joint; null where it has none.
struct JointContacts {
  CoordinateForce* stop = nullptr;
  CoordinateForce* angle_stop = nullptr;
  CoordinateForce* friction = nullptr;
  CoordinateForce* angle_friction = nullptr;
  FrameForce* sliding = nullptr;          ///< friction in all directions of a surface
  CoordinateForce* separation = nullptr;  ///< of teeth at a pressure angle
};

/// A contact of the model: one component for the rigid shapes, and one for each pair with faces of a solid.
struct BuiltContact {
  std::string name;
  std::vector<contact::Contact*> parts;
  /// Sums, and largest values, over the parts.
  [[nodiscard]] contact::ContactReport report(const StateView& s) const;
};

/// A direction in which a support holds a vertex of a body.
struct HeldDirection {
  Vec3 direction = Vec3::Zero();
  std::string by;
  bool moved = false;  ///< by a function of time
};

/// A system with its names. Frames and components point into it, so it does not move.
class Mechanism {
 public:
  /// @param threads  of the assembly; 0: all cores
  explicit Mechanism(int threads);
  Mechanism(const Mechanism&) = delete;
  Mechanism& operator=(const Mechanism&) = delete;

  AssembledSystem system;
  base::ThreadPool pool;
  base::ThreadPool* step_pool = &pool;  ///< of the loops of a step; null: the calling thread makes them alone
  std::vector<BuiltBody> bodies;
  std::map<std::string, std::unique_ptr<Frame>> markers;  ///< named markers, for outputs
  std::vector<Joint*> joints;
  std::vector<BuiltForce> forces;  ///< but for pressures and cables
  std::vector<FacePressure*> pressures;
  std::vector<CableForce*> cables;
  std::vector<BuiltContact> surface_contacts;
  std::vector<contact::RigidContact*> impacts;    ///< those of them with law = "impulse"
  ModelKeys keys;                                 ///< what the model is, mesh files included: for restart files
  std::map<std::string, JointContacts> contacts;  ///< by joint
  std::vector<std::pair<std::string, StateFunctionPtr>> sensors;  ///< of the model's [sensors]
  std::vector<StateFunctionPtr> conditions;                       ///< of the model's events, in their order
  std::vector<std::vector<StateFunctionPtr>> settings;            ///< values that events set, likewise
  std::map<std::string, std::shared_ptr<double>> drives;          ///< of [harmonic]: added to forces and motors; zero
  std::vector<Support*> supports;
  std::map<std::pair<std::string, Index>, std::vector<HeldDirection>> held;  ///< by body and vertex
  std::unique_ptr<const LinearResponse> linear;        ///< of linear statics: quantities and pictures are those of it
  ModalDamping* modal_damping = nullptr;               ///< null: no body asks for it
  Controls* controls = nullptr;                        ///< null: nothing can be set, switched or happen
  Controllers* controllers = nullptr;                  ///< null: there are no FMUs
  Erosion* erosion = nullptr;                          ///< null: no body has elements that fail
  std::vector<std::string> notices;                    ///< what joints do not fit at the start, and how they hold faces
  std::vector<contact::RigidSurface> ground_surfaces;  ///< for pictures
  std::set<std::pair<std::string, std::vector<Index>>> rigid_pieces;  ///< bodies with nodes that are one rigid piece

  [[nodiscard]] const BuiltBody* body(const std::string& name) const;
  [[nodiscard]] Joint* joint(const std::string& name) const;
  [[nodiscard]] const BuiltForce* force(const std::string& name) const;
  [[nodiscard]] const Support* support(const std::string& name) const;
  /// Load factor of the forces and pressures that are functions of the state, on which stiffness depends.
  void load_functions_of_state(double factor);
  [[nodiscard]] FacePressure* pressure(const std::string& name) const;
  [[nodiscard]] CableForce* cable(const std::string& name) const;
  [[nodiscard]] const BuiltContact* surface_contact(const std::string& name) const;
  /// "; element 7 of 'rod' is inverted" where the last evaluation of a flexible body found one, else "".
  [[nodiscard]] std::string inverted_elements() const;
};

/// Reads meshes, makes bodies, joints and forces, and finishes the system.
/// @param threads  0: all cores, but one for the steps of small models
/// @throws Error(invalid_input) "file:line: path: what to do"
[[nodiscard]] std::unique_ptr<Mechanism> build(const Description& model, int threads);

}  // namespace espalier::dynamics::model
