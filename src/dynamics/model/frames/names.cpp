#include "dynamics/model/frames/names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>

namespace espalier::dynamics::model {
namespace {

class FrameNames {
 public:
  explicit FrameNames(Description& model) : model_(model), bodies_({"ground"}) {
    for (const BodySpec& body : model.bodies) bodies_.insert(body.name);
    for (const JointSpec& joint : model.joints) frames_.emplace(joint.name, &joint.frames);
    for (const ForceSpec& force : model.forces) frames_.emplace(force.name, &force.frames);
  }

  void settle(MarkerSpec& frame) {
    if (frame.reference.empty() || model_.markers.contains(frame.reference)) return;
    const std::string name = frame.reference;
    if (const std::size_t dot = name.rfind('.'); dot != std::string::npos) {
      const MarkerSpec* other = frame_of(name.substr(0, dot), name.substr(dot + 1));
      if (other == nullptr) unknown(frame);
      constexpr int kDeepest = 100;
      if (++depth_ > kDeepest) fail(frame.place, fmt::format("the frames refer to each other in a circle: '{}'", name));
      MarkerSpec copy = *other;
      settle(copy);
      --depth_;
      take(copy, frame);
      return;
    }
    if (!bodies_.contains(name)) unknown(frame);
    MarkerSpec whole;
    whole.body = name;
    take(whole, frame);
  }

 private:
  static void take(MarkerSpec meant, MarkerSpec& frame) {
    meant.place = frame.place;
    meant.name = frame.name;
    frame = std::move(meant);
  }

  [[nodiscard]] const MarkerSpec* frame_of(const std::string& object, const std::string& letter) const {
    const auto found = frames_.find(object);
    const std::size_t which = letter.size() == 1 ? at(letter[0] - 'a') : 4;
    return found != frames_.end() && which < found->second->size() ? &(*found->second)[which] : nullptr;
  }

  [[noreturn]] void unknown(const MarkerSpec& frame) const {
    std::vector<std::string> names = {"ground"};
    for (const auto& [name, marker] : model_.markers) names.push_back(name);
    for (const BodySpec& body : model_.bodies) names.push_back(body.name);
    if (frame.reference.find('.') != std::string::npos)
      for (const auto& [name, frames] : frames_)
        for (std::size_t k = 0; k < frames->size(); ++k) names.push_back(fmt::format("{}.{}", name, "abcd"[k]));
    fail(frame.place,
         fmt::format("unknown marker '{}': there is no marker, no body and no frame of a joint or force of "
                     "that name{}",
                     frame.reference, suggestion(frame.reference, names)));
  }

  Description& model_;
  std::set<std::string> bodies_;                                  // with the ground
  std::map<std::string, const std::vector<MarkerSpec>*> frames_;  // of joints and forces
  int depth_ = 0;
};

}  // namespace

void keep_named_frames(std::vector<MarkerSpec>& frames, Description& model) {
  for (MarkerSpec& frame : frames) {
    if (frame.name.empty()) continue;
    const auto plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; };
    if (!std::all_of(frame.name.begin(), frame.name.end(), plain))
      fail(frame.place, fmt::format("the name '{}': names are made of letters, digits, - and _", frame.name));
    const auto [known, fresh] = model.markers.emplace(frame.name, frame);
    if (!fresh)
      fail(frame.place, fmt::format("the name '{}' is taken by {} (line {}); choose another", frame.name,
                                    known->second.place.path, known->second.place.line));
    MarkerSpec reference;
    reference.place = frame.place;
    reference.reference = frame.name;
    frame = std::move(reference);
  }
}

void settle_frame_names(Description& model) {
  FrameNames names(model);
  for (auto& [name, marker] : model.markers) names.settle(marker);
  for (JointSpec& joint : model.joints)
    for (MarkerSpec& frame : joint.frames) names.settle(frame);
  for (ForceSpec& force : model.forces)
    for (MarkerSpec& frame : force.frames) names.settle(frame);
}

}  // namespace espalier::dynamics::model
