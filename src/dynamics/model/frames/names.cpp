#include "dynamics/model/frames/names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace espalier::dynamics::model {
namespace {

class FrameNames {
 public:
  explicit FrameNames(Description& model) : model_(model) {}

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
    const auto named = [&](const BodySpec& body) { return body.name == name; };
    if (name != "ground" && std::none_of(model_.bodies.begin(), model_.bodies.end(), named)) unknown(frame);
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
    const std::size_t which = letter.size() == 1 ? static_cast<std::size_t>(letter[0] - 'a') : 4;
    const auto find = [&](const auto& list) -> const MarkerSpec* {
      for (const auto& item : list)
        if (item.name == object && which < item.frames.size()) return &item.frames[which];
      return nullptr;
    };
    const MarkerSpec* found = find(model_.joints);
    return found != nullptr ? found : find(model_.forces);
  }

  [[noreturn]] void unknown(const MarkerSpec& frame) const {
    std::vector<std::string> names = {"ground"};
    for (const auto& [name, marker] : model_.markers) names.push_back(name);
    for (const BodySpec& body : model_.bodies) names.push_back(body.name);
    const auto add = [&](const auto& list) {
      for (const auto& item : list)
        for (std::size_t k = 0; k < item.frames.size(); ++k)
          names.push_back(fmt::format("{}.{}", item.name, "abcd"[k]));
    };
    if (frame.reference.find('.') != std::string::npos) {
      add(model_.joints);
      add(model_.forces);
    }
    fail(frame.place,
         fmt::format("unknown marker '{}': there is no marker, no body and no frame of a joint or force of "
                     "that name{}",
                     frame.reference, suggestion(frame.reference, names)));
  }

  Description& model_;
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
