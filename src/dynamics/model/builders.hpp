/// \file
/// Pieces of the builder: bodies and frames.
#pragma once

#include <stdexcept>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// Runs `make`; what the library finds wrong gets the place in the model text.
template <class Make>
void at_place(const Place& place, const Make& make) {
  try {
    make();
  } catch (const std::invalid_argument& error) {
    fail(place, error.what());
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code != StatusCode::invalid_input && code != StatusCode::singular) throw;  // singular: of the given positions
    const std::string text = error.what();
    if (text.rfind(place.file + ":", 0) == 0) throw;  // has its place already
    fail(place, text);
  }
}

/// Makes one body and adds it to the system.
[[nodiscard]] BuiltBody build_body(const BodySpec& spec, const Description& model, Mechanism& out);

/// Makes frames of markers.
class FrameBuilder {
 public:
  FrameBuilder(const Description& model, const Mechanism& built) : model_(model), built_(built) {}

  /// To be called when all bodies stand and before anything else.
  void note_initial_state();
  /// @throws Error(invalid_input) with the place of the marker
  [[nodiscard]] std::unique_ptr<Frame> make(const MarkerSpec& marker) const;
  /// Where the frame is in the initial state of the model.
  [[nodiscard]] FrameMotion initial_motion(const MarkerSpec& marker) const;
  [[noreturn]] void unknown_body(const std::string& name, const Place& place) const;
  /// Follows references. @throws on a cycle and on unknown names
  [[nodiscard]] const MarkerSpec& resolve(const MarkerSpec& marker) const;

 private:
  [[nodiscard]] std::unique_ptr<Frame> make_flexible(const MarkerSpec& marker, const BuiltBody& body) const;
  [[nodiscard]] std::unique_ptr<Frame> make_face(const MarkerSpec& marker, const BuiltBody& body,
                                                 const Mat3& axes) const;
  [[nodiscard]] Index node(const MarkerSpec& marker, const BuiltBody& body) const;

  const Description& model_;
  const Mechanism& built_;
  std::vector<double> q_, v_;
};

/// Stops and friction of a joint that is in the system already.
void build_contacts(const JointSpec& spec, const FrameBuilder& frames, Joint& joint, Mechanism& out);
/// Inputs of the program and switches; before build_functions().
void build_controls(const Description& model, Mechanism& out);
/// What forces, sensors and events are functions of; when all joints and forces stand, before the system is finished.
void build_functions(const Description& model, Mechanism& out);

}  // namespace espalier::dynamics::model
